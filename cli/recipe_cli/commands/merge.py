"""`recipe merge`: a dataset from an earlier one and a delta."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import ALLOW_LARGE, JSON, LocalPath, output_option, replace_option
from recipe_cli.console import held_notes, print_json, say
from recipe_cli.host_limits import check_bytes
from recipe_cli.progress import Progress
from recipe_cli.suggestions import check_exists


@click.command("merge")
@click.argument("dataset", type=LocalPath(path_type=Path, file_okay=False))
@click.argument("delta", type=LocalPath(path_type=Path, file_okay=False))
@output_option(LocalPath(path_type=Path, file_okay=False), "The folder of the dataset to make; required.")
@replace_option("Replace another dataset, or a folder with other files.")
@ALLOW_LARGE
@JSON
def command(dataset: Path, delta: Path, output: Path | None, replace: bool, allow_large: bool, as_json: bool) -> None:
    """Make a dataset from DATASET and DELTA, which `recipe diff --output` wrote. Nothing is rendered.

    The result equals the dataset that the delta was made of, to the byte. Every file is compared with its SHA-256.
    """
    from recipe_compiler.ir.plurals import count
    from recipe_runtime.dataset import reader
    from recipe_runtime.lifecycle.delta import apply_delta

    if output is None:
        raise click.UsageError("Missing option '--output'.")
    for path in (dataset, delta):
        check_exists(path)
    held = reader.read(dataset)
    check_bytes(held, copies=1, allow_large=allow_large)
    with held_notes() as notice, Progress(quiet=as_json) as progress:
        made = apply_delta(held, delta, output, progress, replace=replace, notice=notice)
    if as_json:
        print_json({"folder": str(output), "identity": made.lock.identity, "files": len(made.files)})
        return
    say(f"{output}: {count(len(made.files), 'file')}")
    say(made.lock.identity)
