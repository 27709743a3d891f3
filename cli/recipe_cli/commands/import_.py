"""`recipe import`: converts configurations of other tools to recipes."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from recipe_cli import completion
from recipe_cli.arguments import JSON, REPLACE, LocalPath, output_option
from recipe_cli.console import print_json, say, warn
from recipe_cli.places import check_default_folder

if TYPE_CHECKING:
    from recipe_compiler.carla import File, Imported
    from recipe_compiler.ir.errors import Problem


@click.command("import")
@click.argument("form", metavar="FORMAT", type=click.Choice(["carla"]))
@click.argument(
    "configs", nargs=-1, required=True, type=LocalPath(path_type=Path), shell_complete=completion.files(".yaml", ".yml")
)
@output_option(LocalPath(path_type=Path, file_okay=False), "The folder to write to; ./recipes by default.")
@click.option("--town", metavar="NAME", help="The town to use; by default the one most similar to the configuration's.")
@click.option("--frames", metavar="N", type=click.IntRange(1), help="The number of frames, instead of max_frames.")
@click.option("--hero", metavar="BLUEPRINT", help="CARLA's blueprint of the actor that another program spawns.")
@click.option("--traffic", metavar="VEHICLES,PEDESTRIANS", help="Add traffic, as generate_traffic.py does.")
@REPLACE
@JSON
def command(
    form: str,
    configs: tuple[Path, ...],
    output: Path | None,
    town: str | None,
    frames: int | None,
    hero: str | None,
    traffic: str | None,
    replace: bool,
    as_json: bool,
) -> None:
    """Convert each configuration of CARLA's data collector among CONFIGS to a recipe, and report every key.

    FORMAT is `carla`. Files with only weather parameters become variants. Files with neither actors nor weather contain
    settings for all configurations.
    """
    from recipe_compiler import carla
    from recipe_runtime.core.files import host_errors
    from recipe_runtime.core.outputs import write_output

    options = carla.Options(town, frames, hero, *_numbers(traffic))
    folder = output or check_default_folder(Path("recipes"))
    made = carla.import_configurations([_read(path) for path in configs], options)
    files = {folder / name: body for one in made for name, body in _files(one).items()}
    _check_free(files, configs, replace=replace)
    for one in made:
        warn(*_compiled(one, folder))
    with host_errors(str(folder), "free some space, or choose another --output"):
        folder.mkdir(parents=True, exist_ok=True)
        for path, body in files.items():
            write_output(path, body, replace=True)
    if as_json:
        print_json({"imports": [{"file": str(folder / f"{one.name}.yaml"), **one.report.document()} for one in made]})
        return
    for one in made:
        _print(one, folder)


def _print(one: Imported, folder: Path) -> None:
    for line in one.report.lines():
        say(line)
    counts = ", ".join(f"{number} {outcome}" for outcome, number in one.report.counts().items())
    path = folder / f"{one.name}.yaml"
    say(f"{path} written: {counts}; {folder / one.name}.import.txt has the same report. Next:")
    say(f"  recipe shot {shlex.quote(str(path))} -o shot.png")


def _numbers(traffic: str | None) -> tuple[int, int]:
    """Return the vehicles and pedestrians of the option `--traffic`."""
    from recipe_compiler.ir.errors import Code, InputError

    match = re.fullmatch(r"([0-9]{1,9}),([0-9]{1,9})", "0,0" if traffic is None else traffic)
    if match is None:
        message = f"--traffic {(traffic or '')[:100]!r} is not two whole numbers"
        raise InputError(message, help="write vehicles and pedestrians, such as --traffic 30,10", code=Code.USAGE)
    return int(match[1]), int(match[2])


def _read(path: Path) -> File:
    """Read the file of a configuration."""
    from recipe_compiler.carla import File
    from recipe_compiler.ir.bounded_reads import read_regular
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.source.yaml_reader import MAX_BYTES

    remedy = "name a configuration of CARLA's data collector"
    try:
        return File(str(path), read_regular(path, MAX_BYTES))
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file", help=remedy, code=Code.FILE_NOT_FOUND) from None
    except (OSError, ValueError) as error:
        cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{path}: cannot be read: {cause}", help=remedy, code=Code.UNREADABLE_FILE) from None


def _files(one: Imported) -> dict[str, bytes]:
    """Return the files of an import by name: the recipe and its report."""
    report = "".join(f"{line}\n" for line in one.report.lines())
    return {f"{one.name}.yaml": one.text.encode(), f"{one.name}.import.txt": report.encode()}


def _check_free(files: dict[Path, bytes], configs: Sequence[Path], *, replace: bool) -> None:
    """Raise InputError if a file exists with other content and may not be replaced; inputs never may."""
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_runtime.core.outputs import check_output, holds

    for path, body in files.items():
        if path.exists() and any(path.samefile(config) for config in configs):
            help = "choose another --output"
            raise InputError(f"{path} is the configuration itself", help=help, code=Code.OUTPUT_IN_THE_WAY)
        if not os.path.lexists(path) or not holds(path, body):
            check_output(path, replace=replace)


def _compiled(one: Imported, folder: Path) -> Sequence[Problem]:
    """Compile a recipe before it is written, and return its warnings.

    Raises:
        InputError: It cannot be compiled; places are those of the configuration.
    """
    import tempfile
    from dataclasses import replace

    from recipe_compiler.compile import compile_recipe
    from recipe_compiler.estimate import TooLargeError
    from recipe_compiler.ir.errors import InputError

    def placed(problem: Problem) -> Problem:
        key = problem.message.partition(":")[0]
        row = next((row for row in one.report.rows if row.to.startswith(f"base.{key}")), None)
        note = f"in the recipe {folder / one.name}.yaml"
        return replace(problem, place=None if row is None else row.place, source=None, note=note)

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / f"{one.name}.yaml"
        path.write_text(one.text, encoding="utf-8")
        try:
            return [placed(warning) for warning in compile_recipe(path).warnings]
        except InputError as error:
            problems = [placed(problem) for problem in error.problems]
            if isinstance(error, TooLargeError):
                return problems
            raise InputError(problems) from None
