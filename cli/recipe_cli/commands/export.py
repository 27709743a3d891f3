"""`recipe export`: writes a dataset in another format."""

from __future__ import annotations

from pathlib import Path

import click
from recipe_runtime.transfer import formats

from recipe_cli.arguments import ALLOW_LARGE, JSON, Command, LocalPath, output_option, replace_option
from recipe_cli.console import held_notes, note, print_json, say, warn
from recipe_cli.host_limits import check_bytes, check_cost
from recipe_cli.progress import Progress


def _format_options(command: Command) -> Command:
    """Add the options that only some formats take; the command gets None for those that are not given."""
    for option, names in reversed([*formats.options().items()]):
        text = f"With {' or '.join(names)}: {option.help}."
        command = click.option(f"--{option.name}", metavar=option.metavar, help=text)(command)
    return command


@click.command("export")
@click.argument("dataset", type=LocalPath(path_type=Path))
@click.argument("out", required=False, type=LocalPath(path_type=Path))
@output_option(LocalPath(path_type=Path), "The folder to write to, instead of the argument OUT.")
@click.option(
    "--format",
    "form",
    type=click.Choice(list(formats.FORMATS)),
    default=next(iter(formats.FORMATS)),
    show_default=True,
    help=f"The output format. {'; '.join(f'{name}: {kind.help}' for name, kind in formats.FORMATS.items())}.",
)
@_format_options
@replace_option("Replace another export, or a folder with other files.")
@ALLOW_LARGE
@JSON
def command(
    dataset: Path,
    out: Path | None,
    output: Path | None,
    form: str,
    replace: bool,
    allow_large: bool,
    as_json: bool,
    **given: str | None,
) -> None:
    """Export the frames of DATASET, a folder that `recipe build` wrote, to OUT."""
    if (out is None) == (output is None):
        raise click.UsageError("Missing argument 'OUT'." if out is None else "OUT and --output are both given.")
    folder = out or output
    assert folder is not None
    options = {name.replace("_", "-"): value for name, value in given.items() if value is not None}
    for option, names in formats.options().items():
        if option.name in options and form not in names:
            raise click.UsageError(f"--{option.name} needs --format {' or '.join(names)}.")
    from recipe_compiler.estimate import size
    from recipe_runtime.dataset.reader import read
    from recipe_runtime.transfer.export import export

    chosen = formats.declared(form)
    chosen.key(form, options)  # refuses invalid values before the dataset is read
    found = read(dataset)
    check_bytes(found, copies=chosen.copies, more=chosen.more_bytes(found.plan), allow_large=allow_large)
    check_cost(found.plan, found.name, "give --allow-large if that is expected", allow_large=allow_large)
    with held_notes() as notice, Progress(quiet=as_json) as progress:
        made = export(found, folder, form, progress, options=options, replace=replace, notice=notice)
    for text in made.remarks.notes:
        note(text)
    warn(*made.remarks.warnings)
    if as_json:
        print_json(made.document())
        return
    say(f"{folder}: {made.summary}, {size(made.size)}")
    say(found.lock.identity)
