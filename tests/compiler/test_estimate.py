"""What a build takes is estimated from its plan, and limited before any work."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.estimate import Cost, Memory, TooLargeError, estimate, size
from recipe_compiler.ir.modalities import CHOICES, Form

from tests.compiler.kitchen import compiled, small
from tests.compiler.modelling import obj

RECIPES = Path(__file__).parents[2] / "recipes"
TEMPLATE = Path(__file__).parents[2] / "compiler" / "recipe_compiler" / "schema" / "template.yaml"
CAMERA = {"mount": {"x": -8, "z": 1.6}, "camera": {"width": 320, "height": 240}, "capture": ["rgb", "depth"]}
ON_WALL = {"on": {"town": "wall.1", "size": {"width": 1, "height": 1}}, "texture": {"color": "#ff0000"}}


def cost_of(camera: dict[str, Any] | None = None, *, frames: int = 20, **base: Any) -> Cost:
    """Return the cost of a recipe with one camera, whose sections are changed."""
    sensor = {**CAMERA, **(camera or {})}
    return compiled(small(**{"clock": {"fps": 10, "frames": frames}, "sensors": {"s": sensor}, **base})).cost


def test_shared_work_is_counted_once() -> None:
    deltas = {
        "weather": {"sunny": {}, "rainy": {"weather": "MidRainyNoon"}, "foggy": {"weather": {"fog_density": 90}}},
        "jitter": {"still": {"sensors": {"street": {"motion": None}}}, "shaky": {}},
        "exposure": {"dark": {"sensors": {"street": {"camera": {"exposure_compensation": -1}}}}, "light": {}},
    }
    cost = compiled(small() | {"deltas": deltas}).cost
    assert str(cost) == "12 variants: 1 simulation, 2 observations, 12 appearances"
    assert (cost.frames, cost.images) == (48, 96)
    one, two = (
        compiled(small()).cost,
        compiled(small() | {"deltas": {"w": {"a": {}, "b": {"weather": "WetNoon"}}}}).cost,
    )
    assert one.bytes < two.bytes < 2 * one.bytes and one.minutes <= two.minutes < 2 * one.minutes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "seconds", "mib", "memory"),
    [
        (TEMPLATE, 18.1, 115, 782),
        (RECIPES / "weather_sweep.yaml", 59.5, 382, 987),
        (RECIPES / "paper" / "two_pedestrians.yaml", 29.9, 587, 692),
        (RECIPES / "towns" / "crossing.yaml", 65.0, 192, 734),
        (RECIPES / "assets" / "props.yaml", 6.3, 16, 676),
        (RECIPES / "attacks" / "poster.yaml", 46.3, 264, 1198),
    ],
    ids=lambda value: value.stem if isinstance(value, Path) else "",
)
def test_estimates_are_within_a_factor_of_two_of_builds(path: Path, seconds: float, mib: float, memory: float) -> None:
    """As measured: `recipe build --workers 1` on one core, in CPU seconds, and MiB of disk and of memory."""
    cost = compile_recipe(path).cost
    for actual, expected in (
        (seconds, 60 * cost.minutes),
        (mib, cost.bytes / 2**20),
        (memory, max(cost.main_memory, cost.worker_memory) / 2**20),
    ):
        assert actual / 2 < expected < actual * 2


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        ({"frames": 400}, 1.5, 10),
        ({"clock": {"fps": 10, "frames": 20, "warmup": 600}}, 2, 10),
        ({"town": {"name": "downtown", "blocks": [5, 5]}}, 1.3, 4),
        ({"traffic": {"pedestrians": 40}}, 1.2, 5),
        ({"camera": {"camera": {"width": 1280, "height": 960}}}, 1.1, 5),
        ({"camera": {"camera": {"width": 640, "height": 480, "supersample": 4}}}, 1.2, 5),
        ({"camera": {"motion": {"jitter": {"x": 0.01}}}}, 1.05, 3),
        ({"camera": {"camera": {"motion_blur_intensity": 10.0, "shutter_speed": 1}}}, 2, 20),
        ({"patches": {f"p{n}": ON_WALL for n in range(40)}}, 1.5, 10),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_each_kind_of_work_is_part_of_the_estimate(change: dict[str, Any], least: float, most: float) -> None:
    assert least < cost_of(**change).minutes / cost_of().minutes < most


@pytest.mark.parametrize(
    "change",
    [
        {"town": {"name": "downtown", "blocks": [5, 5]}},
        {"traffic": {"pedestrians": 54}},
        {"camera": {"camera": {"width": 1024, "height": 1024}}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_memory_grows_with_town_actors_and_samples(change: dict[str, Any]) -> None:
    assert cost_of(**change).worker_memory - cost_of().worker_memory > 70 << 20


def test_a_small_file_is_counted_as_a_block_of_the_disk() -> None:
    """Regression: 3,000 frames of a few pixels were estimated at 16 bytes."""
    tiny = {"camera": {"width": 16, "height": 16}, "capture": ["instance"]}
    assert cost_of(tiny, frames=3000, actors={}, traffic={}).bytes >= 3000 * 4096


@pytest.mark.parametrize("form", [form for forms in CHOICES.values() for form in forms if form.copy])
def test_copies_for_kwcoco_are_part_of_the_estimate(form: Form) -> None:
    (name,) = (name for name, forms in CHOICES.items() if form in forms)
    sensor = {**CAMERA, "capture": ["rgb", name]}
    with_copy, without = (
        compiled(small(sensors={"s": sensor}) | {"output": {name: form.name, "annotations": annotations}}).cost.bytes
        for annotations in (["kwcoco"], ["coco"])
    )
    copies = 4 * 320 * 240 * form.copy_size
    assert copies <= with_copy - without <= copies + 4 * 4096


def test_files_of_props_and_patches_are_part_of_the_estimate(tmp_path: Path) -> None:
    """Each process decodes them for each scene: 128 MiB of empty lines took 20 s."""
    (tmp_path / "m.obj").write_bytes(obj() + b"\n" * 10_000_000)
    recipe = small(props={"a": {"asset": "m", "at": {"x": 2, "y": 2}}}) | {"assets": {"m": {"mesh": "m.obj"}}}
    (tmp_path / "r.yaml").write_text(json.dumps(recipe))
    found, plain = compile_recipe(tmp_path / "r.yaml").cost, compiled(small()).cost
    assert 0.5 < 60 * (found.minutes - plain.minutes) < 3.0
    assert found.worker_memory - plain.worker_memory > 100 << 20


def test_time_is_estimated_for_one_and_many_cores() -> None:
    cost = cost_of(frames=300)
    assert cost.minutes_with(1) == pytest.approx(cost.minutes)
    assert cost.minutes / 2 < cost.minutes_with(2) < cost.minutes
    assert cost.minutes_with(1000) == pytest.approx(cost.minutes_alone, rel=0.02)


def test_hours_of_work_require_allow_large(tmp_path: Path) -> None:
    """Regression: 962 hours were not reported, because the recipe has few frames and bytes."""
    path = tmp_path / "recipe.yaml"
    camera = {"width": 1000, "height": 800, "supersample": 4}
    sensors = {f"s{n}": {"mount": {"on": "hero1"}, "camera": camera, "capture": ["rgb"]} for n in range(4)}
    path.write_text(json.dumps(small(clock={"fps": 10, "frames": 1000}, sensors=sensors)))
    with pytest.raises(TooLargeError, match=r"about \d+ hours of one core are over 2;"):
        compile_recipe(path)
    assert compile_recipe(path, allow_large=True).cost.minutes > 120


def test_half_the_free_disk_is_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(small()))
    needed = compile_recipe(path).cost.bytes
    compile_recipe(path, free_disk=2 * needed)
    with pytest.raises(TooLargeError, match="half the free disk"):
        compile_recipe(path, free_disk=2 * needed - 2)
    with pytest.raises(TooLargeError, match=r"about \d+ KiB are over half the free disk, 500 bytes; ask for"):
        compile_recipe(path, free_disk=1000)
    with pytest.raises(TooLargeError, match=r"recipe\.yaml:1:\d+: the disk is full .*; free some space;"):
        compile_recipe(path, free_disk=0)


def test_sizes_have_suitable_units() -> None:
    assert [size(n) for n in (12, 12_345, 40_000_000, 5 * 2**30)] == ["12 bytes", "12 KiB", "38 MiB", "5.0 GiB"]


def test_memory_is_limited_to_that_of_the_host(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(small()))
    cost = compile_recipe(path, memory=Memory(1 << 40, None, 4)).cost
    needed = cost.memory_with(4)
    assert needed == cost.main_memory + 4 * cost.worker_memory
    compile_recipe(path, memory=Memory(needed * 11 // 10, None, 4))
    with pytest.raises(TooLargeError, match=r"with 4 workers are over the .* of this host \(3 workers would fit\);"):
        compile_recipe(path, memory=Memory(needed * 9 // 10, None, 4))
    with pytest.raises(TooLargeError, match=r"with 1 worker are over the \d+ MiB of this host;"):
        compile_recipe(path, memory=Memory(300 << 20, None, 1))
    with pytest.raises(TooLargeError, match="of memory a process are over the 200 MiB"):
        compile_recipe(path, memory=Memory(1 << 40, 200 << 20, 1))
    compile_recipe(path, memory=Memory(1, 1, 1), allow_large=True)


def test_the_estimate_of_a_plan_is_that_of_its_recipe() -> None:
    made = compiled(small(patches={"p": ON_WALL}))
    assert estimate(made.plan) == made.cost
    assert made.cost.over() == [] != replace(made.cost, frames=100_001).over()
