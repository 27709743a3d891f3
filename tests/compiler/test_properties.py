"""What a change of a recipe may change, and what it must not, so that variants can share work."""

from __future__ import annotations

import copy
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.canonical import canonical_bytes, digest
from recipe_compiler.ir.plan import ActorPlan, Looks, ScenarioPlan
from recipe_compiler.library import weather

from tests.compiler.kitchen import compiled, only, small

quick = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
seeds = st.integers(0, 2**32 - 1)
names = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
percents = st.integers(0, 100)
weathers = st.one_of(
    st.sampled_from(sorted(weather.PRESETS)),
    st.fixed_dictionaries(
        {"preset": st.sampled_from(sorted(weather.PRESETS))},
        optional={
            "fog_density": percents,
            "wetness": percents,
            "sun_altitude_angle": st.integers(-90, 90),
            "sun_azimuth_angle": st.integers(0, 360),
        },
    ),
)


def bytes_of(plan: ScenarioPlan) -> bytes:
    return canonical_bytes(plan.document())


@pytest.mark.slow
@quick
@given(seeds, weathers, weathers)
def test_weather_changes_neither_scene_nor_rig(seed: int, one: Any, other: Any) -> None:
    recipe = small(weather=one) | {"seed": seed, "deltas": {"weather": {"same": {}, "other": {"weather": other}}}}
    same, changed = compiled(recipe).plan.variants
    assert (same.scene.digest, same.rig.digest) == (changed.scene.digest, changed.rig.digest)
    assert canonical_bytes(same.scene.document()) == canonical_bytes(changed.scene.document())


TOO_NEAR = 8.0  # metres between two vehicles, or other actors, that would touch


@pytest.mark.slow
@quick
@example(2730, "dfr06ad1", True, "walker.pedestrian.*", 0)  # it would start at the place of another
@given(seeds, names, st.booleans(), st.sampled_from(["walker.pedestrian.*", "vehicle.*"]), st.integers(0, 2))
def test_adding_an_actor_changes_no_other(seed: int, name: str, drawn: bool, blueprint: str, position: int) -> None:
    """The others keep their blueprints, looks, starts and routes, wherever it is inserted.

    They keep their instance numbers, which follow the order of the file, only if it is the last. An actor whose random
    start it occupies starts elsewhere.
    """
    recipe = small() | {"seed": seed}
    assume(name not in recipe["base"]["actors"])
    recipe["base"]["actors"]["hero2"].pop("start")
    more = copy.deepcopy(recipe)
    new = {"blueprint": blueprint, **({} if drawn else {"start": {"x": 300, "y": 300}})}
    entries = list(more["base"]["actors"].items())
    entries.insert(position, (name, new))
    more["base"]["actors"] = dict(entries)
    before, after = only(recipe), only(more)
    others = {k: v for k, v in by_name(after).items() if k != name}
    was, now = by_name(before)["hero2"].start, others["hero2"].start
    if was != now:
        taken = by_name(after)[name].start
        assert drawn and position < len(entries) - 1 and math.hypot(taken.x - was.x, taken.y - was.y) < TOO_NEAR
        return
    assert {k: _unnumbered(v) for k, v in by_name(before).items()} == {k: _unnumbered(v) for k, v in others.items()}
    if position == len(entries) - 1:
        assert by_name(before) == others
    assert before.rig == after.rig
    looks = {k: v for k, v in after.appearance.looks.root.items() if k != name}
    assert before.appearance == after.appearance.model_copy(update={"looks": Looks(looks)})


@pytest.mark.slow
@quick
@given(seeds, st.integers(0, 4), st.integers(0, 4))
def test_additional_traffic_changes_no_other_actor(seed: int, vehicles: int, pedestrians: int) -> None:
    few = only(small(traffic={"vehicles": vehicles, "pedestrians": 2}) | {"seed": seed})
    more = only(small(traffic={"vehicles": vehicles + 1, "pedestrians": 2}) | {"seed": seed})
    new = f"traffic.vehicle.{vehicles}"
    assert by_name(few) == {k: v for k, v in by_name(more).items() if k != new}


@pytest.mark.slow
@quick
@given(seeds, names, st.integers(1, 8))
def test_adding_a_sensor_changes_no_other(seed: int, name: str, frames: int) -> None:
    recipe = small(clock={"fps": 10, "frames": frames}) | {"seed": seed}
    assume(name != "street")
    more = copy.deepcopy(recipe)
    sensors = more["base"]["sensors"]
    more["base"]["sensors"] = {name: {**sensors["street"], "capture": ["depth"]}, **sensors}
    before, after = only(recipe), only(more)
    assert before.scene.digest == after.scene.digest
    assert before.rig.sensors[0] == after.rig.sensors[1]
    assert after.rig.sensors[0].poses[0] != after.rig.sensors[1].poses[0]  # each sensor has independent jitter
    assert before.appearance.responses["street"] == after.appearance.responses["street"]


def _unnumbered(actor: ActorPlan) -> ActorPlan:
    return actor.model_copy(update={"instance": 1})


def by_name(plan: ScenarioPlan) -> dict[str, ActorPlan]:
    return {actor.name: actor for actor in plan.scene.actors}


AXES: dict[str, dict[str, dict[str, object]]] = {
    "weather": {"sunny": {}, "rainy": {"weather": "MidRainyNoon"}},
    "jitter": {"still": {"sensors": {"street": {"motion": None}}}, "shaky": {}},
}


@pytest.mark.slow
@quick
@given(seeds, names, weathers, st.integers(1, 3), st.integers(0, 2))
def test_adding_a_value_or_a_repeat_changes_no_other_variant(
    seed: int, value: str, more: Any, repeats: int, position: int
) -> None:
    assume(value not in AXES["weather"])
    recipe = small() | {"seed": seed, "deltas": AXES}
    entries = list(AXES["weather"].items())
    entries.insert(position, (value, {"weather": more}))
    grown = recipe | {"deltas": {**AXES, "weather": dict(entries)}, "sweep": {"repeats": repeats}}
    before = {v.variant: v.digest for v in compiled(recipe).plan.variants}
    after = {v.variant: v.digest for v in compiled(grown).plan.variants}
    assert before.items() <= after.items()
    assert len(after) == 6 * repeats


@pytest.mark.slow
@quick
@given(seeds, st.integers(1, 4), st.integers(1, 3))
def test_additional_draws_change_no_earlier_one(seed: int, count: int, more: int) -> None:
    def recipe(count: int, **values: Any) -> dict[str, Any]:
        values = {"weather.fog_density": {"uniform": [0, 60]}, **values}
        return small() | {"seed": seed, "sweep": {"draw": {"count": count, "values": values}}}

    few, many = compiled(recipe(count)).plan.variants, compiled(recipe(count + more)).plan.variants
    assert [v.digest for v in few] == [v.digest for v in many[:count]]
    assert len({v.appearance.weather.fog_density for v in many}) == count + more
    another = compiled(recipe(count, **{"weather.wetness": {"uniform": [0, 60]}})).plan.variants
    assert [v.appearance.weather.fog_density for v in few] == [v.appearance.weather.fog_density for v in another]


def test_repeats_differ_and_the_first_is_the_recipe_itself() -> None:
    alone = only(small())
    first, second, third = compiled(small() | {"sweep": {"repeats": 3}}).plan.variants
    assert (first.variant, second.variant) == ("base", "base#2")
    assert bytes_of(first) == bytes_of(alone).replace(b'"base#1"', b'"base"')
    assert len({first.scene.digest, second.scene.digest, third.scene.digest}) == 3


_PRINT_BYTES = """
import sys, hashlib
from pathlib import Path
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.canonical import canonical_bytes, digest
print(hashlib.sha256(canonical_bytes(compile_recipe(Path(sys.argv[1])).plan.document())).hexdigest())
"""


@pytest.mark.slow
def test_other_processes_hash_seeds_zones_and_locales_give_the_same_bytes() -> None:
    path = Path(__file__).parents[1] / "cases/good/everything_drawn/recipe.yaml"
    seen = set()
    for environment in (
        {"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C"},
        {"PYTHONHASHSEED": "1", "TZ": "Asia/Kathmandu", "LC_ALL": "C.UTF-8"},
        {"PYTHONHASHSEED": "4294967295", "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4"},
    ):
        run = subprocess.run(
            [sys.executable, "-c", _PRINT_BYTES, str(path)],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=True,
        )
        seen.add(run.stdout)
    assert len(seen) == 1


def _leaves(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found = [leaf for key, item in items for leaf in _leaves(item, (*path, key))]
    return found or [path]


def _changed(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    return (
        {"x": 0.0}
        if value == {}
        else [{"x": 1.0, "y": 1.0}]
        if value == []
        else "changed"
        if value is None
        else f"{value}x"
    )


def _digest(part: str, document: dict[str, Any]) -> str:
    """Return a plan's digest by its document; parts that many plans share are hashed separately."""
    shared = {"scene": "town", "appearance": "looks"}.get(part)
    own = {**document, shared: digest(f"plan/{shared}/1", document[shared])} if shared else document
    own = {key: value for key, value in own.items() if value or key not in ("props", "textures")}
    return digest(f"plan/{part}/1", own)


BOARD = {"size": {"width": 2, "height": 1}, "at": {"x": 3, "y": 2}}
PLAIN = only(small(props={"board": BOARD}))
LEAVES = {part: _leaves(getattr(PLAIN, part).document()) for part in ("scene", "rig", "appearance")}


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.sampled_from(sorted(LEAVES)), st.data())
def test_any_changed_field_changes_the_digest(part: str, data: st.DataObject) -> None:
    path = data.draw(st.sampled_from(LEAVES[part]))
    document = getattr(PLAIN, part).document()
    before = _digest(part, document)
    assert before == getattr(PLAIN, part).digest
    here = document
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = _changed(here[path[-1]])
    assert _digest(part, document) != before


def test_documents_read_back_as_the_same_plan() -> None:
    text = json.dumps(PLAIN.document())
    assert ScenarioPlan.model_validate_json(text).digest == PLAIN.digest
