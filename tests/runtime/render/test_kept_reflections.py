"""Reflections in wet ground are reused from frame to frame without changing a byte.

Thin posts give reflections edges, and bodies jump and return, so that the picture beside an edge changes without the
edge. Scenes are drawn by seed; each of these seeds fails if one of the rules of `reflection` is left out.
"""

from __future__ import annotations

import random

import numpy as np
import pytest
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, Looks, Pose
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.render.device.reuse import NO_REUSE, TemporalReuse
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import BRICKS, CLOTH, LOOKS, appearance, box, street

WET: dict[str, AppearancePlan] = {
    "still": appearance(50.0, precipitation_deposits=80, wetness=60),
    "breeze": appearance(20.0, precipitation_deposits=80, wetness=60, wind_intensity=40, cloudiness=50),
    "rings": appearance(45.0, precipitation=15, precipitation_deposits=70),
    "night": appearance(-30.0, precipitation_deposits=90, wetness=80, fog_density=20),
    "dusk": appearance(1.0, precipitation_deposits=100, wetness=100),
    "full": appearance(5.0, precipitation_deposits=100, wetness=100, cloudiness=80, precipitation=3),
}


def scene(draw: random.Random) -> tuple[list[Body], int, dict[str, dict[str, str]]]:
    """Return the street with up to 6 posts and 3 more moving bodies, the number of these bodies, and all colours."""
    bodies, looks = street(), dict(LOOKS)
    movers, posts = [], []
    for k in range(draw.randint(0, 3)):
        half, tall = draw.uniform(0.03, 0.5), draw.uniform(0.3, 2.5)
        low = draw.choice([0.0, 0.0, draw.uniform(0, 2)])
        body = box([-half, -half, low], [half, half, low + tall], CLOTH)
        movers.append(Body(f"m{k}", 13001 + k, (("body", body),)))
        looks[f"m{k}"] = {"shirt": "#b03030"}
    for k in range(draw.randint(0, 6)):
        x, y = draw.uniform(2, 20), draw.uniform(-6, 3)
        half, tall = draw.uniform(0.03, 0.4), draw.uniform(0.3, 3)
        z = draw.choice([0.0, draw.uniform(0, 1.5)])
        body = box([x - half, y - half, z], [x + half, y + half, z + tall], BRICKS)
        posts.append(Body(f"p{k}", 0, (("base", body),)))
        looks[f"p{k}"] = {"wall": "#8a4f3c"}
    return [*bodies[:-2], *posts, *bodies[-2:], *movers], len(movers), looks


def moved(draw: random.Random, places: list[list[float]]) -> None:
    """Move the bodies: some rest, some go a little further, some jump, some turn."""
    for place in places:
        chance = draw.random()
        if chance < 0.25:
            place[0] += draw.uniform(-0.3, 0.3)
            place[1] += draw.uniform(-0.3, 0.3)
        elif chance < 0.35:
            place[0], place[1] = draw.uniform(-5, 16), draw.uniform(-6, 3)
        elif chance < 0.4:
            place[2] += 20


@pytest.mark.slow
@pytest.mark.parametrize("seed", [149, 161, 169, 175, 184, 191, 247, 297])
def test_reused_reflections_equal_those_of_a_new_renderer(seed: int) -> None:
    draw = random.Random(seed)
    bodies, movers, looks = scene(draw)
    wide, high = draw.choice([96, 95, 97, 63, 160, 131]), draw.choice([64, 63, 65, 49, 100, 33])
    camera = CameraPlan(width=wide, height=high, fov=draw.choice([50, 80, 110]))
    x, y, z = draw.uniform(-1, 1), draw.uniform(-3, 2), draw.uniform(0.4, 3)
    eye = from_pose(Pose(x=x, y=y, z=z, yaw=draw.uniform(-20, 30), pitch=draw.uniform(-2, 25)))
    names = draw.sample(list(WET), draw.randint(1, 2))
    response = CameraResponse(antialias=draw.random() < 0.7, noise=0.0)
    reported = {"looks": Looks(looks), "responses": {"street": response}}
    weathers = [WET[name].model_copy(update=reported) for name in names]
    fresh = Renderer(bodies, reuse=NO_REUSE)
    keeping = [Renderer(bodies), Renderer(bodies, reuse=TemporalReuse(pixels=False))]
    places = [[draw.uniform(2, 16), draw.uniform(-6, 3), draw.uniform(0, 360)] for _ in range(2 + movers)]
    frame = 0
    for step in range(draw.randint(8, 20)):
        moved(draw, places)
        frame = max(frame + draw.choice([0, 1, 1, 1, 4, 7, -3]), 0)
        parts = np.stack([from_pose(Pose(x=x, y=y, yaw=yaw)) for x, y, yaw in places])
        seen, alone = [kept.observe(camera, eye, parts) for kept in keeping], fresh.observe(camera, eye, parts)
        for weather in weathers:
            if draw.random() < 0.25:
                continue
            expected = fresh.shade(alone, weather, "street", frame, frame / 30)
            for kept, observation in zip(keeping, seen, strict=True):
                picture = kept.shade(observation, weather, "street", frame, frame / 30)
                assert np.array_equal(picture, expected), (seed, step)
