"""The `recipe` command: a group that loads each command when it is called, and turns errors into exit codes.

Exit codes: 0 done or PASS, 1 FAIL or the host failed, 2 bad input, 3 INCONCLUSIVE, 130 interrupted.
"""

from __future__ import annotations

import importlib
import sys

import click

# name -> what `recipe --help` says of it; the module of that name holds the command.
COMMANDS = {
    "init": "Write a new recipe, commented, ready to edit.",
    "check": "Read a recipe and report every mistake in it.",
    "plan": "Show what a recipe stands for and what it costs, before any work.",
    "shot": "Render one frame, to look at.",
    "build": "Build the dataset.",
    "lock": "Write the lockfile: a digest for every frame.",
    "verify": "Re-render sample frames and compare them, byte for byte.",
    "diff": "Say what differs between two recipes, lockfiles or datasets.",
    "doctor": "Say what this host is, and whether it makes the bytes that it should.",
    "pack": "Put a recipe and all that it needs into one file to share.",
    "export": "Write a dataset in another form, to train from.",
    "cache": "Show what is kept between runs, or make it smaller.",
    "blueprints": "List the actors that recipes may name, with pictures.",
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
        module = importlib.import_module(f"recipe_cli.commands.{cmd_name}")
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


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="dataset-recipe", prog_name="recipe")
def recipe() -> None:
    """Share a recipe instead of a dataset: the same bytes, rebuilt and verified on any machine."""


def main() -> None:
    """Run the command; every mistake ends in a line that says where, what and how to mend it."""
    import errno
    import signal

    from recipe_compiler.errors import InputError, RunError, printable

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that temporary folders go, as they do on an error
    try:
        sys.exit(recipe.main(standalone_mode=False) or 0)  # what it returns is the code of an Exit
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except InputError as error:
        for problem in error.problems:
            click.echo(printable(str(problem)), err=True)
        sys.exit(2)
    except RunError as error:
        click.echo(printable(str(error)), err=True)
        sys.exit(1)
    except MemoryError:
        click.echo("out of memory; close other programs, or ask for fewer workers or smaller pictures", err=True)
        sys.exit(1)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        click.echo(printable(f"{where}{error.strerror or error}"), err=True)
        sys.exit(2 if error.errno == errno.ENAMETOOLONG else 1)
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        sys.exit(130)
