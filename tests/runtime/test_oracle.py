"""The renderer against PyBullet's TinyRenderer: the same bodies, poses and camera give the same masks and depth."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler import blueprints, towns
from recipe_compiler.plan import ActorPlan, CameraPlan, Clock, Point, Pose, ScenePlan
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.render import Renderer
from recipe_runtime.simulate import simulate
from recipe_runtime.transforms import from_pose, part_transforms

from tests.runtime.oracle_tiny import tiny_render

CAST = (
    ("hero1", "walker.pedestrian.0001", Pose(x=-4.2, y=1.5, z=0.15, yaw=-90), (-4.2, -8)),
    ("hero2", "walker.pedestrian.0006", Pose(x=-5.0, y=-3.0, z=0.15, yaw=90), (-5.0, 8)),
    ("child", "walker.pedestrian.0011", Pose(x=-3.6, y=-1.0, z=0.15, yaw=90), (-3.6, 8)),
    ("car", "vehicle.sedan.a", Pose(x=1.5, y=-4.0, yaw=90), (1.5, 20)),
    ("van", "vehicle.van.a", Pose(x=-1.5, y=8.0, yaw=-90), (-1.5, -20)),
)


def cast() -> tuple[ActorPlan, ...]:
    found = []
    for number, (name, blueprint_id, start, goal) in enumerate(CAST, start=1):
        (blueprint,) = blueprints.match(blueprint_id)
        found.append(
            ActorPlan(
                name=name,
                blueprint=blueprint.id,
                category=blueprint.category,
                tag=blueprint.tag,
                instance=number,
                shape=blueprint.shape,
                start=start,
                route=(Point(x=goal[0], y=goal[1]),),
                speed=1.4 if blueprint.category == "pedestrian" else 4.0,
            )
        )
    return tuple(found)


@pytest.mark.parametrize("pose", [Pose(x=-8, z=1.6), Pose(x=-7, y=-7, z=2.2, yaw=60, pitch=8)])
def test_masks_and_depth_agree_with_tiny_renderer(pose: Pose) -> None:
    town = towns.build("downtown", 0, {"blocks": [1, 1]}).plan
    scene = ScenePlan(clock=Clock(fps=10, frames=11, physics=240), town=town, actors=cast())
    trace, camera, sensor = simulate(scene), CameraPlan(width=800, height=600, fov=80), from_pose(pose)
    bodies = (*town_bodies(town), *(actor_body(actor) for actor in scene.actors))
    ours = Renderer(bodies).observe(camera, sensor, part_transforms(trace, 10))
    theirs = tiny_render(scene, trace, 10, camera, sensor)
    compared = 0
    for actor in scene.actors:
        mine, other = (picture == actor.tag * 1000 + actor.instance for picture in (ours.instance, theirs["instance"]))
        if mine.sum() > 1000:
            overlap = (mine & other).sum() / (mine | other).sum()
            assert overlap >= 0.99, f"{actor.name}: IoU {overlap:.3f}"
            compared += 1
    assert compared >= 3
    near = (ours.depth < 40) & (theirs["depth"] < 40)
    difference = np.abs(ours.depth - theirs["depth"])[near] / ours.depth[near]
    assert np.median(difference) < 1e-4
    assert (difference > 0.01).mean() < 0.01
