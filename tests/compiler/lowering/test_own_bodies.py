"""Blueprints of a recipe, whose bodies come from files."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import Compiled, compile_recipe, named_files
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ActorPlan, DatasetPlan
from recipe_compiler.ir.plan_bounds import actor_fault

from tests.compiler import rigging
from tests.compiler.kitchen import small

ANNA, CAR = "walker.pedestrian.anna", "vehicle.hatchback.mine"
START = {"x": -4, "y": 10}


def compiled(folder: Path, blueprints: dict[str, Any] | None = None, **base: Any) -> Compiled:
    (folder / "anna.glb").write_bytes(rigging.person())
    (folder / "car.glb").write_bytes(rigging.vehicle(scale=100.0))
    own = {ANNA: {"mesh": "anna.glb"}, CAR: {"mesh": "car.glb", "scale": 0.01}} if blueprints is None else blueprints
    recipe = small(**base) | {"blueprints": own}
    (folder / "recipe.yaml").write_text(json.dumps(recipe))
    return compile_recipe(folder / "recipe.yaml")


def actors(found: Compiled) -> dict[str, ActorPlan]:
    return {actor.name: actor for actor in found.plan.variants[0].scene.actors}


def test_an_actor_of_an_own_blueprint_has_its_file_shape_and_textures(tmp_path: Path) -> None:
    cast = {"guest": {"blueprint": ANNA, "start": START, "speed": 1.0}, "ego": {"blueprint": CAR}}
    found = compiled(tmp_path, actors=cast, traffic={})
    guest, ego = (actors(found)[name] for name in ("guest", "ego"))
    sha256 = hashlib.sha256(rigging.person()).hexdigest()
    assert guest.mesh is not None and guest.mesh.file.sha256 == sha256
    assert guest.shape["height"] == pytest.approx(1.8) and guest.category == "pedestrian"
    assert ego.mesh is not None and ego.mesh.scale == 0.01 and ego.category == "vehicle"
    expected = {"length": 4.5, "width": 1.8, "height": 1.45, "wheelbase": 2.7, "wheel": 0.33, "clearance": 0.25}
    assert {key: ego.shape[key] for key in expected} == pytest.approx(expected)
    assert actor_fault(guest) is None and actor_fault(ego) is None
    appearance = found.plan.variants[0].appearance
    assert appearance.looks["guest"] == {"cloth": "#ffffff"}
    assert appearance.textures["guest"]["cloth"].file.sha256 == sha256
    assert set(appearance.looks["ego"]) == {"body_paint", "tyre"}
    assert sha256 in found.plan.variants[0].files
    assert DatasetPlan.model_validate_json(found.plan.model_dump_json()).digest == found.plan.digest
    assert sorted(named_files(tmp_path / "recipe.yaml")[1]) == ["anna.glb", "car.glb", "recipe.yaml"]  # type: ignore[index]


def test_globs_and_traffic_choose_among_own_blueprints_too(tmp_path: Path) -> None:
    mix = {"walker.pedestrian.an*": 1, "vehicle.*.mine": 1}
    found = compiled(tmp_path, actors={}, traffic={"vehicles": 3, "pedestrians": 4, "mix": mix})
    assert {actor.blueprint for actor in actors(found).values()} == {ANNA, CAR}
    every = compiled(tmp_path, actors={}, traffic={"parked": 2, "pedestrians": 40})
    assert ANNA in {actor.blueprint for actor in actors(every).values()}


def test_a_recipe_without_blueprints_keeps_its_digests(tmp_path: Path) -> None:
    recipe = small()
    (tmp_path / "recipe.yaml").write_text(json.dumps(recipe))
    before = compile_recipe(tmp_path / "recipe.yaml").plan
    assert compiled(tmp_path, {}).plan.digest == before.digest
    assert all("mesh" not in actor.document() for actor in before.variants[0].scene.actors)


SHA = "0" * 64
WRONG: list[tuple[dict[str, Any], str]] = [
    ({ANNA: {"mesh": "gone.glb"}}, "there is no such file"),
    ({ANNA: {"mesh": "anna.glb", "sha256": SHA}}, "is another file"),
    ({ANNA: {"mesh": "../anna.glb"}}, "anna.glb"),
    ({ANNA: {"mesh": "anna.glb", "scale": 0.01}}, "its height is 0.018 m; walker.pedestrian.anna may have 0.95"),
    ({CAR: {"mesh": "car.glb"}}, "its length is 450 m; vehicle.hatchback.mine may have 3.2 to 9 m; set `scale`"),
    ({CAR: {"mesh": "anna.glb"}}, "has no node wheel_front_left"),
    ({ANNA: {"mesh": "car.glb", "scale": 0.01}}, "has no bone Hips"),
    ({"walker.pedestrian.0001": {"mesh": "anna.glb"}}, "the library has"),
    ({"vehicle.motorcycle.mine": {"mesh": "car.glb"}}, "is not the id of an own blueprint"),
    ({ANNA: {}}, "mesh"),
]


@pytest.mark.parametrize(("blueprints", "message"), WRONG, ids=[row[1][:24] for row in WRONG])
def test_a_wrong_blueprint_is_reported_at_its_place(tmp_path: Path, blueprints: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        compiled(tmp_path, blueprints)
    text = " ".join(f"{problem.message}; {problem.help}" for problem in caught.value.problems)
    assert message in text
    assert all(problem.place is not None for problem in caught.value.problems)


def test_a_plan_with_a_body_beyond_all_measure_is_refused(tmp_path: Path) -> None:
    guest = actors(compiled(tmp_path, actors={"guest": {"blueprint": ANNA, "start": START}}, traffic={}))["guest"]
    assert guest.mesh is not None
    large = guest.mesh.model_copy(update={"high": (50.0, 1.0, 2.0)})
    fault = actor_fault(guest.model_copy(update={"mesh": large}))
    assert fault is not None and "extent" in fault
