"""`recipe export`: writes a dataset in another format."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import ALLOW_LARGE, JSON, LocalPath, output_option, replace_option
from recipe_cli.console import note, print_json, say, warn
from recipe_cli.host_limits import check_bytes, check_cost
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_runtime.dataset.reader import Dataset
    from recipe_runtime.transfer.layouts import Layout

_MAX_SHARD = 1 << 50  # bytes
_COPIES = {"armory": 4}  # of a picture in an export: one for each layout
_POSE_BYTES = 48  # of a frame without a picture in an export for KITTI
_MAX_NAMES = 20  # of sensors in a warning


@click.command("export")
@click.argument("dataset", type=LocalPath(path_type=Path))
@click.argument("out", required=False, type=LocalPath(path_type=Path))
@output_option(LocalPath(path_type=Path), "The folder to write to, instead of the argument OUT.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["webdataset", "mots", "kitti", "armory"]),
    default="webdataset",
    show_default=True,
    help="The output format: tar shards, or the layout of MOTSChallenge, KITTI or Armory.",
)
@click.option(
    "--shard-size",
    metavar="SIZE",
    default="1G",
    show_default=True,
    help="Size limit of a shard of webdataset; only a shard with a single frame may exceed it.",
)
@click.option("--patch", metavar="NAME", help="The patch that armory exports; default: the first of each variant.")
@replace_option("Replace another export, or a folder with other files.")
@ALLOW_LARGE
@JSON
def command(
    dataset: Path,
    out: Path | None,
    output: Path | None,
    form: str,
    shard_size: str,
    patch: str | None,
    replace: bool,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Export the frames of DATASET, a folder that `recipe build` wrote, to OUT.

    webdataset: tar files in which the pictures and the records of a frame are adjacent. mots and kitti: pictures and
    labels in the layout of MOTSChallenge, or of KITTI's tracking and MOTS benchmarks. armory: frames and the ground
    truth of one patch in the layouts of Armory's CARLA datasets.
    """
    if (out is None) == (output is None):
        raise click.UsageError("Missing argument 'OUT'." if out is None else "OUT and --output are both given.")
    if patch is not None and form != "armory":
        raise click.UsageError("--patch needs --format armory.")
    folder = out or output
    assert folder is not None
    from recipe_compiler.estimate import size
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_runtime.cache import pruning
    from recipe_runtime.dataset.reader import read
    from recipe_runtime.transfer import shards

    shard_bytes = pruning.bytes_of(shard_size)
    if not 1 <= shard_bytes <= _MAX_SHARD:
        raise InputError(
            f"--shard-size {shard_size}: a shard holds 1 byte to {size(_MAX_SHARD)}",
            help="write for example 500M or 1G",
            code=Code.OUT_OF_RANGE,
        )
    found, notices = read(dataset), list[str]()
    _check_size(found, form, allow_large=allow_large)
    if form != "webdataset":
        _export_layout(found, folder, cast("Layout", form), patch, replace=replace, as_json=as_json)
        return
    with Progress(quiet=as_json) as progress:
        index = shards.webdataset(found, folder, progress, shard_bytes, replace=replace, notice=notices.append)
    for text in notices:
        note(text)
    if as_json:
        print_json(index)
        return
    rows = index["shards"]
    total = sum(shard["size"] for shard in rows)
    samples = sum(shard["samples"] for shard in rows)
    say(f"{folder}: {count(samples, 'sample')} in {count(len(rows), 'shard')}, {size(total)}")
    say(index["dataset"])


def _check_size(dataset: Dataset, form: str, *, allow_large: bool) -> None:
    """Raise InputError if an export of a dataset, which is untrusted, exceeds the limits of a recipe.

    Few bytes may hold large pictures, or sensors whose frames are far apart.
    """
    clips = sum(v.scene.clock.frames * len(v.rig.sensors) for v in dataset.plan.variants) if form == "kitti" else 0
    check_bytes(dataset, copies=_COPIES.get(form, 1), more=clips * _POSE_BYTES, allow_large=allow_large)
    check_cost(dataset.plan, dataset.name, "give --allow-large if that is expected", allow_large=allow_large)


def _export_layout(
    dataset: Dataset,
    folder: Path,
    form: Layout,
    patch: str | None,
    *,
    replace: bool,
    as_json: bool,
) -> None:
    """Export to the layout of a benchmark, and report."""
    from recipe_compiler.estimate import size
    from recipe_runtime.transfer import layouts

    notices = list[str]()
    with Progress(quiet=as_json) as progress:
        made = layouts.export_layout(
            dataset, folder, form, progress, patch=patch, replace=replace, notice=notices.append
        )
    for text in notices:
        note(text)
    if form == "kitti":
        _warn_of_distortion(dataset)
    total = sum(cast("int", row[0]) for row in made["files"].values())
    left_out = {"left_out": _report_left_out(folder, made["files"], as_json)} if form == "armory" else {}
    if as_json:
        print_json({**made, "files": len(made["files"]), "bytes": total, **left_out})
        return
    say(f"{folder}: {count(len(made['files']), 'file')}, {size(total)}")
    say(made["dataset"])


def _warn_of_distortion(dataset: Dataset) -> None:
    """Warn of sensors whose pictures a calibration of KITTI does not describe."""
    from recipe_compiler.ir.errors import Code, Problem
    from recipe_compiler.ir.optics import bends

    sensors = [sensor for variant in dataset.plan.variants for sensor in variant.rig.sensors]
    bent = list(dict.fromkeys(sensor.name for sensor in sensors if bends(sensor.camera)))
    if bent:
        more = f" and {count(len(bent) - _MAX_NAMES, 'other sensor')}" if len(bent) > _MAX_NAMES else ""
        names = ", ".join(bent[:_MAX_NAMES]) + more
        what = f"pictures of {names} have lens distortion, which KITTI's calibration cannot describe"
        remedy = "undistort them with the `distortion` in labels.jsonl, or set lens_k and lens_kcube to 0"
        warn(Problem(what, None, remedy, Code.INVALID_DATASET))


def _report_left_out(folder: Path, files: Iterable[str], as_json: bool) -> int:
    """Report the frames and videos that an export for Armory lacks, and return the number of rows that list them."""
    from recipe_compiler.ir.errors import Code, Problem
    from recipe_runtime.transfer.armory import LEFT_OUT

    table, rows = folder / LEFT_OUT, 0
    if LEFT_OUT in files:
        with table.open("rb") as lines:
            rows = sum(1 for _ in lines) - 1
    if not any(file.endswith(".png") for file in files):
        remedy = f"{table} has the reasons"
        warn(
            Problem(
                f"{folder}: Armory can use no frame, so the export has no picture", None, remedy, Code.INVALID_DATASET
            )
        )
    elif rows and not as_json:
        note(f"{table} has {count(rows, 'row')}: frames and videos that were left out, with the reasons")
    return rows
