"""Lamps of vehicles in pictures, and the light of their headlights: exposure, shadows."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, Pose
from recipe_runtime.core.interfaces import LampState
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Light, Mesh, Pattern, Surface
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.lighting.lights import lamplight
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import PAINT, ROAD, appearance, box, ground

CAMERA = CameraPlan(width=96, height=64, fov=50)
BEHIND = from_pose(Pose(x=-7.0, y=0.0, z=1.4, pitch=4))
CAR = from_pose(Pose(x=0.0))[None]
LAMPS = {
    "taillight": (Pattern.TAILLIGHT, 0.8),
    "brakelight": (Pattern.BRAKELIGHT, 0.4),
    "indicator_left": (Pattern.INDICATOR, 0.0),
    "reverselight": (Pattern.REVERSELIGHT, -0.4),
}
LOOKS = {"car": dict.fromkeys(LAMPS, "#c04020")}


def joined(meshes: list[Mesh]) -> Mesh:
    first, rows, numbers = 0, [], []
    for n, mesh in enumerate(meshes):
        rows.append(mesh.triangles + first)
        numbers.append(np.full(len(mesh.triangles), n, np.int32))
        first += len(mesh.vertices)
    vertices, normals, uvs = (
        np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in ("vertices", "normals", "uvs")
    )
    surfaces = tuple(mesh.surfaces[0] for mesh in meshes)
    return Mesh(
        vertices, normals, uvs, np.concatenate(rows), np.concatenate(numbers), surfaces, lights=meshes[0].lights
    )


def car(lights: tuple[Light, ...] = ()) -> Body:
    """A car with a lamp of each kind at its rear."""
    rear = [
        box([-2.05, y - 0.15, 0.8], [-2, y + 0.15, 1.1], Surface(name, pattern, 14))
        for name, (pattern, y) in LAMPS.items()
    ]
    return Body("car", 14001, (("body", joined([box([-2, -0.9, 0.25], [2, 0.9, 1.4], PAINT, lights), *rear])),))


def red_of(renderer: Renderer, plan: AppearancePlan, name: str, state: int) -> float:
    """Return the mean radiance of a lamp of the car."""
    seen = renderer.observe(CAMERA, BEHIND, CAR, np.array([state], np.int32))
    y, focal = LAMPS[name][1], 48.0 / 0.4663
    u, v = int(48.0 - y / 4.95 * focal), 64 // 2 + int(0.1 * focal / 4.95)
    return float(renderer.radiance(seen, plan)[v - 1 : v + 2, u - 1 : u + 2, 0].mean())


@pytest.mark.parametrize(
    ("name", "state"),
    [("brakelight", LampState.BRAKE), ("indicator_left", LampState.LEFT), ("reverselight", LampState.REVERSE)],
)
def test_a_lamp_is_lit_by_its_own_state_by_day_and_by_night(name: str, state: LampState) -> None:
    renderer = Renderer([Body("road", 0, (("s", ground(40, ROAD)),)), car()])
    others = int(LampState.BRAKE | LampState.LEFT | LampState.RIGHT | LampState.REVERSE) & ~int(state)
    for plan in (appearance(45.0, looks=LOOKS), appearance(-40.0, looks=LOOKS)):
        dark, lit, still_dark = (red_of(renderer, plan, name, int(mask)) for mask in (0, state, others))
        assert lit > 1.3 * dark
        assert still_dark == dark


def test_tail_lamps_are_lit_at_dusk_in_rain_and_in_fog() -> None:
    renderer = Renderer([Body("road", 0, (("s", ground(40, ROAD)),)), car()])

    def share(altitude: float, **weather: float) -> float:
        plan = appearance(altitude, looks=LOOKS, **weather)
        shown, dark = (red_of(renderer, plan, name, 0) for name in ("taillight", "indicator_left"))
        return shown / dark

    assert share(45.0) < 1.1
    assert share(15.0) < 1.1
    assert share(45.0, precipitation=80.0, cloudiness=90.0) > 1.3
    assert share(15.0, fog_density=40.0) > 1.3
    assert share(5.0) > 1.3
    assert share(-40.0) > 1.3


def test_blinking_lamps_of_a_standing_car_are_in_every_frame_of_a_static_camera() -> None:
    """Reuse of samples, light and reflections, and frames that are recorded for a GPU, show the same lamps."""
    bodies = [Body("road", 0, (("s", ground(40, ROAD)),)), car()]
    keeping, fresh = Renderer(bodies), Renderer(bodies, reuse=NO_REUSE)
    wet = appearance(-40.0, looks=LOOKS, precipitation_deposits=80.0, wetness=80.0)
    states = np.array([[0], [3], [3], [1], [8]], np.int32)
    batch = FrameBatch(range(5), [0.0] * 5, np.stack([BEHIND] * 5), np.stack([CAR] * 5), states)
    shown: list[NDArray[np.uint8]] = []
    for made in fresh.frame_stream(CAMERA, "street", [wet], in_flight=2).frames(batch):
        n = made.number
        alone = fresh.shade(fresh.observe(CAMERA, BEHIND, CAR, states[n]), wet, "street", n, 0.0)
        kept = keeping.shade(keeping.observe(CAMERA, BEHIND, CAR, states[n]), wet, "street", n, 0.0)
        np.testing.assert_array_equal(kept, alone)
        np.testing.assert_array_equal(made.pictures[0], alone)
        shown.append(alone)
    assert (shown[0] != shown[1]).any()
    assert (shown[1] != shown[3]).any()


def test_a_camera_on_a_car_is_exposed_for_its_own_headlights() -> None:
    beams = tuple(Light((2.1, y, 0.6), (0.995, 0.0, -0.1), (1.0, 1.0, 1.0), 9000.0, 0.88) for y in (-0.6, 0.6))
    on, off = (Renderer([Body("road", 0, (("s", ground(40, ROAD)),)), car(lit)])._geometry for lit in (beams, ()))
    aboard, beside = np.array([0.5, 0.0, 1.25]), np.array([0.5, 3.0, 1.25])
    dark = lamplight(off, aboard, CAR)
    assert lamplight(on, aboard, CAR) > 1.5 * dark
    assert lamplight(on, beside, CAR) == lamplight(off, beside, CAR)
    turned = from_pose(Pose(x=30.0, y=-20.0, yaw=115.0))[None]
    there = turned[0, :, 3] + 0.5 * turned[0, :, 0] + 1.25 * turned[0, :, 2]
    assert abs(lamplight(on, there, turned) - lamplight(on, aboard, CAR)) < 0.01


def test_headlights_of_two_vehicles_do_not_shine_through_a_van() -> None:
    """The road behind a van is dark although both lamps of both cars before it point there."""
    beams = tuple(Light((2.1, y, 0.6), (0.995, 0.0, -0.1), (1.0, 1.0, 1.0), 9000.0, 0.88) for y in (-0.6, 0.6))
    low, high = [-2, -0.9, 0.25], [2, 0.9, 1.4]
    cars = [Body(f"car{n}", 14002 + n, (("body", box(low, high, PAINT, beams)),)) for n in range(2)]
    van = Body("van", 14004, (("body", box([-2, -3, 0.02], [2, 3, 3.0], PAINT)),))
    renderer = Renderer([Body("road", 0, (("s", ground(60, ROAD)),)), *cars, van])
    camera, eye = CameraPlan(width=64, height=48, fov=40), from_pose(Pose(x=5.0, z=6.0, pitch=89.0))
    lit = []
    for aside in (0.0, 30.0):
        at = [from_pose(Pose(x=-8.0, y=1.2)), from_pose(Pose(x=-8.0, y=-1.2)), from_pose(Pose(y=aside))]
        seen = renderer.observe(camera, eye, np.stack(at))
        lit.append(float(np.median(renderer.radiance(seen, appearance(-40.0))[20:28, 28:36, 0])))
    dark = renderer.observe(camera, eye, np.stack([from_pose(Pose(y=200.0))] * 3))
    base = float(np.median(renderer.radiance(dark, appearance(-40.0))[20:28, 28:36, 0]))
    assert lit[0] - base < 0.1 * (lit[1] - base)
