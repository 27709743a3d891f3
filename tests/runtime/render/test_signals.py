"""Each frame shows the traffic lights of its time, also with temporal reuse at a static camera."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import signals
from recipe_compiler.ir.plan import Element, ScenarioPlan
from recipe_compiler.ir.semantic_tags import Tag
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.scene_motion import SceneMotion

from tests.compiler.kitchen import only, small
from tests.runtime.frame_source import FrameSource


def no_motion(frames: int) -> Trace:
    none = np.zeros((frames, 0, 3), np.int64)
    return Trace((), (), none, np.zeros((frames, 0, 4), np.int32), none, none)


def signal_before_a_camera() -> tuple[ScenarioPlan, Element]:
    """Return a camera 3 m in front of the signal over a lane, for one cycle at 1 frame per second."""
    recipe = small(actors={}, traffic={}, clock={"fps": 1, "frames": 44})
    element = next(e for e in only(recipe).scene.town.elements if e.kind == "traffic_light" and e.pose.yaw == 270.0)
    over_lane = element.pose.x - element.shape["arm"]
    mount = {"x": over_lane, "y": element.pose.y - 3.0, "z": 5.5, "yaw": 90.0}
    recipe["base"]["sensors"] = {
        "street": {"mount": mount, "camera": {"width": 96, "height": 64, "fov": 40}, "capture": ["rgb", "semantic"]}
    }
    return only(recipe), element


@pytest.fixture(scope="module")
def scene() -> tuple[ScenarioPlan, Element]:
    return signal_before_a_camera()


def pictures(variant: ScenarioPlan, frames: list[int]) -> list[dict[str, NDArray[Any]]]:
    source = FrameSource(variant, no_motion(variant.scene.clock.frames), engines=real_engines())
    return [{k: v.copy() for k, v in source.render("street", frame).items()} for frame in frames]


def lit_colour(picture: NDArray[np.uint8]) -> str:
    """Return the name of the light with the brightest coloured pixels."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    counts = {
        "red": int(((red > 180) & (green < 110)).sum()),
        "amber": int(((red > 180) & (green >= 110) & (blue < 110)).sum()),
        "green": int(((green > 150) & (red < 120)).sum()),
    }
    return max(counts, key=lambda name: counts[name])


@pytest.mark.slow
def test_the_picture_shows_the_light_of_the_frame(scene: tuple[ScenarioPlan, Element]) -> None:
    variant, element = scene
    frames = [
        next(k for k in range(44) if signals.light(element.shape, k) == name) for name in ("red", "amber", "green")
    ]
    together = pictures(variant, frames)
    assert [lit_colour(picture["rgb"]) for picture in together] == ["red", "amber", "green"]
    assert all((picture["semantic"] == Tag.TRAFFIC_LIGHT).any() for picture in together)
    for frame, picture in zip(frames, together, strict=True):
        (alone,) = pictures(variant, [frame])
        for modality in picture:
            np.testing.assert_array_equal(picture[modality], alone[modality])


def test_lamps_that_are_not_lit_lie_within_the_housing(scene: tuple[ScenarioPlan, Element]) -> None:
    variant, element = scene
    motion = SceneMotion(variant.scene, no_motion(44))
    lights = [e for e in variant.scene.town.elements if e.kind == "traffic_light"]
    many = motion.many(np.arange(44))
    assert many.shape == (44, 5 * len(lights), 3, 4)
    first = 5 * lights.index(element)
    for frame in range(44):
        shifts = np.abs(many[frame, first : first + 5, :, 3] - [element.pose.x, element.pose.y, element.pose.z]).sum(1)
        assert [shift < 1e-9 for shift in shifts] == list(signals.lit(element.shape, frame))
        np.testing.assert_array_equal(many[frame], motion.parts(frame))
