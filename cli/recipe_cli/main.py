"""The `recipe` command: a group that loads each command when it is called, and turns errors into exit codes.

Exit codes: 0 done or PASS, 1 FAIL or the host failed, 2 bad input, 3 INCONCLUSIVE, 130 interrupted.
"""

from __future__ import annotations

import importlib
import keyword
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from recipe_cli import usage
from recipe_cli.console import State, fail, say

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

# name -> what `recipe --help` says of it; the module of that name holds the command.
COMMANDS = {
    "init": "Write a new recipe, commented, ready to edit.",
    "import": "Write recipes from configurations of CARLA's data collector.",
    "check": "Read a recipe and report every mistake in it.",
    "plan": "Show what a recipe defines and what it costs, before any work.",
    "shot": "Render one frame, to look at.",
    "build": "Build the dataset.",
    "view": "Look at a dataset: its page, annotated pictures, films.",
    "stats": "Print the numbers of a dataset or a recipe.",
    "lock": "Write the lockfile: a digest for every frame.",
    "verify": "Re-render sample frames and compare them, byte for byte.",
    "why": "Say where a pixel of a frame comes from.",
    "validate": "Check that the files of a dataset agree with each other.",
    "diff": "Report the differences between two recipes, lockfiles or datasets.",
    "merge": "Make a dataset from an earlier one and a delta.",
    "bisect": "Name the commits at which a frame changed.",
    "doctor": "Report the host's fingerprint and the tiers that hold on it.",
    "attest": "Write an in-toto statement about a build or a verification.",
    "pack": "Put a recipe and all that it needs into one file to share.",
    "export": "Write a dataset in another form, to train from.",
    "cache": "Show what is kept between runs, or make it smaller.",
    "blueprints": "List the actors that recipes may name, with pictures.",
    "surfaces": "List what patches can be put on, with pictures to paint on.",
    "schema": "Print the JSON Schema of recipes, for editors.",
}


class LazyGroup(click.Group):
    """Commands are listed from the table and imported on use, so that `--help` is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which a user meets them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name, imported now."""
        if cmd_name not in COMMANDS:
            return None
        suffix = "_" if keyword.iskeyword(cmd_name) else ""
        module = importlib.import_module(f"recipe_cli.commands.{cmd_name}{suffix}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The table, without importing anything."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Name the nearest command when one is mistyped."""
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            import difflib

            near = difflib.get_close_matches(args[0], COMMANDS, 1)
            hint = f"did you mean {near[0]!r}?" if near else "`recipe --help` lists them."
            ctx.fail(f"no such command {args[0]!r}; {hint}")
        return super().resolve_command(ctx, args)


@click.group(
    cls=LazyGroup,
    invoke_without_command=True,
    subcommand_metavar="COMMAND [ARGS]...",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="dataset-recipe", prog_name="recipe")
@click.pass_context
def recipe(context: click.Context) -> None:
    """Share a recipe instead of a dataset: the same bytes, rebuilt and verified on any machine."""
    if context.invoked_subcommand is None:
        for line in context.get_help().splitlines():
            say(line, err=True)
        context.exit(2)


def main() -> None:
    """Run the command; every error is printed with its place and remedy, and ends in an exit code."""
    import signal

    for number in (signal.SIGTERM, signal.SIGHUP):  # so that temporary folders are removed, as after an error
        if signal.getsignal(number) == signal.SIG_DFL:  # `nohup` ignores the second
            signal.signal(number, lambda number, _: sys.exit(128 + number))
    run = State(as_json="--json" in sys.argv[1:])
    try:
        code = recipe.main(prog_name="recipe", complete_var="_RECIPE_COMPLETE", standalone_mode=False, obj=run)
        sys.exit(code or 0)  # it returns the code of an Exit
    except Exception as error:
        stop = _stop_behind(error)
        if isinstance(stop, SystemExit):
            sys.exit(stop.code)
        problems, code = (_interrupted(), 130) if stop is not None else _explained(error)
        _print_errors(problems, run)
        sys.exit(code)
    except KeyboardInterrupt:
        _print_errors(_interrupted(), run)
        sys.exit(130)


def _print_errors(problems: Sequence[Problem], run: State) -> None:
    """Print errors; if nobody reads them, only the exit code is left."""
    import os

    try:
        fail(problems, run)
        sys.stdout.flush()
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for number in (1, 2):  # Python writes what is left in its buffers when it ends
            os.dup2(nowhere, number)


def _stop_behind(error: BaseException) -> KeyboardInterrupt | SystemExit | None:
    """Return the signal's exception that an error was raised from: pydantic replaces it if it stops a serializer."""
    while error.__cause__ is not None:
        error = error.__cause__
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            return error
    return None


def _interrupted() -> Sequence[Problem]:
    from recipe_compiler.ir.errors import Code, Problem

    return [Problem("interrupted", help="run the command again", code=Code.INTERRUPTED)]


def _explained(error: Exception) -> tuple[Sequence[Problem], int]:
    """Return the problems of an error, and the exit code."""
    import errno
    import traceback

    from recipe_compiler.ir.errors import Code, InputError, Problem, RecipeError

    if isinstance(error, RecipeError):
        return error.problems, 2 if isinstance(error, InputError) else 1
    if isinstance(error, click.ClickException):
        return [usage.problem_of(error)], 2
    if isinstance(error, click.Abort):
        return _interrupted(), 130
    if isinstance(error, MemoryError):
        remedy = "close other programs, or ask for fewer workers or smaller pictures"
        return [Problem("out of memory", help=remedy, code=Code.OUT_OF_MEMORY)], 1
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        problem = Problem(f"{where}{error.strerror or error}", help="", code=Code.HOST)
        return [problem], 2 if error.errno == errno.ENAMETOOLONG else 1
    for line in traceback.format_exception(error):
        for each in line.rstrip("\n").split("\n"):
            say(each, err=True)
    report = "this is a fault of the program: please report it with the lines above"
    return [Problem(f"{type(error).__name__}: {error}", help=report, code=Code.INTERNAL)], 1
