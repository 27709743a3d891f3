"""A folder that Hugging Face's `datasets` loads, and its Hub shows, without code: `load_dataset("FOLDER")`.

    README.md                           the card, with licence, authors and the configuration
    train/metadata.jsonl                a row for each frame of a sensor
    train/<variant>/<sensor>/rgb/000000.png   the dataset's own files, byte for byte
    <name>.recipe                       the recipe's pack, if the dataset has it

A row has all pictures of the frame, as columns with the names of modalities: `rgb`, `depth` and so on, None where the
sensor does not capture one. Modalities in `.npy` files are columns `depth_npy` with the path. `variant`, `sensor`,
`frame`, `time`, `K` and `camera_to_world` are those of labels.jsonl. `objects` has lists of equal length: `bbox` (x, y,
width, height), `category` (its name in the map of categories), `category_id`, `area`, `instance`, `actor`,
`visible_fraction`, `truncation`, `distance` and `counts` (the mask in COCO's run-length code). There is one split,
train.
"""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Iterator, Sequence

from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.core import layout
from recipe_runtime.core.files import read_inside
from recipe_runtime.dataset.card import rights
from recipe_runtime.dataset.catalogues.citation import quoted
from recipe_runtime.dataset.markdown import one_line, paragraphs
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.formats.category_map import CARLA, CategoryMap
from recipe_runtime.transfer.formats.format import Entry, Format, Options, categories_of
from recipe_runtime.transfer.formats.sequence import ExportSequence, damaged_file

_SPLIT = "train"
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
_MAX_SPDX = 40  # characters of a licence that is a name of the Hub's list


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    dataset, categories = sequences[0].dataset, categories_of(options, CARLA)
    captured = [name for name in MODALITIES if any(name in sequence.sensor.capture for sequence in sequences)]
    frames = sum(len(sequence.frames) for sequence in sequences)
    yield Entry(layout.CARD, _card(dataset, frames, captured, categories).encode())
    if dataset.recipe_file is not None:
        yield Entry(dataset.recipe_file, _pack(dataset, dataset.recipe_file))
    for sequence in sequences:
        for frame in sequence.frames:
            for name in sequence.sensor.capture:
                path, content = sequence.file(name, frame)
                yield Entry(f"{_SPLIT}/{path}", content)
    rows = (row for sequence in sequences for row in _rows(sequence, captured, categories))
    yield Entry(f"{_SPLIT}/metadata.jsonl", rows)


def _pack(dataset: Dataset, path: str) -> bytes:
    """Return the recipe's pack, compared with the manifest."""
    size, sha256 = dataset.files[path]
    try:
        body = read_inside(dataset.root, path, size)
    except (OSError, ValueError):
        body = b""
    if hashlib.sha256(body).hexdigest() != sha256:
        raise damaged_file(dataset, f"{path} differs from its SHA-256 in the manifest")
    return body


def _rows(sequence: ExportSequence, captured: Sequence[str], categories: CategoryMap) -> Iterator[str]:
    """Yield the rows of a sequence. Columns have one type in all rows, as readers expect that infer it."""
    name = sequence.variant.variant, sequence.sensor.name
    for frame in sequence.labels():
        row: dict[str, object] = {"variant": name[0], "sensor": name[1], "frame": frame["frame"]}
        for modality in captured:
            path = layout.frame_file(*name, modality, frame["frame"], sequence.dataset.plan.forms)
            ending = path.rpartition(".")[2]
            column = f"{modality}_{'file_name' if ending == 'png' else ending}"
            row[column] = path if modality in sequence.sensor.capture else None
        yield json.dumps({**row, **_labels(frame, categories)}) + "\n"


def _labels(frame: LabelledFrame, categories: CategoryMap) -> dict[str, object]:
    camera = frame["calibration"]
    found = [(item, number) for item in frame["objects"] if (number := categories.id(item["instance"])) is not None]
    return {
        "time": float(frame["time"]),
        "K": [[float(value) for value in row] for row in camera["K"]],
        "camera_to_world": [[float(value) for value in row] for row in camera["camera_to_world"]],
        "objects": _columns([item for item, _ in found], [number for _, number in found], categories),
    }


def _columns(items: Sequence[LabelRecord], numbers: Sequence[int], categories: CategoryMap) -> dict[str, list[object]]:
    """Return the columns of the objects of a frame."""
    return {
        "bbox": [item["bbox"] for item in items],
        "category": [categories.names[number] for number in numbers],
        "category_id": [*numbers],
        "area": [item["area"] for item in items],
        "instance": [item["instance"] for item in items],
        "actor": [item["actor"] for item in items],
        "visible_fraction": [float(item["visible_fraction"]) for item in items],
        "truncation": [float(item["truncation"]) for item in items],
        "distance": [float(item["distance"]) for item in items],
        "counts": [item["counts"] for item in items],
    }


def _card(dataset: Dataset, frames: int, captured: Sequence[str], categories: CategoryMap) -> str:
    """Return README.md: the configuration that the Hub reads, then the text."""
    plan, names = dataset.plan, ", ".join(f"{number} {one_line(name)}" for number, name in categories.names.items())
    parts = [
        "---\n" + "".join(f"{line}\n" for line in _head(plan, frames, captured)) + "---",
        f"# {one_line(plan.recipe)}",
        paragraphs(plan.description),
        f"    {dataset.lock.identity}",
        f"A row is one frame of one sensor, with all of its pictures and objects. Categories: {names}.",
        *rights(plan.about),
        *_rebuilding(dataset.recipe_file),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _rebuilding(recipe_file: str | None) -> list[str]:
    """Return how the dataset is built again, if its recipe is here."""
    if recipe_file is None:
        return []
    text = (
        f"`{recipe_file}` is the recipe with all of its files. Dataset Recipe builds the dataset again from it alone:"
    )
    return ["## How to rebuild it", text, f"    recipe build {shlex.quote(recipe_file)}"]


def _head(plan: DatasetPlan, frames: int, captured: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the configuration."""
    about = plan.about
    is_listed = bool(about.licence_url) and not about.licence.startswith("http") and len(about.licence) <= _MAX_SPDX
    if is_listed:
        yield f"license: {quoted(about.licence.lower())}"
    elif about.licence:
        yield "license: other"
        yield f"license_name: {quoted(about.licence)}"
        yield from [f"license_link: {quoted(about.licence_url)}"] if about.licence_url else []
    yield f"pretty_name: {quoted(plan.recipe)}"
    yield "task_categories:\n- object-detection\n- image-segmentation"
    yield from ["- depth-estimation"] if "depth" in captured else []
    yield "tags:\n- synthetic"
    yield f"size_categories:\n- {next((name for limit, name in _SIZES if frames < limit), 'n>1M')}"
    yield f"configs:\n- config_name: default\n  data_files:\n  - split: {_SPLIT}\n    path: {_SPLIT}/**"


FORMAT = Format(files=_files)
