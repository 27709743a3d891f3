"""What an export format declares: its files, and what its index and the command line say of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias, TypedDict

from recipe_compiler.ir.errors import Code, InputError, Problem
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core.documents import Meta
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.formats.category_map import CategoryMap, chosen
from recipe_runtime.transfer.formats.sequence import ExportSequence

Options: TypeAlias = Mapping[str, str]  # the given options of a format by name, such as `patch`
CATEGORIES = "categories"  # the option that names a map
Size: TypeAlias = Annotated[int, Meta(ge=0, le=1 << 50)]  # bytes


class Facts(TypedDict, total=False):
    """What an index may say of a file besides size and digest: the number of samples of a shard."""

    samples: Size


class Row(Facts):
    """A written file."""

    file: str
    size: Size
    sha256: str


class Entry(NamedTuple):
    """A file of an export.

    Attributes:
        path: Its path in the folder.
        content: Its content, or pieces of it, which are read once before the next entry is asked for.
        facts: Parts of its row; they may be set while the pieces are read.
    """

    path: str
    content: bytes | Iterable[str] | Iterable[bytes]
    facts: Facts = Facts()


@dataclass(frozen=True)
class Remarks:
    """What the command reports of an export: warnings, notes, and numbers for `--json`."""

    warnings: Sequence[Problem] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, int] = field(default_factory=dict)


def layout_key(name: str, options: Options) -> dict[str, str | int]:
    """Return what determines the files of a layout besides the dataset: of a user's map, its content.

    Raises:
        InputError: The categories are not a map.
    """
    categories = {CATEGORIES: chosen(options[CATEGORIES]).text} if CATEGORIES in options else {}
    return {"format": "recipe/layout/1", "layout": name, **options, **categories}


def categories_of(options: Options, default: CategoryMap) -> CategoryMap:
    """Return the map of categories that is given, or the format's own."""
    return chosen(options[CATEGORIES]) if CATEGORIES in options else default


def check_pictures(dataset: Dataset, options: Options) -> None:
    """Raise InputError if a dataset has no RGB pictures."""
    if not any("rgb" in sensor.capture for variant in dataset.plan.variants for sensor in variant.rig.sensors):
        raise InputError(
            f"{dataset.name} has no RGB pictures",
            help="add rgb to `capture` in the recipe, and build it again",
            code=Code.INVALID_DATASET,
        )


def by_path(rows: Sequence[Row]) -> dict[str, object]:
    """Return a table of files by their paths."""
    return {"files": {row["file"]: (row["size"], row["sha256"]) for row in rows}}


def count_files(rows: Sequence[Row]) -> str:
    """Return the number of files in words."""
    return count(len(rows), "file")


@dataclass(frozen=True)
class Format:
    """All that is known of an export format; `FORMAT` in its module.

    Attributes:
        files: Sequences, options -> the files, in the order in which they are written.
        check: Raises InputError if a dataset cannot be exported with these options.
        key: Name of the format, options -> the first part of the index: what determines the files besides the dataset.
            InputError if an option is invalid.
        table: Rows of all files -> the second part of the index.
        summary: Rows of all files -> their number in words, such as `3 files`.
        copies: How many times a file of the dataset is written, at most.
        more_bytes: Plan -> bytes that are written where the dataset has none.
        remarks: Dataset, folder of the export, rows of all files -> what is to be reported.
    """

    files: Callable[[Sequence[ExportSequence], Options], Iterator[Entry]]
    check: Callable[[Dataset, Options], None] = lambda dataset, options: None
    key: Callable[[str, Options], Mapping[str, str | int]] = layout_key
    table: Callable[[Sequence[Row]], Mapping[str, object]] = by_path
    summary: Callable[[Sequence[Row]], str] = count_files
    copies: int = 1
    more_bytes: Callable[[DatasetPlan], int] = lambda plan: 0
    remarks: Callable[[Dataset, Path, Sequence[Row]], Remarks] = lambda dataset, out, rows: Remarks()
