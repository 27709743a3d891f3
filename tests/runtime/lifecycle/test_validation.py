"""`recipe validate` passes what a build writes, and finds a planted error even if the manifest matches it."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_runtime.annotate.records import label_digest
from recipe_runtime.dataset import reader
from recipe_runtime.lifecycle.validation import Fault, validate

from tests.cli.runner import run_here
from tests.runtime.fakes import quiet
from tests.runtime.forging import edited, rewrite

RECIPE = """
recipe: crossing
seed: 3
base:
  clock: {fps: 10, frames: 3}
  town: {name: plaza}
  weather: ClearNoon
  actors:
    near: {blueprint: walker.pedestrian.0004, start: {x: 4, y: 1, yaw: 90}, goal: {x: 4, y: 9}}
    rider: {blueprint: vehicle.bicycle.a, start: {x: 7, y: -2, yaw: 90}, route: [{x: 7, y: 6}], speed: 3}
  sensors:
    s: {mount: {z: 1.6}, camera: {width: 160, height: 120}, capture: [rgb, depth, instance, semantic]}
deltas:
  weather: {clear: {}, wet: {weather: HardRainNoon}}
"""
CLEAR = "weather=clear"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    (root / "r.yaml").write_text(RECIPE)
    done = run_here("build", "r.yaml", "-o", "ds", cwd=root)
    assert done.returncode == 0, done.stderr
    return root / "ds"


@pytest.fixture
def copy(built: Path, tmp_path: Path) -> Path:
    shutil.copytree(built, tmp_path / "ds")
    return tmp_path / "ds"


def faults(root: Path) -> list[Fault]:
    return validate(reader.read(root), quiet)


def everywhere(root: Path, path: str, body: bytes) -> None:
    """Change a file of both variants: they share their labels."""
    for variant in (CLEAR, "weather=wet"):
        rewrite(root, f"{variant}/{path}", body)


def in_picture(modality: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:  # type: ignore[type-arg]
    def plant(root: Path) -> None:
        path = f"s/{modality}/000001.png"
        with Image.open(root / CLEAR / path) as picture:
            body = io.BytesIO()
            Image.fromarray(change(np.array(picture))).save(body, "PNG")
        everywhere(root, path, body.getvalue())

    return plant


def one_pixel(pixels: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    y, x = np.argwhere(pixels > 0)[0][:2]
    pixels[y, x] = 0
    return pixels


def in_row(column: str, value: str, line: int = 3) -> Callable[[Path], None]:
    def plant(root: Path) -> None:
        rows = (root / CLEAR / "tracks.csv").read_text().splitlines()
        fields = rows[line].split(",")
        fields[rows[0].split(",").index(column)] = value
        rows[line] = ",".join(fields)
        everywhere(root, "tracks.csv", ("\n".join(rows) + "\n").encode())

    return plant


def in_label(key: str, value: object) -> Callable[[Path], None]:
    def plant(root: Path) -> None:
        path = f"{CLEAR}/s/labels.jsonl"
        lines = (root / path).read_text().splitlines()
        frame = json.loads(lines[1])
        frame["objects"][0][key] = value
        lines[1] = canonical_bytes(frame).decode()
        everywhere(root, "s/labels.jsonl", ("\n".join(lines) + "\n").encode())
        with edited(root) as manifest:
            for variant in manifest["variants"].values():
                variant["frames"]["s"]["labels"][1] = label_digest(frame)

    return plant


def without_an_event(root: Path) -> None:
    rows = (root / CLEAR / "events.csv").read_text().splitlines(keepends=True)
    everywhere(root, "events.csv", "".join(row for row in rows if not row.startswith("track")).encode())


@pytest.mark.slow
def test_a_built_dataset_has_no_fault(built: Path) -> None:
    assert faults(built) == []
    done = run_here("validate", built, cwd=built.parent)
    assert (done.returncode, done.stderr) == (0, "") and "no fault in" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "path", "row", "message"),
    [
        (in_picture("instance", one_pixel), "s/labels.jsonl", 2, "1 pixels of the instance picture differ"),
        (in_picture("semantic", lambda p: np.where(p == 12, 14, p)), "s/labels.jsonl", 2, "have another class"),
        (in_picture("depth", lambda p: p // 2), "s/labels.jsonl", 2, "lie outside of its tight box"),
        (in_row("box_x", "9.000000"), "s/labels.jsonl", 2, "is elsewhere in tracks.csv"),
        (in_row("present", "0"), "s/labels.jsonl", 2, "is not in the scene"),
        (in_row("qw", "nan"), "tracks.csv", -1, "line 4"),
        (in_row("frame", "7"), "tracks.csv", -1, "line 4 is not that of frame 1 of near"),
        (in_label("velocity", [9.0, 0.0, 0.0]), "s/labels.jsonl", 2, "has another velocity in tracks.csv"),
        (in_label("visible_fraction", 0.25), "s/labels.jsonl", 2, "visible_fraction"),
        (in_label("distance", 2.5), "s/labels.jsonl", 2, "distance of near"),
        (in_label("bbox", [1, 2, 3, 4]), "s/labels.jsonl", 2, "bbox and area"),
        (without_an_event, "events.csv", -1, "`track` rows of near in s differ"),
    ],
    ids=lambda value: value if isinstance(value, str) and " " in value else None,
)
def test_a_planted_error_is_found(copy: Path, plant: Callable[[Path], None], path: str, row: int, message: str) -> None:
    plant(copy)
    found = faults(copy)
    assert any((f.path, f.row) == (f"{CLEAR}/{path}", row) and message in f.message for f in found), found
    done = run_here("validate", copy, "--json", cwd=copy.parent)
    assert done.returncode == 1 and len(json.loads(done.stdout)["faults"]) == len(found)


@pytest.mark.slow
def test_a_missing_and_a_damaged_file_are_found(copy: Path) -> None:
    (copy / CLEAR / "s" / "rgb" / "000000.png").unlink()
    picture = copy / CLEAR / "s" / "rgb" / "000001.png"
    picture.write_bytes(picture.read_bytes()[:-1] + b"x")
    assert [f.path.rpartition("/")[2] for f in faults(copy)[:2]] == ["000000.png", "000001.png"]


@pytest.mark.slow
@pytest.mark.parametrize("body", [b"", b"frame\n", b"\xff\xfe", b"a,b\n1,2\n"])
def test_a_hostile_table_is_a_fault(copy: Path, body: bytes) -> None:
    for name in ("tracks.csv", "events.csv"):
        everywhere(copy, name, body)
    assert {f.path for f in faults(copy)} >= {f"{CLEAR}/tracks.csv", f"{CLEAR}/events.csv"}
