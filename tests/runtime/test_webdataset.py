"""The decoder for exported shards returns the dataset's values, and the example of the page runs unchanged."""

from __future__ import annotations

import gc
import io
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import webdataset
from PIL import Image
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import codecs, layout
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer.export import export
from recipe_runtime.webdataset import decode

from tests.runtime.fakes import ENGINES, dataset_plan, sensor_plan, simulate
from tests.runtime.frame_source import FrameSource
from tests.sources import ROOT

PAGE = (ROOT / "docs" / "dataset.md").read_text(encoding="utf-8")
QUIET = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning", "ignore:unclosed:ResourceWarning"
)  # the library leaves shards open


def plan_of(**outputs: object) -> DatasetPlan:
    """Return a plan of one camera that captures every modality."""
    plan = dataset_plan(frames=4, weathers=1)
    (variant, _) = plan.variants
    rig = variant.rig.model_copy(update={"sensors": (sensor_plan("street", frames=4),)})
    alone = variant.model_copy(update={"rig": rig})
    return plan.model_copy(update={"recipe": "weather_sweep", "variants": (alone,), **outputs})


def exported(plan: DatasetPlan, folder: Path, count: int = 4) -> Dataset:
    held = read(build(plan, folder / "data", BuildOptions(engines=ENGINES, workers=0, cache=folder / "cache")).path)
    options = {"shard-size": "1"} if count > 1 else {}
    made = export(held, folder / "shards" / "weather_sweep", "webdataset", lambda *_: None, options=options)
    assert [row["file"] for row in made.rows] == [f"weather_sweep-{n:06d}.tar" for n in range(count)]
    return held


@pytest.mark.slow
@QUIET
@pytest.mark.parametrize("depth", ["carla", "npy"])
def test_decoded_frames_equal_the_rendered_ones(tmp_path: Path, depth: str) -> None:
    plan = plan_of(forms={"depth": depth})
    exported(plan, tmp_path)
    tars = [str(path) for path in sorted(tmp_path.glob("shards/*/*.tar"))]
    samples = list(webdataset.WebDataset(tars, shardshuffle=False).decode(decode))
    gc.collect()
    (variant,) = plan.variants
    source = FrameSource(variant, simulate(variant.scene), engines=ENGINES)
    assert len(samples) == 4
    for number, sample in enumerate(samples):
        made = source.render("street", number)
        for modality in ("rgb", "instance", "semantic"):
            assert sample[f"{modality}.png"].dtype == made[modality].dtype
            np.testing.assert_array_equal(sample[f"{modality}.png"], made[modality])
        assert sample["instance.png"].max() > 255
        metres = sample["depth.npy" if depth == "npy" else "depth.png"]
        assert metres.dtype == np.float32
        np.testing.assert_allclose(metres, made["depth"].astype(np.float32), atol=0 if depth == "npy" else 4e-5, rtol=0)
        seen = {int(value) for value in np.unique(made["instance"])} - {0}
        assert {thing["instance"] for thing in sample["json"]["objects"]} == seen
        assert sample["__key__"] == f"{layout.folder(variant.variant)}/street/{number:06d}"
        assert (sample["json"]["variant"], sample["json"]["frame"]) == (variant.variant, number)


@pytest.mark.slow
@QUIET
def test_the_pages_example_runs_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exported(plan_of(), tmp_path, 1)  # as for the page's command: the dataset is smaller than a shard
    (example,) = (code for code in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "webdataset" in code)
    monkeypatch.chdir(tmp_path)
    known: dict[str, object] = {}
    exec(example, known)
    frame = known["frame"]
    assert isinstance(frame, dict)
    reported = re.findall(r'frame\["(\w+\.png)"\]  # (\w+) \[H, W(, 3)?\]', example)
    assert len(reported) == 4
    for key, kind, colours in reported:
        assert (frame[key].dtype.name, frame[key].ndim) == (kind, 3 if colours else 2)
    assert {value // 1000 for value in np.unique(frame["instance.png"]) if value} <= {12, 15}
    assert len(np.unique(frame["instance.png"])) > 2
    gc.collect()


def test_other_files_are_not_decoded() -> None:
    for key in (".txt", ".rgb.jpg", ".mask.png", ".cls", ".points.npy", ".meta.json"):
        assert decode(key, b"anything") is None


def test_the_decoder_can_be_pickled() -> None:
    assert pickle.loads(pickle.dumps(decode)) is decode


def _encoded(picture: Image.Image) -> bytes:
    out = io.BytesIO()
    picture.save(out, "PNG")
    return out.getvalue()


HEADER = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2000000, 3000000), }"
HUGE = b"\x93NUMPY\x01\x00\x76\x00" + HEADER.ljust(117) + b"\n"
GREY = codecs.png(np.zeros((2, 3), np.uint8))
TRANSPARENT = _encoded(Image.new("RGBA", (3, 2)))


@pytest.mark.parametrize(
    ("key", "data"),
    [
        (".instance.png", GREY),
        (".rgb.png", GREY),
        (".depth.png", GREY),
        (".semantic.png", codecs.png(np.zeros((2, 3), np.uint16))),
        (".rgb.png", b"no picture"),
        (".rgb.png", GREY[:40]),
        (".depth.npy", b"no array"),
        (".depth.npy", codecs.npy(np.zeros((2, 3), np.float64))),
        (".depth.npy", codecs.npy(np.zeros(3, np.float32))),
        (".json", b"{"),
        (".json", b"[" * 100_000),
        (".rgb.png", codecs.png(np.zeros((1, 4097, 3), np.uint8))),
        (".instance.png", codecs.png(np.zeros((4097, 1), np.uint16))),
        (".rgb.png", GREY[:33] + codecs.png(np.zeros((1, 4097, 3), np.uint8))[8:]),  # a second header
        (".depth.npy", HUGE),
        (".rgb.png", TRANSPARENT),
        (".depth.png", TRANSPARENT),
        (".depth.npy", codecs.npy(np.full((2, 3), np.nan, np.float32))),
        (".json", b"[]"),
        (".json", b'{"frame": NaN}'),
        (".json", b'{"frame": 1e999}'),
        (".semantic.png", _encoded(Image.new("P", (3, 2)))),  # the numbers are places in a palette
    ],
)
def test_damaged_files_and_other_types_are_errors(key: str, data: bytes) -> None:
    with pytest.raises(ValueError):
        decode(key, data)
