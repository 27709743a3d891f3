"""The export formats: one module each, found by the names in the registry `FORMATS`.

The command line and the documentation read the registry, so it imports no format. The docstring of a format's module is
its section in docs/dataset.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_runtime.transfer.formats.format import Format


@dataclass(frozen=True)
class Option:
    """An option of the command line that some formats take: its name without `--`, and its help."""

    name: str
    metavar: str
    help: str


@dataclass(frozen=True)
class FormatEntry:
    """A format, as the command line and the documentation know it.

    Attributes:
        help: What is written, in words.
        options: The options that it takes.
    """

    help: str
    options: tuple[Option, ...] = ()


_SHARD_SIZE = Option("shard-size", "SIZE", "the size limit of a shard, unless one frame alone is larger; default: 1G")
_CATEGORIES = Option(
    "categories",
    "MAP",
    "the category of each class: carla, coco, or a YAML file with lines such as `Car: car`; default: the format's own",
)
_TASK = Option("task", "TASK", "detect for boxes or segment for outlines; default: detect")
_PATCH = Option("patch", "NAME", "the patch to export; default: the first of each variant")

FORMATS: Mapping[str, FormatEntry] = {
    "webdataset": FormatEntry("tar shards for training", (_SHARD_SIZE,)),
    "mots": FormatEntry("the layout of MOTSChallenge, which TrackEval reads", (_CATEGORIES,)),
    "kitti": FormatEntry("the layout of KITTI's tracking and MOTS benchmarks", (_CATEGORIES,)),
    "armory": FormatEntry("the layouts of Armory's CARLA datasets, with one patch", (_PATCH,)),
    "yolo": FormatEntry("the layout on which Ultralytics' YOLO trains detectors", (_TASK, _CATEGORIES)),
    "hf": FormatEntry("a folder that Hugging Face's `datasets` loads", (_CATEGORIES,)),
    "mot": FormatEntry("the layout of MOTChallenge, with boxes", (_CATEGORIES,)),
}
"""All export formats by name, the default first."""


def options() -> Mapping[Option, list[str]]:
    """Return the options of all formats, each with the names of the formats that take it."""
    found: dict[Option, list[str]] = {}
    for name, kind in FORMATS.items():
        for option in kind.options:
            found.setdefault(option, []).append(name)
    return found


def declared(name: str) -> Format:
    """Return the format of a name in the registry."""
    found: Format = import_module(f"{__name__}.{name}").FORMAT
    return found
