"""Portraits of blueprints: a body fills its picture, and a rider is one object with two tags."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_compiler.library.blueprints import match, specimen
from recipe_runtime.annotate.mots import mots_id
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.frames.portrait import Viewpoint, _floor, matrices, portrait, stance
from recipe_runtime.meshes import actor_body
from recipe_runtime.render.renderer import Renderer


@pytest.mark.parametrize("name", ["vehicle.bus.city", "vehicle.bicycle.child", "walker.pedestrian.0013"])
def test_a_portrait_shows_the_whole_body(name: str) -> None:
    """The outermost pixels are ground and sky for bodies of any size."""
    actor, look = specimen(match(name)[0])
    view = Viewpoint(width=120, height=90)
    with_body = portrait(actor, look, view).astype(int)
    pale = portrait(actor, dict.fromkeys(look, "#ffffff"), view).astype(int)
    seen = np.abs(with_body - pale).sum(axis=2) > 40
    assert seen.sum() > 300
    rim = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
    assert not rim.any()


@pytest.mark.parametrize(("name", "tag"), [("vehicle.bicycle.a", 19), ("vehicle.motorcycle.a", 18)])
def test_a_rider_is_one_object_with_two_tags(name: str, tag: int) -> None:
    actor, _ = specimen(match(name)[0])
    renderer = Renderer([_floor(), actor_body(actor)])
    camera = CameraPlan(width=160, height=120, fov=40)
    seen = renderer.observe(camera, from_pose(Pose(x=0.0, y=-4.0, z=1.1, yaw=90)), matrices(stance(actor)))
    inside = seen.instance > 0
    assert set(seen.instance[inside].tolist()) == {tag * 1000 + 1}
    tags, counts = np.unique(seen.semantic[inside], return_counts=True)
    assert tags.tolist() == [13, tag]
    assert counts.min() > 300
    assert [view.instance for view in seen.objects] == [tag * 1000 + 1]
    assert mots_id(tag * 1000 + 1) == 10_000  # MOTS has no class for two-wheelers, so it is an ignore region
