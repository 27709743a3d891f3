"""Arguments and output that several commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from recipe_cli import completion, host_limits
from recipe_cli.console import State, warn

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_runtime.frames.engines import Engines

    from recipe_cli.progress import Progress


Command = TypeVar("Command", bound=Callable[..., object])


def _check_not_empty(value: object, param: click.Parameter | None, ctx: click.Context | None) -> None:
    """Raise a usage error for an empty text, which would be the current folder or the default."""
    if value == "":
        raise click.BadParameter("it is empty; give a path, or . for the current folder", ctx, param)


class _AnyPath(click.Path):
    """A path. What reads it reports one that this user may not read, with a remedy."""

    def __init__(self, *, file_okay: bool = True, dir_okay: bool = True, path_type: type[Path] = Path) -> None:
        super().__init__(file_okay=file_okay, dir_okay=dir_okay, readable=False, path_type=path_type)

    def convert(
        self, value: str | PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | PathLike[str]:
        """A `Path`; a usage error for an empty text."""
        _check_not_empty(value, param, ctx)
        return super().convert(value, param, ctx)


class LocalPath(_AnyPath):
    """A path of this host. A URL is refused; the message shows it without its password."""

    def convert(
        self, value: str | PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | PathLike[str]:
        """A `Path`; a usage error for a URL."""
        if isinstance(value, str) and "://" in value:
            self.fail(f"{shown(value)} is a URL; copy what is there to this host, and give its path", param, ctx)
        return super().convert(value, param, ctx)


class Share(click.FloatRange):
    """A number in a range; not NaN, which every comparison with a range lets pass."""

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """A number; a usage error for one out of the range."""
        number: float = super().convert(value, param, ctx)
        if number != number:
            self.fail(f"{value} is not a number", param, ctx)
        return number


RECIPES = completion.files(*completion.SUFFIXES)
RECIPE = click.argument("recipe", type=LocalPath(path_type=Path), shell_complete=RECIPES)
VARIANT = click.option(
    "--variant", metavar="NAME", shell_complete=completion.variants, help="The variant; the first by default."
)


def _note_json(context: click.Context, option: click.Parameter, value: bool) -> bool:
    context.ensure_object(State).as_json |= value
    return value


JSON = click.option(
    "--json",
    "as_json",
    is_flag=True,
    is_eager=True,
    callback=_note_json,
    help="Print one JSON document.",
)
ALLOW_LARGE = click.option("--allow-large", is_flag=True, help="Continue although a size limit is exceeded.")
DEVICE = click.option(
    "--device",
    default="cpu",
    show_default=True,
    shell_complete=completion.devices,
    help="Where frames are rendered: cpu, cuda (every GPU here) or cuda:N.",
)
WORKERS = click.option(
    "--workers", type=click.IntRange(1, 256), default=None, help="Worker processes; one a CPU core by default."
)


def replace_option(help: str) -> Callable[[Command], Command]:
    """Return the option `--replace` of a command that replaces other things than single files."""
    return click.option("--replace", is_flag=True, help=help)


REPLACE = replace_option("Overwrite files that exist.")


def output_option(
    kind: click.Path | click.types.StringParamType, help: str, metavar: str | None = None
) -> Callable[[Command], Command]:
    """Return the option that says where a command writes: `-o` and `--output`; `--out` is an alias."""

    def checked(context: click.Context, option: click.Parameter, value: object) -> object:
        _check_not_empty(value, option, context)
        return value

    return click.option("-o", "--output", "--out", "output", type=kind, metavar=metavar, help=help, callback=checked)


class PlaceOrUrl(_AnyPath):
    """A path, or a URL as text."""

    def convert(
        self, value: str | PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | PathLike[str]:
        """A `Path`, or the text of a URL."""
        return value if isinstance(value, str) and "://" in value else super().convert(value, param, ctx)


def shown(place: Path | str) -> str:
    """Return a path, or a URL without its password, for messages."""
    if isinstance(place, Path):
        return str(place)
    from recipe_runtime.core import urls

    return urls.shown(place)


@contextmanager
def dataset_at(place: Path | str, progress: Progress) -> Iterator[Path]:
    """Yield the folder of a dataset. One at a URL is downloaded to a temporary folder during the context."""
    if isinstance(place, Path):
        yield place
        return
    from recipe_runtime.transfer.download import fetched

    with fetched(place, progress) as folder:
        yield folder


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """Yield the path of a recipe. A pack is unpacked to a temporary folder for the duration of the context."""
    if path.suffix != ".recipe" or path.is_dir():  # a dataset's folder may have any name
        yield path
        return
    from recipe_compiler.compile import named_files
    from recipe_runtime.transfer import bundle

    with bundle.unpacked(path, named_files) as recipe:
        yield recipe


def unpacks(*names: str, keep: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a command so that it also accepts packs in place of recipes.

    Args:
        names: the arguments that may be packs; the command receives the unpacked recipes.
        keep: an extra argument in which the command receives the first of them as the user wrote it.
    """

    def around(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def opening(**values: Path) -> None:
            kept = {keep: values[names[0]]} if keep else {}
            with ExitStack() as stack:
                command(**kept, **{k: stack.enter_context(opened(v)) if k in names else v for k, v in values.items()})

        return opening

    return around


def compile_quietly(
    path: Path, *, allow_large: bool = False, free_disk: int | None = None, workers: int | None = None
) -> Compiled:
    """Compile a recipe and print its warnings.

    With a number of workers, the memory that they need is compared with that of this host.

    Raises:
        InputError: with all mistakes in the recipe.
    """
    from recipe_compiler.compile import compile_recipe

    memory = None if workers is None else host_limits.memory(workers)
    compiled = compile_recipe(path, allow_large=allow_large, free_disk=free_disk, memory=memory)
    warn(*compiled.warnings)
    return compiled


def engines_for(compiled: Compiled, simulated: Callable[[int, int], None] | None = None) -> Engines:
    """Return the engines of a build, with the paths of the recipe's assets.

    Args:
        compiled: the compiled recipe.
        simulated: called with (step, steps) during a simulation.
    """
    from recipe_runtime.core.asset_files import Assets
    from recipe_runtime.frames.engines import real_engines

    return real_engines(Assets(compiled.places), simulated)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Guard the computation and writing of a file, or of files in a folder.

    Raises:
        InputError: its folder does not exist; raised before any work.
        RunError: it cannot be written.
    """
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.core.files import host_errors

    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it first")
    with host_errors(str(path), "free some space, or choose another place"):
        yield


def worker_count(asked: int | None, device: str = "cpu") -> int:
    """Return the requested number of workers, by default the number of CPU cores that this process may use.

    Workers on a GPU share it: while one encodes, another renders; more than eight per GPU only use its memory.
    """
    import os

    cores = max(1, len(os.sched_getaffinity(0)))
    if asked or device == "cpu":
        return asked or cores
    from recipe_runtime.frames.engines import devices

    return min(cores, 8 * len(devices(device)))
