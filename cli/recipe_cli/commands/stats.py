"""`recipe stats`: numbers that describe a dataset, or what a recipe defines."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import click

from recipe_cli.arguments import ALLOW_LARGE, JSON, RECIPES, LocalPath, compile_quietly, unpacks
from recipe_cli.console import print_json, say, say_table

Document: TypeAlias = dict[str, Any]


@click.command("stats")
@click.argument("recipe", metavar="DATASET|RECIPE", type=LocalPath(path_type=Path), shell_complete=RECIPES)
@ALLOW_LARGE
@JSON
@unpacks("recipe")
def command(recipe: Path, allow_large: bool, as_json: bool) -> None:
    """Print the numbers of a dataset: frames, pictures, actors, and histograms of its labels.

    Of a RECIPE, those that follow from its plans are printed, before any work.
    """
    from recipe_runtime.dataset.reader import read
    from recipe_runtime.report.statistics import dataset_statistics, plan_statistics

    if recipe.is_dir():
        document = dataset_statistics(read(recipe))
    else:
        document = plan_statistics(compile_quietly(recipe, allow_large=allow_large).plan)
    if as_json:
        print_json(document)
        return
    _print(document)


def _print(document: Document) -> None:
    for name in ("variants", "scenes", "frames", "seconds", "pixels", "patches"):
        say(f"{name}: {document[name]:,}")
    for name in ("sensors", "towns"):
        say(f"{name}: {', '.join(document[name])}")
    for name in ("pictures", "actors"):
        say(f"{name}: {', '.join(f'{key} {number:,}' for key, number in document[name].items()) or 'none'}")
    if "labels" in document:
        _print_labels(document["labels"])
    say(document.get("identity") or f"plan sha256:{document['plan']}")


def _print_labels(labels: Document) -> None:
    from recipe_runtime.report.statistics import QUANTITIES

    frames, empty = labels["annotated_frames"], labels["empty_frames"]
    say(f"annotations: {labels['annotations']:,} in {frames:,} frames, of which {empty:,} have none")
    classes = labels["classes"]
    rows = [["class", "actors", "annotations"]]
    rows += [[name, f"{row['actors']:,}", f"{row['annotations']:,}"] for name, row in classes.items()]
    say()
    say_table(rows)
    for name, quantity in QUANTITIES.items():
        say()
        unit = f", {quantity.unit}" if quantity.unit else ""
        bounds = labels["bins"][name]
        ranges = [f"{a:g} to {b:g}" for a, b in pairwise(bounds)] + [f"{bounds[-1]:g} and more"]
        counts = [[classes[key]["histograms"][name][n] for key in classes] for n in range(len(bounds))]
        table = [[f"{quantity.title}{unit}", *classes]]
        table += [[which, *(f"{c:,}" for c in row)] for which, row in zip(ranges, counts, strict=True) if any(row)]
        say_table(table)
