"""`recipe validate`: checks that the files of a dataset agree with each other."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import ALLOW_LARGE, JSON, PlaceOrUrl, dataset_at, shown
from recipe_cli.console import print_json, say
from recipe_cli.host_limits import check_bytes
from recipe_cli.progress import Progress

_MAX_SHOWN = 20


@click.command("validate")
@click.argument("dataset", type=PlaceOrUrl(path_type=Path))
@ALLOW_LARGE
@JSON
def command(dataset: Path | str, allow_large: bool, as_json: bool) -> None:
    """Check that the files of DATASET, a folder or a URL, agree with each other, without rendering.

    Files are compared with the manifest, annotation files with the labels, labels with the pictures and with the tables
    of motion and events. Exit code 0: no fault, 1: there are faults; each is printed with its file and line.
    """
    from recipe_compiler.ir.plurals import count
    from recipe_runtime.dataset import reader
    from recipe_runtime.lifecycle.validation import validate

    with Progress(quiet=as_json) as progress, dataset_at(dataset, progress) as folder:
        held = reader.read(folder, shown(dataset))
        check_bytes(held, allow_large=allow_large)
        found = validate(held, progress)
    if as_json:
        rows = [{"path": f.path, "row": f.row if f.row >= 0 else None, "message": f.message} for f in found]
        print_json({"identity": held.lock.identity, "faults": rows})
    else:
        for fault in found[:_MAX_SHOWN]:
            say(str(fault))
        if len(found) > _MAX_SHOWN:
            say(f"... and {len(found) - _MAX_SHOWN:,} more; --json lists all")
        whole = f"no fault in {count(len(held.files), 'file')}"
        say(f"{shown(dataset)}: {count(len(found), 'fault') if found else whole}")
    raise click.exceptions.Exit(1 if found else 0)
