"""Actors whose bodies come from files: their skeleton at rest, their motion, boxes and pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import ActorPlan
from recipe_runtime.annotate.actor_boxes import body_box
from recipe_runtime.body.kinematics import IDENTITY, forward_kinematics
from recipe_runtime.body.skeleton import Figure, joints_of, part_names
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.transforms import Array, rigid_transform
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.meshes.actors import actor_bodies
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.skin import BodyVertices

from tests.compiler import rigging
from tests.compiler.kitchen import small

ANNA, CAR = "walker.pedestrian.anna", "vehicle.hatchback.mine"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    folder = tmp_path_factory.mktemp("own")
    (folder / "anna.glb").write_bytes(rigging.person(scale=100.0))
    (folder / "car.glb").write_bytes(rigging.vehicle())
    cast = {
        "guest": {"blueprint": ANNA, "start": {"x": -2, "y": -1}, "goal": {"x": -2, "y": 8}},
        "car": {"blueprint": CAR, "start": {"x": 3, "y": 3, "yaw": 90}, "speed": 0},
    }
    sensor = {"mount": {"x": -8, "z": 1.6}, "camera": {"width": 160, "height": 120}, "capture": ["rgb", "instance"]}
    recipe = small(actors=cast, traffic={}, sensors={"street": sensor})
    recipe["blueprints"] = {ANNA: {"mesh": "anna.glb", "scale": 0.01}, CAR: {"mesh": "car.glb"}}
    (folder / "recipe.yaml").write_text(json.dumps(recipe))
    return compile_recipe(folder / "recipe.yaml")


@pytest.fixture(scope="module")
def cast(made: Compiled) -> dict[str, tuple[ActorPlan, Body]]:
    actors = made.plan.variants[0].scene.actors
    return {a.name: (a, body) for a, body in zip(actors, actor_bodies(actors, Assets(made.places)), strict=True)}


def at_rest(actor: ActorPlan, body: Body) -> Array:
    """Return the vertices while no joint is turned, [V, 3]."""
    joints = joints_of(actor.shape)
    poses = forward_kinematics(((0.0, 0.0, 0.0), IDENTITY), joints, [IDENTITY] * len(joints))
    return BodyVertices.of(body.parts).placed(np.stack([rigid_transform(*pose) for pose in poses])).T


def test_the_skeleton_at_rest_has_the_files_proportions(cast: dict[str, tuple[ActorPlan, Body]]) -> None:
    """The compiler's measures and `Figure` are inverse to each other."""
    figure = Figure.of(cast["guest"][0].shape)
    assert figure.height == pytest.approx(1.8)
    assert figure.hip == pytest.approx(0.93) and figure.neck == pytest.approx(1.5)
    assert figure.shoulder == pytest.approx(0.18)


def test_a_person_at_rest_stands_on_the_ground_with_hanging_arms(cast: dict[str, tuple[ActorPlan, Body]]) -> None:
    """The file's arms are level: they are turned about the shoulders, and hands come to the height of the hips."""
    actor, body = cast["guest"]
    vertices = at_rest(actor, body)
    figure = Figure.of(actor.shape)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=0.02) and vertices[:, 2].max() == pytest.approx(1.8, abs=0.03)
    assert np.abs(vertices[:, 1]).max() < figure.shoulder + 0.12
    beside = vertices[np.abs(vertices[:, 1]) > figure.shoulder]
    lowest = figure.shoulders - figure.upper_arm - (0.9 - 0.47)
    assert beside[:, 2].min() == pytest.approx(lowest, abs=0.05)
    skin = body.parts[0][1].skin
    assert skin is not None and (skin.weights.astype(int).sum(axis=1) == 255).all()
    used = {part_names(actor.shape)[part] for part in np.unique(skin.parts[:, 0])}
    assert used == set(part_names(actor.shape))


def test_wheels_are_parts_that_stand_on_the_ground(cast: dict[str, tuple[ActorPlan, Body]]) -> None:
    actor, body = cast["car"]
    assert [name for name, _ in body.parts] == list(part_names(actor.shape))
    for name, mesh in body.parts[1:]:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        np.testing.assert_allclose([low[0], low[2], high[0], high[2]], [-0.33, -0.33, 0.33, 0.33], atol=1e-5)
        assert len(mesh.triangles) == 24, name  # the tyre's box and its hub's
    vertices = at_rest(actor, body)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-5)


def test_the_body_box_bounds_the_body_at_rest(cast: dict[str, tuple[ActorPlan, Body]]) -> None:
    for actor, body in cast.values():
        box, vertices = body_box(actor), at_rest(actor, body)
        slack = 0.03 if actor.category == "pedestrian" else 1e-4
        assert (vertices.min(axis=0) >= box.low - slack).all() and (vertices.max(axis=0) <= box.high + slack).all()
        assert (vertices.min(axis=0) <= box.low + 0.1).all() and (vertices.max(axis=0) >= box.high - 0.1).all()


@pytest.mark.slow
def test_own_actors_move_and_have_labels_like_all_others(made: Compiled) -> None:
    variant = made.plan.variants[0]
    engines = real_engines(Assets(made.places))
    source = SceneSource(variant.scene, engines.simulate(variant.scene), engines=engines)
    sensor = variant.rig.sensors[0]
    masks = []
    for frame in range(variant.scene.clock.frames):
        seen = source.observe(sensor, frame)
        records = {record["actor"]: record for record in source.labels(seen, sensor, frame)["objects"]}
        assert set(records) == {"guest", "car"}
        assert (seen.instance == records["guest"]["instance"]).sum() > 50
        masks.append(seen.instance == records["guest"]["instance"])
        picture = source.shade(seen, variant.appearance, sensor, frame)
    assert (masks[0] != masks[-1]).any()
    cloth = picture[masks[-1]].astype(int)
    assert len(np.unique(cloth, axis=0)) > 20, "the texture is on the person"


def test_a_missing_file_is_an_error_of_the_host(made: Compiled, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="not available"):
        actor_bodies(made.plan.variants[0].scene.actors, Assets())
