"""Which category of an export each class of the labels has: maps of benchmarks, and those of users.

A user's map is a YAML file with a line for each class that is exported:

    Pedestrian: person
    Rider: person
    Car: {id: 3, name: car}

Ids count from 1 in the order of the file if no line states one; then equal names are one category. A class without a
line is left out of the labels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, TypeAlias, TypedDict

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.annotate.categories import CATEGORIES, CATEGORY_IDS
from recipe_runtime.core.documents import Meta, decode_yaml

_MAX_BYTES = 1 << 16
_MAX_ID = 10_000

_Name: TypeAlias = Annotated[str, Meta(min_length=1, max_length=100)]


class _Row(TypedDict):
    """A category with its id."""

    id: Annotated[int, Meta(ge=1, le=_MAX_ID)]
    name: _Name


@dataclass(frozen=True)
class CategoryMap:
    """The categories of an export.

    Attributes:
        ids: The category of each class, by CARLA's tag; classes without one are left out.
        names: The names of all categories by id, in the order of ids.
    """

    ids: Mapping[int, int]
    names: Mapping[int, str]

    @property
    def text(self) -> str:
        """All that an export depends on, in one line."""
        return ", ".join(f"{CATEGORIES[tag]}: {number} {self.names[number]}" for tag, number in self.ids.items())

    def id(self, instance: int) -> int | None:
        """Return the category of an instance value; None if its class is left out."""
        return self.ids.get(instance // 1000)


def of_benchmark(categories: Mapping[int, str], classes: Mapping[str, int]) -> CategoryMap:
    """Return the map of a benchmark: its categories by id, and the category of each class by the class's name."""
    return CategoryMap({_TAGS[name]: number for name, number in classes.items()}, categories)


_TAGS = {name: tag for tag, name in CATEGORIES.items()}
CARLA = CategoryMap(CATEGORY_IDS, {CATEGORY_IDS[tag]: name for tag, name in CATEGORIES.items()})
COCO = of_benchmark(
    {1: "person", 2: "bicycle", 3: "car", 4: "motorcycle", 5: "airplane", 6: "bus", 7: "train", 8: "truck"},
    {"Pedestrian": 1, "Rider": 1, "Car": 3, "Truck": 8, "Bus": 6, "Train": 7, "Motorcycle": 4, "Bicycle": 2},
)
"""COCO's first eight categories, with their ids."""
MAPS: Mapping[str, CategoryMap] = {"carla": CARLA, "coco": COCO}
"""The maps that users choose by name."""


def chosen(name: str) -> CategoryMap:
    """Return the map of a name, or the one in a user's file.

    Raises:
        InputError: There is no such map or file, or the file is not a map.
    """
    return MAPS[name] if name in MAPS else _read(Path(name))


def _read(path: Path) -> CategoryMap:
    try:
        body = read_regular(path, _MAX_BYTES)
        if len(body) > _MAX_BYTES:
            raise ValueError(f"it has more than {_MAX_BYTES:,} bytes")
        rows = decode_yaml(body, dict[str, str | _Row])
    except OSError as error:
        remedy = f"write {' or '.join(MAPS)}, or name a file"
        reason = error.strerror or "not a regular file"
        raise InputError(f"{path}: cannot be read: {reason}", help=remedy, code=Code.FILE_NOT_FOUND) from None
    except ValueError as error:
        raise _wrong(path, str(error)) from None
    stated = {name: row for name, row in rows.items() if not isinstance(row, str)}
    if not rows or len(stated) not in (0, len(rows)):
        raise _wrong(path, "some lines state an id, and others do not" if rows else "it has no line")
    ids, names = dict[int, int](), dict[int, str]()
    for name, row in rows.items():
        if name not in _TAGS:
            near = get_close_matches(name, _TAGS, 1)
            raise _wrong(path, f"{name!r} is no class{f'; did you mean {near[0]}?' if near else ''}")
        text = row if isinstance(row, str) else row["name"]
        if not 0 < len(text) <= 100 or not text.isprintable() or text != text.strip():
            raise _wrong(path, f"the name of {name}'s category is not text of 1 to 100 characters")
        numbered = {known: number for number, known in names.items()}
        number = numbered.get(text, len(names) + 1) if isinstance(row, str) else row["id"]
        if names.setdefault(number, text) != text:
            raise _wrong(path, f"id {number} is both {names[number]} and {text}")
        ids[_TAGS[name]] = number
    return CategoryMap(dict(sorted(ids.items())), dict(sorted(names.items())))


def _wrong(path: Path, what: str) -> InputError:
    remedy = f"write a line such as `Car: car` or `Car: {{id: 3, name: car}}` for each of {', '.join(_TAGS)}"
    return InputError(f"{path}: {what}", help=remedy, code=Code.INVALID_VALUE)
