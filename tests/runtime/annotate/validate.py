"""Consistency checks of annotation files, beyond what format checkers report.

Reported are: duplicate frame numbers in a video, duplicate or dangling ids, NaN, boxes and areas that disagree with the
mask, boxes outside the image, overlapping masks, and missing images. Masks are decoded with pycocotools, which is
independent of the code that measures them.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pycocotools.mask

Row = dict[str, Any]


def problems(path: Path, root: Path | None = None) -> list[str]:
    """Return one line for every problem of a COCO or kwcoco file.

    Args:
        path: The annotation file.
        root: The folder that file names are relative to; the folder of `path` by default.
    """
    data = json.loads(path.read_text(encoding="utf-8"))
    found = [*_rows(data), *_numbers(data), *_masks(data)]
    found += [f"{name} is not there" for name in _files(data) if not ((root or path.parent) / name).is_file()]
    return found


def _rows(data: dict[str, list[Row]]) -> Iterator[str]:
    ids = {}
    for table in ("categories", "videos", "tracks", "images", "annotations"):
        rows = data.get(table, [])
        ids[table] = {row["id"] for row in rows}
        yield from _twice(f"{table} id", (row["id"] for row in rows))
        yield from _twice(f"{table} name", (row["name"] for row in rows if "name" in row))
    for table, key, target in (
        ("annotations", "image_id", "images"),
        ("annotations", "category_id", "categories"),
        ("annotations", "track_id", "tracks"),
        ("images", "video_id", "videos"),
    ):
        for row in data.get(table, []) if target in data else ():
            if key in row and row[key] not in ids[target]:
                yield f"{table} {row['id']}: {key} {row[key]} has no row in {target}"
    frames = [(row["video_id"], row["frame_index"]) for row in data["images"] if "frame_index" in row]
    yield from _twice("(video, frame_index)", frames)
    tracked = [(row["image_id"], row["track_id"]) for row in data["annotations"] if "track_id" in row]
    yield from _twice("(image, track)", tracked)


def _twice(what: str, values: Iterable[object]) -> Iterator[str]:
    for value, count in Counter(values).items():
        if count > 1:
            yield f"{what} {value!r} occurs {count} times"


def _numbers(value: object, where: str = "$") -> Iterator[str]:
    """Yield a line for every number that is not finite; the value is a list or dictionary."""
    named = isinstance(value, dict)
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in entries:
        if type(item) is float and math.isfinite(item):
            continue
        if isinstance(item, (dict, list, float)):
            place = f"{where}.{key}" if named else f"{where}[{key}]"
            yield from [f"{place} is {item}"] if isinstance(item, float) else _numbers(item, place)


def _masks(data: dict[str, list[Row]]) -> Iterator[str]:
    sizes = {row["id"]: [row["height"], row["width"]] for row in data["images"]}
    by_image: dict[int, list[Row]] = {}
    for row in data["annotations"]:
        by_image.setdefault(row["image_id"], []).append(row)
    for image_id, rows in by_image.items():
        codes = [row["segmentation"] for row in rows]
        if any(code["size"] != sizes.get(image_id) for code in codes):
            yield f"image {image_id}: a mask's size is not the picture's"
            continue
        areas, boxes = pycocotools.mask.area(codes), pycocotools.mask.toBbox(codes)
        for row, area, box in zip(rows, areas, boxes, strict=True):
            if int(area) == 0:
                yield f"annotation {row['id']}: its mask is empty"
            if row["area"] != int(area):
                yield f"annotation {row['id']}: area {row['area']} is not the mask's {int(area)}"
            if row["bbox"] != [int(v) for v in box]:
                yield f"annotation {row['id']}: bbox {row['bbox']} is not the mask's {[int(v) for v in box]}"
            if not _inside(row["amodal_bbox"], row["bbox"]):
                yield f"annotation {row['id']}: bbox {row['bbox']} reaches out of amodal_bbox {row['amodal_bbox']}"
        if int(pycocotools.mask.area(pycocotools.mask.merge(codes))) != int(sum(int(a) for a in areas)):
            yield f"image {image_id}: masks overlap"


def _inside(outer: list[int], inner: list[int]) -> bool:
    return all(outer[n] <= inner[n] and inner[n] + inner[n + 2] <= outer[n] + outer[n + 2] for n in (0, 1))


def _files(data: dict[str, list[Row]]) -> Iterator[str]:
    for row in data["images"]:
        for item in [row, *row.get("assets", [])]:
            if item.get("file_name"):
                yield item["file_name"]
