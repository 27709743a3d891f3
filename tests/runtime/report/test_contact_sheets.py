"""The contact sheet shows every RGB camera of every variant, with the aspect ratio of its pictures."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.plan import SensorPlan
from recipe_runtime.annotate.records import FrameRecord, Video
from recipe_runtime.core import codecs
from recipe_runtime.report.contact_sheets import contact_sheet

from tests.runtime.fakes import NO_LABELS, sensor_plan

COLOURS = {"front": (200, 40, 40), "rear": (40, 200, 40), "tall": (40, 40, 200)}
VARIANTS = [f"weather={w},time={t}" for w in ("dry", "wet", "fog") for t in ("noon", "night")]


def _sensor(name: str, width: int = 64, height: int = 48, capture: tuple[str, ...] = ("rgb",)) -> SensorPlan:
    plan = sensor_plan()
    camera = plan.camera.model_copy(update={"width": width, "height": height})
    return plan.model_copy(update={"name": name, "camera": camera, "capture": capture})


def _sheet(folder: Path, sensors: list[SensorPlan], variants: list[str] = VARIANTS) -> NDArray[np.uint8]:
    record: FrameRecord = {**NO_LABELS, "digests": {"labels": ""}, "rgb": {}, "files": {}}
    for sensor in sensors:
        pixels = np.full((sensor.camera.height, sensor.camera.width, 3), COLOURS[sensor.name], np.uint8)
        (folder / f"{sensor.name}.png").write_bytes(codecs.png(pixels))
    videos = [Video(variant, "", sensor, 10, (record,)) for variant in variants for sensor in sensors]
    body = contact_sheet("tiny", videos, lambda video, frame: folder / f"{video.sensor.name}.png")
    return np.asarray(Image.open(io.BytesIO(body)))


def _areas(sheet: NDArray[np.uint8]) -> dict[str, int]:
    return {name: int((sheet == colour).all(axis=-1).sum()) for name, colour in COLOURS.items()}


def test_every_camera_of_every_variant_is_shown(tmp_path: Path) -> None:
    sheet = _sheet(tmp_path, [_sensor("front"), _sensor("rear"), _sensor("tall", capture=("depth",))])
    areas = _areas(sheet)
    assert areas["front"] == areas["rear"] > 6 * 100 * 75 and areas["tall"] == 0
    one = _areas(_sheet(tmp_path, [_sensor("front")]))
    assert one["front"] > 0 and one["rear"] == 0


@pytest.mark.parametrize(("width", "height"), [(24, 48), (96, 24)])
def test_pictures_keep_their_aspect_ratio(tmp_path: Path, width: int, height: int) -> None:
    sheet = _sheet(tmp_path, [_sensor("front"), _sensor("tall", width, height)], ["base"])
    rows, columns = np.nonzero((sheet == COLOURS["tall"]).all(axis=-1))
    shown = (np.ptp(columns) + 1) / (np.ptp(rows) + 1)
    assert shown == pytest.approx(width / height, rel=0.02)


def test_the_number_of_pictures_is_bounded(tmp_path: Path) -> None:
    sheet = _sheet(tmp_path, [_sensor("front"), _sensor("rear")], [f"v={n}" for n in range(300)])
    assert sheet.shape[0] * sheet.shape[1] < 96 * 400 * 340
    assert _areas(sheet)["rear"] > 0


def test_a_combination_of_values_without_a_variant_leaves_its_place_empty(tmp_path: Path) -> None:
    """Excluded variants were gray rectangles, which looked like pictures that failed."""
    whole, part = (_sheet(tmp_path, [_sensor("front")], names) for names in (VARIANTS, VARIANTS[:-1]))
    assert whole.shape == part.shape
    rows, columns = np.nonzero((whole != part).any(axis=-1))
    place = part[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    assert (place == part[0, 0]).all()
