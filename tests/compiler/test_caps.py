"""What the variants of a recipe have is counted, and capped, before anything is lowered."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler import compile as compiler
from recipe_compiler.compile import compile_recipe
from recipe_compiler.estimate import TooLargeError
from recipe_compiler.ir.errors import InputError
from recipe_compiler.lowering.caps import CAPS
from recipe_compiler.lowering.lower import Lowering

from tests.compiler.kitchen import compiled, small
from tests.compiler.modelling import picture, png

ARM = {"mount": {"on": "hero1", "x": -4, "z": 2, "attachment": "spring_arm"}, "capture": ["rgb"]}
BOARD = {"size": {"width": 1.0, "height": 0.5}, "at": {"x": 2, "y": 2}}
CLIP = {"fps": 1, "frames": 90_000}
STILL = {"mount": {"z": 2}, "capture": ["rgb"]}
TEXTURE = {"on": {"town": "wall.1", "size": {"width": 1, "height": 1}}, "texture": {"color": "#ff0000"}}
WALKER = {"blueprint": "walker.pedestrian.*"}

HOSTILE: dict[str, dict[str, Any]] = {
    "values": small(actors={"a": WALKER | {"route": [{"x": 1, "y": 2}] * 1000}})
    | {"sweep": {"draw": {"count": 9000, "values": {"actors.a.speed": {"uniform": [1, 2]}}}}},
    "frames": small(clock={"fps": 10, "frames": 60_000}) | {"sweep": {"repeats": 2}},
    "elements": small() | {"sweep": {"draw": {"count": 9000, "values": {"town.seed": {"integer": [0, 10**9]}}}}},
    "coloured": small(town={"name": "downtown", "blocks": [9, 9]}) | {"sweep": {"repeats": 9000}},
    "actors": small(traffic={"pedestrians": 250, "vehicles": 250}) | {"sweep": {"repeats": 9000}},
    "waypoints": small(clock=CLIP, traffic={"pedestrians": 250, "near": "street"}),
    "props": small(props={f"p{n}": BOARD for n in range(1000)}) | {"sweep": {"repeats": 900}},
    "patches": small(patches={f"p{n}": TEXTURE for n in range(64)}) | {"sweep": {"repeats": 9000}},
    "poses": small(clock=CLIP, sensors={n: {**STILL, "tick": 80_000, "motion": {"jitter": {"x": 1}}} for n in "ab"}),
    "obstacles": small(town={"name": "downtown", "blocks": [8, 8]}, sensors={f"s{n}": ARM for n in range(1000)}),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_recipe_is_refused_before_it_is_lowered(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Lowering, "scenario", lambda *_: pytest.fail("a variant was lowered"))
    cap = CAPS[name]
    with pytest.raises(TooLargeError, match=rf"[\d,]+ {cap.what}.* are over {cap.most:,}; ask for fewer") as caught:
        compiled(HOSTILE[name])
    assert caught.value.problems[0].place is not None


def test_images_of_patches_are_counted_in_every_variant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Lowering, "scenario", lambda *_: pytest.fail("a variant was lowered"))
    (tmp_path / "seq").mkdir()
    (tmp_path / "seq" / "0.png").write_bytes(png(picture()))
    patch = TEXTURE | {"texture": {"frames": "seq"}}
    sensors = {"s": {**STILL, "tick": 80_000}}
    recipe = small(clock=CLIP, sensors=sensors, patches={"p": patch}) | {"sweep": {"repeats": 20}}
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(recipe))
    with pytest.raises(TooLargeError, match="1,080,000 images that patches show in the first 12 of 20 variants"):
        compile_recipe(path)


def test_every_cap_has_a_hostile_recipe() -> None:
    assert {*HOSTILE, "images", "changes"} == {*CAPS}


def test_the_page_of_the_language_lists_every_cap() -> None:
    page = (Path(__file__).parents[2] / "docs" / "recipe-language.md").read_text(encoding="utf-8")
    table = page[page.index("| counted in all variants | at most |") :].splitlines()[2:]
    assert table[: len(CAPS)] == [f"| {cap.what} | {cap.most:,} |" for cap in CAPS.values()]


@pytest.mark.parametrize(("name", "what"), [("frames", "12 frames"), ("changes", "12 changes by deltas and draws")])
def test_a_recipe_over_a_cap_requires_allow_large(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, what: str
) -> None:
    monkeypatch.setitem(CAPS, name, CAPS[name]._replace(most=10))
    draws = {f"weather.{key}": {"uniform": [0, 1]} for key in ("wetness", "cloudiness", "fog_density", "dust_storm")}
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(small() | {"sweep": {"draw": {"count": 3, "values": draws}}}))
    with pytest.raises(TooLargeError, match=f"{what} in the first 3 of 3 variants are over 10; ask for") as caught:
        compile_recipe(path)
    assert caught.value.variants == 3
    assert len(compile_recipe(path, allow_large=True).plan.variants) == 3


@pytest.mark.parametrize(("most", "known"), [(10_000, ["speed: 61", "speed: 62", "speed: 63"]), (10, ["speed: 61"])])
def test_checking_an_invalid_recipe_ends_likewise(monkeypatch: pytest.MonkeyPatch, most: int, known: list[str]) -> None:
    """Regression: with an unknown key, up to 300 variants were checked and kept in memory, 2 GB for 450 KB."""
    monkeypatch.setitem(CAPS, "values", CAPS["values"]._replace(most=most))
    fast = {f"v{n}": {"actors": {"hero1": {"speed": 60 + n}}} for n in (1, 2, 3)}
    with pytest.raises(InputError) as caught:
        compiled(small() | {"deltas": {"w": fast}, "unknown": 1})
    assert re.findall(r"speed: \d+", str(caught.value)) == known


def test_variants_share_the_plans_of_equal_towns_and_the_colours_of_equal_actors() -> None:
    sweep = {"repeats": 2, "draw": {"count": 2, "values": {"weather.wetness": {"uniform": [0, 9]}}}}
    plans = compiled(small() | {"sweep": sweep}).plan.variants
    assert len({id(plan.scene.town) for plan in plans}) == 1
    assert len({id(plan.appearance.looks) for plan in plans}) == 2


def test_the_length_of_routes_is_bounded() -> None:
    ends = [{"x": 9999 * (-1) ** k, "y": 9999 * (-1) ** k} for k in range(501)]  # 14,142 km
    car = {"blueprint": "vehicle.sedan.a", "route": ends}
    cars = {f"car{k}": car | {"start": {"x": -9999, "y": -9999 + 9 * k}} for k in range(2)}
    with pytest.raises(InputError, match="are 28,338 km long, and at most 16,000 are allowed"):
        compiled(small(traffic={}, actors=cars))


@pytest.mark.parametrize(("number", "blueprint"), [(100, "vehicle.sedan.a"), (100, "walker.pedestrian.0001")])
def test_too_many_overlapping_actors_are_refused(number: int, blueprint: str) -> None:
    pile = {f"a{k}": {"blueprint": blueprint, "start": {"x": -4, "y": 6}} for k in range(number)}
    with pytest.raises(InputError, match="4,950 pairs of actors start on top of each other, and at most 4,000 may"):
        compiled(small(traffic={}, actors=pile))


def test_variants_are_not_lowered_after_many_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that does not exist is compared with all names of a town, and each variant may have another one."""
    monkeypatch.setattr(compiler, "_MAX_PROBLEMS", 2)
    values = {f"v{n}": {"patches": {"p": {"on": {"town": "wax" + "x" * n}}}} for n in range(9)}
    with pytest.raises(InputError) as caught:
        compiled(small(patches={"p": TEXTURE}) | {"deltas": {"axis": values}})
    assert len(caught.value.problems) == 3
