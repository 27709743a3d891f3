"""Shell completion of recipe files, and of the names in the recipe on the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem
from recipe_compiler.ir.modalities import MODALITIES

if TYPE_CHECKING:
    from recipe_compiler.checks.outline import Outline

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
_MAX_FILES = 500
SUFFIXES = (".yaml", ".yml", ".recipe")
# Bash inserts a completion as it is, so a name that is not plain text to a shell would be run: `x$(reboot).yaml`.
_PLAIN = re.compile(r"[\w./=+@%,:][\w./=+@%,:-]*")


def files(*suffixes: str) -> Completer:
    """Files with one of these suffixes, in the folder typed and one below it.

    If there are none, as where all names must be quoted, the shell itself completes files.
    """

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
        folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
        try:
            found = sorted(p for s in suffixes for level in ("*", "*/*") for p in folder.glob(f"{level}{s}"))
        except OSError:
            found = []
        names = _items((str(path) for path in found[:_MAX_FILES] if not path.name.startswith(".")), incomplete)
        return names or [CompletionItem(incomplete, type="file")]

    return complete


def recipe_or_town(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Recipe files and, with --map, also the names of towns."""
    from recipe_compiler.library import towns

    named = _items(towns.NAMES, incomplete) if context.params.get("as_map") else []
    found = files(*SUFFIXES)(context, parameter, incomplete)
    return [*named, *(item for item in found if item.type != "file" or not named)]


def surface_owner(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Recipe files, and the names of towns and blueprints."""
    from recipe_compiler.library import blueprints, towns

    named = _items((*towns.NAMES, *blueprints.names()), incomplete)
    found = files(*SUFFIXES)(context, parameter, incomplete)
    return [*named, *(item for item in found if item.type != "file" or not named)]


def variants(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The variants of the recipe."""
    return _items(_outline(context).variants, incomplete)


def sensors(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The sensors of the recipe."""
    return _items(_outline(context).sensors, incomplete)


def modalities(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """All modalities."""
    return _items(MODALITIES, incomplete)


def devices(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """cpu, cuda, and each GPU here."""
    numbers = sorted(int(path.name[6:]) for path in Path("/dev").glob("nvidia[0-9]*") if path.name[6:].isdigit())
    return _items(["cpu", "cuda", *(f"cuda:{number}" for number in numbers)], incomplete)


def _items(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Return the names with a prefix that need no quotes in a shell, because names are untrusted text."""
    return [CompletionItem(name) for name in names if name.startswith(incomplete) and _PLAIN.fullmatch(name)]


def _outline(context: click.Context) -> Outline:
    """Return the names in the recipe or dataset on the command line.

    Empty if it is invalid, since completion shows no errors.
    """
    from recipe_compiler.checks.outline import Outline, outline

    from recipe_cli.arguments import opened

    # Click stops at the option that is completed and leaves the arguments before it as they are.
    words = [context.params.get("recipe"), context.params.get("dataset"), *context.args]
    folder = next((Path(word) for word in words if word is not None and Path(word).is_dir()), None)
    if folder is not None:
        return _outline_of_dataset(folder)
    path = next((str(word) for word in words if word is not None and str(word).endswith(SUFFIXES)), None)
    if path is None:
        return Outline()
    try:
        with opened(Path(path)) as recipe:
            return outline(recipe)
    except Exception:
        return Outline()


def _outline_of_dataset(folder: Path) -> Outline:
    from recipe_compiler.checks.outline import Outline
    from recipe_runtime.dataset import manifest_reader

    try:
        manifest = manifest_reader.read(folder)
    except (OSError, ValueError):
        return Outline()
    sensors = (name for row in manifest["variants"].values() for name in row["frames"])
    return Outline(tuple(manifest["order"]), tuple(dict.fromkeys(sensors)))
