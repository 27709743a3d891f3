"""`recipe export`: writes a dataset in another format."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_runtime.transfer import formats

from recipe_cli.arguments import ALLOW_LARGE, JSON, Command, LocalPath, PlaceOrUrl, output_option, replace_option
from recipe_cli.console import held_notes, note, print_json, say, warn
from recipe_cli.host_limits import check_bytes, check_cost
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_runtime.transfer.export_upload import ExportTarget


def _format_options(command: Command) -> Command:
    """Add the options that only some formats take; the command gets None for those that are not given."""
    for option, names in reversed([*formats.options().items()]):
        text = f"With {' or '.join(names)}: {option.help}."
        command = click.option(f"--{option.name}", metavar=option.metavar, help=text)(command)
    return command


@contextmanager
def _folder_for(place: Path | str) -> Iterator[tuple[Path, ExportTarget | None]]:
    """Yield the folder to export to, and the place in a store that it is then copied to, if a URL is given."""
    if isinstance(place, Path):
        yield place, None
        return
    from recipe_runtime.transfer.export_upload import ExportTarget

    target = ExportTarget(place)
    if target.folder is not None:
        yield target.folder, None
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "export", target


@click.command("export")
@click.argument("dataset", type=LocalPath(path_type=Path))
@click.argument("out", required=False, type=PlaceOrUrl(path_type=Path))
@output_option(PlaceOrUrl(path_type=Path), "The folder or URL to write to, instead of the argument OUT.")
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
    out: Path | str | None,
    output: Path | str | None,
    form: str,
    replace: bool,
    allow_large: bool,
    as_json: bool,
    **given: str | None,
) -> None:
    """Export the frames of DATASET, a folder that `recipe build` wrote, to OUT, a folder or a URL."""
    if (out is None) == (output is None):
        raise click.UsageError("Missing argument 'OUT'." if out is None else "OUT and --output are both given.")
    place = out or output
    assert place is not None
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
    with held_notes() as notice, Progress(quiet=as_json) as progress, _folder_for(place) as (folder, target):
        made = export(found, folder, form, progress, options=options, replace=replace, notice=notice)
        if target is not None:
            target.put(folder, made.rows, progress, replace=replace)
    for text in made.remarks.notes:
        note(text)
    warn(*made.remarks.warnings)
    if as_json:
        print_json(made.document())
        return
    say(f"{place if target is None else target.url}: {made.summary}, {size(made.size)}")
    say(found.lock.identity)
