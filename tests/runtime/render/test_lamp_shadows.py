"""Shadows of lamps: their positions, no cost by day, and bytes that do not depend on caches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Light, Mesh
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.lighting.lights import lamp_columns
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.render.scene.camera import world_from_parts
from recipe_runtime.render.scene.geometry import Geometry, upload
from recipe_runtime.render.shadows.lamp_shadow_maps import LampShadowMaps, MapMemory
from recipe_runtime.render.shadows.lamp_slots import MOVING_SLOTS, STATIC_SLOTS, LampSlots

from tests.runtime.render.street import (
    BRICKS,
    CAMERA,
    CLOTH,
    EYE,
    PAINT,
    ROAD,
    WEATHERS,
    appearance,
    box,
    ground,
    parts_at,
    street,
)

LOOKS = {
    "road": {"asphalt": "#808080"},
    "wall": {"wall": "#c0c0c0"},
    "caster": {"shirt": "#b03030"},
    "bracket": {"paint": "#404040"},
}
NIGHT = appearance(-40.0, looks=LOOKS, fog_density=0, cloudiness=0)
LAMP = np.array([0.0, 0.0, 3.5])
WALL_X = 4.0
LOW, HIGH = np.array([1.6, -0.4, 0.0]), np.array([2.0, 0.4, 2.6])  # of the caster
VIEW = CameraPlan(width=160, height=120, fov=70)
VIEWER = from_pose(Pose(x=-3.0, y=-3.2, z=3.0, yaw=25, pitch=12))
FAR_AWAY = from_pose(Pose(x=-500.0))


def room(candela: float = 1400.0, *, caster_moves: bool = True, lamp_moves: bool = False) -> list[Body]:
    """A lamp before a wall, and a caster between them."""
    light = Light(tuple(LAMP.tolist()), (0.8, 0.0, -0.6), (1.0, 1.0, 1.0), candela, 0.2)
    bracket = box(LAMP - 0.1, LAMP - 0.05, PAINT, (light,))
    caster = box(LOW, HIGH, CLOTH)
    still: list[tuple[str, Mesh]] = [
        ("road", ground(30, ROAD)),
        ("wall", box([WALL_X, -8, 0], [WALL_X + 0.3, 8, 5], BRICKS)),
    ]
    moving: list[tuple[str, Mesh]] = []
    (moving if caster_moves else still).append(("caster", caster))
    (moving if lamp_moves else still).append(("bracket", bracket))
    bodies = [Body(name, 0, (("base", mesh),)) for name, mesh in still]
    return bodies + [Body(name, 12001 + n, (("base", mesh),)) for n, (name, mesh) in enumerate(moving)]


def lit_view(bodies: list[Body], caster: Array | None = None) -> tuple[Observation, NDArray[np.float32]]:
    """Return an observation at night and its radiance; `caster` is the transform of a moving caster."""
    renderer, moving = Renderer(bodies), [body.name for body in bodies if body.moves]
    parts = [caster if name == "caster" and caster is not None else from_pose(Pose()) for name in moving]
    seen = renderer.observe(VIEW, VIEWER, np.stack(parts) if parts else np.zeros((0, 3, 4)))
    return seen, renderer.radiance(seen, NIGHT)


def seen_points(depth: NDArray[np.float32]) -> Array:
    """The world positions of the pixels' centres, [H, W, 3]."""
    focal = VIEW.width / 2 / 0.7002075382097097  # tan 35 degrees
    x, y = np.arange(VIEW.width) + 0.5 - VIEW.width / 2, np.arange(VIEW.height) + 0.5 - VIEW.height / 2
    d = depth.astype(np.float64)
    local = np.stack([d, -x[None, :] / focal * d, -y[:, None] / focal * d], axis=-1)
    turned = (VIEWER[None, None, :, :3] * local[..., None, :]).sum(axis=-1)
    return np.asarray(turned + VIEWER[:, 3])


def hidden(points: Array, grown: float) -> NDArray[np.bool_]:
    """Return whether the segment from each point to the lamp intersects the caster, enlarged by some metres."""
    low, high = LOW - grown, HIGH + grown
    way = LAMP - points
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - points) / way, (high - points) / way
    enter = np.nanmax(np.minimum(a, b), axis=-1)
    leave = np.nanmin(np.maximum(a, b), axis=-1)
    return np.asarray((enter < leave) & (leave > 0.0) & (enter < 1.0))


@pytest.mark.parametrize(
    ("caster_moves", "lamp_moves"),
    [(False, False), (True, False), (True, True)],
    ids=["static", "moving caster", "moving caster and lamp"],
)
def test_a_shadow_falls_where_rays_to_the_lamp_meet_the_caster(caster_moves: bool, lamp_moves: bool) -> None:
    """On the wall, an independent ray test agrees beyond 0.12 m from the shadow's edge; nothing else is darker."""
    seen, picture = lit_view(room(caster_moves=caster_moves, lamp_moves=lamp_moves))
    _, dark = lit_view(room(1e-6, caster_moves=caster_moves, lamp_moves=lamp_moves))
    _, bright = lit_view(room(lamp_moves=lamp_moves), FAR_AWAY)
    points = seen_points(seen.depth)
    wall = (np.abs(points[..., 0] - WALL_X) < 0.01) & (points[..., 2] > 0.3)
    umbra, lit_part = wall & hidden(points, -0.12), wall & ~hidden(points, 0.12)
    assert umbra.sum() > 200 and lit_part.sum() > 2000
    np.testing.assert_allclose(picture[umbra], dark[umbra], rtol=1e-4, atol=1e-7)
    np.testing.assert_array_equal(picture[lit_part], bright[lit_part])
    assert (bright[umbra].mean(axis=-1) > 3.0 * picture[umbra].mean(axis=-1)).all()


def test_no_surface_shadows_itself() -> None:
    """Without the caster, wall and road have the same light with shadow maps as with empty ones."""
    seen, mapped = lit_view(room(), FAR_AWAY)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MapMemory, "draw", lambda *_: None)
        _, expected = lit_view(room(), FAR_AWAY)
    points = seen_points(seen.depth)
    # (In the corner between them the filter reaches from one to the other.)
    front = (np.abs(points[..., 0] - WALL_X) < 0.01) & (points[..., 2] > 0.15)
    front |= (np.abs(points[..., 2]) < 0.01) & (points[..., 0] < WALL_X - 0.15) & (points[..., 0] > 0.5)
    assert front.sum() > 4000
    np.testing.assert_array_equal(mapped[front], expected[front])


def test_by_day_no_map_of_a_lamp_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is computed in weathers in which lamps are off; golden digests check their bytes."""
    drawn: list[LampSlots] = []
    draw = LampShadowMaps.draw

    def counted(
        maps: LampShadowMaps, slots: LampSlots, world: DeviceArray, vertices: DeviceArray
    ) -> tuple[DeviceArray, MapMemory]:
        drawn.append(slots)
        return draw(maps, slots, world, vertices)

    monkeypatch.setattr(LampShadowMaps, "draw", counted)
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    renderer.shade(seen, WEATHERS["noon"], "street", 0, 0.0)
    assert not drawn
    renderer.shade(seen, WEATHERS["night"], "street", 0, 0.0)
    assert len(drawn) == 1


@pytest.mark.slow
def test_reuse_follows_a_shadow_that_moves_over_a_wall() -> None:
    """The caster moves, and its shadow falls on distant, otherwise unchanged samples: bytes equal a new renderer's."""
    keeping, forgetting = Renderer(room()), Renderer(room(), reuse=NO_REUSE)
    pictures = []
    for frame, y in enumerate((0.0, 0.0, 0.3, 0.31, 1.5, 1.5, 60.0, 60.0, 0.0)):
        parts = np.stack([from_pose(Pose(y=y, yaw=3.0 * y))])
        kept, alone = (
            r.shade(r.observe(VIEW, VIEWER, parts), NIGHT, "street", frame, frame / 30) for r in (keeping, forgetting)
        )
        np.testing.assert_array_equal(kept, alone)
        pictures.append(kept)
    assert (pictures[1] != pictures[4]).mean() > 0.05


@pytest.mark.slow
def test_the_kept_light_of_a_static_lamp_follows_what_moves() -> None:
    """A moving lamp makes every sample be shaded; the sum for the static lamp is kept: bytes equal fresh frames'."""
    beam = Light((-2.0, 2.0, 1.0), (1.0, 0.0, 0.0), (1.0, 0.9, 0.8), 300.0, 0.5)
    bodies = [*room(), Body("cart", 12003, (("base", box([-2.2, 1.8, 0.5], [-2.05, 2.2, 0.9], PAINT, (beam,))),))]
    keeping, forgetting = Renderer(bodies), Renderer(bodies, reuse=NO_REUSE)
    pictures = []
    moves = (60, 0.0), (60, 0.1), (0, 0.2), (0.1, 0.2), (60, 0.3), (60, 0.4), (0, 0.5)
    for frame, (caster, cart) in enumerate(moves):
        parts = np.stack([from_pose(Pose(y=caster)), from_pose(Pose(y=cart))])
        kept, alone = (
            r.shade(r.observe(VIEW, VIEWER, parts), NIGHT, "street", frame, frame / 30) for r in (keeping, forgetting)
        )
        np.testing.assert_array_equal(kept, alone)
        pictures.append(kept)
    assert (pictures[1] != pictures[2]).mean() > 0.05


@pytest.mark.slow
def test_a_frame_stream_has_the_renderers_bytes_at_night() -> None:
    """Recorded frames reuse the maps of earlier frames, by night and by day at the same time."""
    looks = [WEATHERS["night"], WEATHERS["noon"]]
    slow, fast = Renderer(street(), reuse=NO_REUSE), Renderer(street())
    numbers = [0, 9, 1, 30]
    poses, parts = np.stack([EYE] * 4), np.stack([parts_at(n) for n in numbers])
    poses[3] = from_pose(Pose(x=2.0, y=-2.0, z=1.7, yaw=12, pitch=6))
    batch = FrameBatch(numbers, [n / 30 for n in numbers], poses, parts)
    for at, made in enumerate(fast.frame_stream(CAMERA, "street", looks, in_flight=2).frames(batch)):
        seen = slow.observe(CAMERA, poses[at], parts[at])
        for plan, picture in zip(looks, made.pictures, strict=True):
            expected = slow.shade(seen, plan, "street", numbers[at], numbers[at] / 30)
            np.testing.assert_array_equal(picture, expected)


def _lamps_along_a_street(count: int) -> Body:
    lights = [Light((9.0 * n, 3.0, 6.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 1400.0, 0.25) for n in range(count)]
    return Body("posts", 0, (("base", box([0, 0, 0], [1, 1, 1], PAINT, tuple(lights))),))


@pytest.fixture(scope="module")
def many_lamps() -> Geometry:
    return upload([_lamps_along_a_street(20)], "cpu")


@settings(max_examples=50, deadline=None)
@given(x=st.floats(-40, 200), yaw=st.floats(-180, 180), step=st.floats(0.0, 0.05))
def test_no_shadow_pops_when_the_camera_moves(many_lamps: Geometry, x: float, yaw: float, step: float) -> None:
    """The weight of a lamp's shadow changes gradually, and is 0 where the lamp gets or loses its slot."""
    world = world_from_parts(np.zeros((0, 3, 4)))
    found = []
    for at in (x, x + step):
        columns, slots = lamp_columns(many_lamps, world, from_pose(Pose(x=at, z=1.7, yaw=yaw)))
        assert slots.lights.shape == (STATIC_SLOTS + MOVING_SLOTS,)
        assert (slots.weights[STATIC_SLOTS:] == 0.0).all(), "no lamp moves"
        by_light = columns[5]
        used = by_light[:, 1] > 0.0
        assert used.sum() == (slots.weights > 0.0).sum()
        np.testing.assert_array_equal(slots.lights[by_light[used, 0].astype(int)], np.flatnonzero(used))
        found.append(by_light[:, 1])
    assert np.abs(found[0] - found[1]).max() <= 0.6 * step + 1e-9


def test_a_tile_that_meets_many_lamps_drops_none() -> None:
    """A pole in front of a long street: with a full list, the tile would have lost the last lamps."""
    rows = [Light((1.2 * n, 3.0, 6.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 60.0, 0.25) for n in range(60)]
    found = []
    for lights in (rows, rows[::-1]):
        town = {"road": ground(80, ROAD), "bracket": box([0.5, -0.3, 0], [0.6, 0.1, 3], PAINT, tuple(lights))}
        renderer = Renderer([Body(name, 0, (("base", mesh),)) for name, mesh in town.items()])
        pose = from_pose(Pose(x=-3.0, z=1.7))
        seen = renderer.observe(VIEW, pose, np.zeros((0, 3, 4)))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(MapMemory, "draw", lambda *_: None)
            found.append(renderer.radiance(seen, NIGHT))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-3, atol=1e-6)
