"""The PyTorch dataset has the pixels of the recipe, in any order and in any worker. `make test-torch`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import InputError
from recipe_runtime.loading import compiled

from tests.runtime.build.test_slow_sensors import SLOW
from tests.sources import ROOT

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

TINY = ROOT / "tests" / "golden" / "tiny.yaml"


@pytest.fixture
def dataset_class() -> Any:
    from recipe_runtime.torch import RecipeDataset

    return RecipeDataset


def _same(sample: Any) -> None:
    scenario = recipe_runtime.open(TINY, sample["variant"])
    ours = scenario.render(sample["frame"], sample["sensor"])
    np.testing.assert_array_equal(sample["rgb"].numpy().transpose(1, 2, 0), ours)


def test_samples_are_the_recipes_frames(dataset_class: Any) -> None:
    dataset = dataset_class(TINY)
    assert len(dataset) == 3 * 2 * 4
    for index in (23, 0, 9, -5):
        _same(dataset[index])
    last = dataset[-1]
    assert (last["variant"], last["sensor"], last["frame"]) == ("weather=night", "dash", 3)
    with pytest.raises(IndexError, match="the dataset has 24"):
        dataset[24]


def test_tensors_have_the_documented_types(dataset_class: Any) -> None:
    sample = dataset_class(TINY, sensors=["street"], variants=["weather=noon"], target=True)[1]
    assert (sample["rgb"].dtype, tuple(sample["rgb"].shape)) == (torch.uint8, (3, 72, 96))
    assert (sample["depth"].dtype, tuple(sample["depth"].shape)) == (torch.float32, (72, 96))
    assert (sample["instance"].dtype, sample["semantic"].dtype) == (torch.int32, torch.uint8)
    target = sample["target"]
    for box, instance in zip(target["boxes"], target["instances"], strict=True):
        rows, columns = torch.nonzero(sample["instance"] == instance, as_tuple=True)
        tight = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert box.tolist() == [float(v) for v in tight]
    assert len(target["boxes"]) > 0


def test_boxes_equal_those_of_pycocotools(dataset_class: Any) -> None:
    """x0, y0, x1, y1 follow from COCO's x, y, width, height of the masks, by the outer edges of the pixels."""
    sample = dataset_class(TINY, sensors=["street"], variants=["weather=noon"], target=True)[1]
    boxes, instances = sample["target"]["boxes"], sample["target"]["instances"]
    masks = sample["instance"][..., None] == instances
    encoded = pycocotools.mask.encode(np.asfortranarray(masks.numpy().astype(np.uint8)))
    found = pycocotools.mask.toBbox(encoded)
    np.testing.assert_array_equal(torch.cat([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], dim=1).numpy(), found)
    records = recipe_runtime.open(TINY, "weather=noon")[1].labels("street")
    np.testing.assert_array_equal(found, [record["bbox"] for record in records])
    assert pycocotools.mask.area(encoded).tolist() == sample["target"]["area"].tolist()
    assert len(found) > 1


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_loader_workers_render_the_same(dataset_class: Any, context: str) -> None:
    dataset = dataset_class(TINY, sensors=["dash"], modalities=["rgb", "instance"])
    expected = [dataset[k]["rgb"] for k in range(len(dataset))]  # this process has engines before the fork
    loader = torch.utils.data.DataLoader(
        dataset, batch_size=5, num_workers=2, multiprocessing_context=context, shuffle=False
    )
    batches = list(loader)
    assert batches[0]["instance"].shape == (5, 48, 64)
    assert torch.equal(torch.cat([batch["rgb"] for batch in batches]), torch.stack(expected))


def test_a_cached_dataset_equals_an_uncached_one(dataset_class: Any, tmp_path: Path) -> None:
    options: dict[str, Any] = {"variants": ["weather=rain"], "sensors": ["dash"]}
    first = [s["rgb"] for s in _all(dataset_class(TINY, disk_cache=tmp_path, **options))]
    again = [s["rgb"] for s in _all(dataset_class(TINY, disk_cache=tmp_path, **options))]
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))


def _all(dataset: Any) -> Iterator[Any]:
    return (dataset[k] for k in range(len(dataset)))


def test_unknown_names_are_refused_at_once(dataset_class: Any) -> None:
    with pytest.raises(InputError, match="no variant"):
        dataset_class(TINY, variants=["weather=snow"])
    with pytest.raises(InputError, match="no sensor 'roof'"):
        dataset_class(TINY, sensors=["roof"])
    with pytest.raises(InputError, match="there is no device 'gpu'"):
        dataset_class(TINY, device="gpu")
    with pytest.raises(InputError, match="does not capture 'depth'; it captures rgb, instance"):
        dataset_class(compiled(TINY), modalities=["depth"])


@pytest.mark.parametrize("argument", ["variants", "sensors", "modalities"])
def test_a_name_in_place_of_a_list_of_names_is_refused(dataset_class: Any, argument: str) -> None:
    """Its letters were the names."""
    with pytest.raises(InputError, match=f"{argument} is a list of names, such as \\['street'\\]"):
        dataset_class(TINY, **{argument: "street"})


def test_an_iterator_of_sensors_applies_to_every_variant(dataset_class: Any) -> None:
    names = ["street"]
    assert len(dataset_class(SLOW, sensors=iter(names))) == len(dataset_class(SLOW, sensors=names))


def test_an_index_is_not_changed(dataset_class: Any) -> None:
    index = np.array(-1)
    dataset_class(SLOW)._at(index)
    assert index == -1


def test_a_slow_sensor_has_samples_of_its_captured_frames_only(dataset_class: Any) -> None:
    places = [dataset_class(SLOW, variants=["weather=w0,jitter=still"])._at(index)[1:] for index in range(15)]
    assert places == [("street", k) for k in (0, 5, 10)] + [("side", k) for k in range(12)]
