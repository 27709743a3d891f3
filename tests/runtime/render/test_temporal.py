"""What a camera at rest need not ask again: each rule alone, with numbers made by hand."""

from typing import no_type_check

import numpy as np
import pytest
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting import passes, temporal_kernels
from recipe_runtime.render.lighting.tile_list_kernels import Bodies, contact_occlusion
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.shadows import shadow_kernels

wp.set_module_options(OPTIONS)

AT_REST, SKY, TOUCHED, LEAF = (int(getattr(temporal_kernels, name)) for name in ("AT_REST", "SKY", "TOUCHED", "LEAF"))
CALM = int(shadow_kernels.UNTOUCHED)


class Camera:
    """Tiles of samples of which only what `enlist` asks for is given."""

    def __init__(self, *tiles: list[int]) -> None:
        self.known: DeviceArray = wp.array(np.concatenate(tiles).astype(np.uint8), dtype=wp.uint8, device="cpu")
        firsts = np.cumsum([0, *map(len, tiles)]).astype(np.int32)
        self.firsts: DeviceArray = wp.array(firsts, dtype=wp.int32, device="cpu")
        self.quiet = wp.zeros(len(tiles), dtype=wp.uint8, device="cpu")
        self.tiles = len(tiles)

    def asked(self, bits: int = CALM, *, then: int = 0, now: int = 0, sky: int = 1) -> set[int]:
        """The samples listed at a stir, `then` having been the frame before's."""
        tiles: DeviceArray = wp.array(np.full(self.tiles, bits, np.int32), dtype=wp.int32, device="cpu")
        air = set_fields(Air(), leaf_step=now)
        before = set_fields(temporal_kernels.PreviousFrame(), leaf_step=then, sky=sky, tiles=tiles)
        count, listed = (wp.zeros(n, dtype=wp.int32, device="cpu") for n in (1, self.known.size))
        passes.collect_dirty(
            self.firsts,
            struct_array([air], "cpu"),
            struct_array([before], "cpu"),
            self.known,
            self.quiet,
            count,
            listed,
            "cpu",
        )
        return set(listed.numpy()[: count.numpy()[0]].tolist())


def test_nothing_is_asked_where_nothing_moves_and_what_was_touched_always() -> None:
    assert Camera([AT_REST, SKY], [AT_REST, TOUCHED]).asked() == {3}


def test_all_but_the_sky_is_asked_where_something_moves_about() -> None:
    assert Camera([AT_REST, SKY, LEAF + 2]).asked(bits=0) == {0, 2}


def test_the_sky_is_asked_when_clouds_have_moved() -> None:
    assert Camera([AT_REST, SKY]).asked(sky=0) == {1}


@pytest.mark.parametrize("now", range(1, 9))
def test_leaves_are_asked_by_turns_each_once_in_four_stirs(now: int) -> None:
    leaves = Camera([LEAF + turn for turn in range(4)])
    assert leaves.asked(then=now - 1, now=now) == {(-now) % 4}


def test_leaves_that_rest_are_not_forgotten() -> None:
    """A tile whose leaves rest for a stir is looked through again at the next."""
    leaves = Camera([AT_REST, LEAF + 1])
    assert leaves.asked(then=0, now=1) == set()
    assert leaves.asked(then=1, now=2) == set()
    assert leaves.asked(then=2, now=3) == {1}


def test_a_quiet_tile_is_asked_again_when_something_comes() -> None:
    tile = Camera([AT_REST, AT_REST])
    assert tile.asked() == set()
    assert tile.asked() == set()
    assert tile.asked(bits=0) == {0, 1}


def beam(texel: float, shaded: tuple[int, int] | None) -> shadow_kernels.Sunbeam:
    """A map of 256 texels about the origin under a sun in the zenith, with one tile of it in use."""
    bounds = np.zeros((16, 16, 2), np.float32)
    if shaded is not None:
        bounds[shaded] = 0.6
    return set_fields(
        shadow_kernels.Sunbeam(),
        u=wp.vec4f(1.0 / texel, 0.0, 0.0, 128.0),
        v=wp.vec4f(0.0, 1.0 / texel, 0.0, 128.0),
        q=wp.vec4f(0.0, 0.0, 0.001, 0.5),
        size=256,
        texel=texel,
        depth=1000.0,
        depths=wp.zeros(256 * 256, dtype=wp.float32, device="cpu"),
        bounds=wp.array(bounds.reshape(-1, 2), dtype=wp.vec2f, device="cpu"),
    )


def calm_at(x: float, y: float, fine: tuple[int, int] | None, coarse: tuple[int, int] | None) -> bool:
    """Whether a box of half a metre about a place is out of reach of what moves."""
    beams = struct_array([beam(0.02, None), beam(0.2, None), beam(0.02, fine), beam(0.2, coarse)], "cpu")
    corners: list[DeviceArray] = [wp.array([[x + d, y + d, d]], dtype=wp.vec3f, device="cpu") for d in (-0.25, 0.25)]
    same: DeviceArray = wp.array([1], dtype=wp.int32, device="cpu")
    lows, highs = corners
    launch(shadow_kernels.mark_unshadowed, 1, "cpu", lows=lows, highs=highs, beams=beams, needed_bits=1, out_bits=same)
    return bool(same.numpy()[0] & CALM)


def test_where_the_fine_shadow_map_holds_all_it_alone_tells() -> None:
    assert calm_at(0.0, 0.0, None, (8, 8))  # the coarse map's tile there is 3.2 m wide, and mostly empty
    assert not calm_at(0.0, 0.0, (8, 8), None)


def test_elsewhere_the_coarse_shadow_map_tells() -> None:
    assert not calm_at(10.0, 0.0, None, (8, 11))
    assert calm_at(10.0, 0.0, None, (11, 8))
    assert not calm_at(2.4, 0.0, None, (8, 8)), "beyond the fine map's rim"


class Puddle:
    """Samples in one row of pixels, as `due` is told of them."""

    def __init__(self, mirrors: list[float], sources: list[int], others: list[int] | None = None) -> None:
        count = len(mirrors)
        self.data = Samples()
        self.data.positions = wp.array([[0.7 * i, 0.3, 0.0] for i in range(count)], dtype=wp.vec3f, device="cpu")
        self.data.pixels = wp.array(np.arange(count, dtype=np.int32), dtype=wp.int32, device="cpu")
        mirror: DeviceArray = wp.array([[g, 0.9] for g in mirrors], dtype=wp.vec2f, device="cpu")
        found, listed = self._list(count)
        passes.collect_reflective(struct_array([self.data], "cpu"), mirror, count, found, listed, "cpu")
        self.mirrors = wp.clone(listed[: int(found.numpy()[0])])
        pairs = np.stack([sources, others or [-1] * count], axis=-1).astype(np.int32)
        self.sources: DeviceArray = wp.array(pairs, dtype=wp.vec2i, device="cpu")

    @staticmethod
    def _list(count: int) -> tuple[DeviceArray, DeviceArray]:
        return wp.zeros(1, dtype=wp.int32, device="cpu"), wp.zeros(count, dtype=wp.int32, device="cpu")

    def due(self, stale: tuple[int, ...] = (), then: int = 0, now: int = 0) -> set[int]:
        """The samples that mirror something else, when the light of some pixels has changed."""
        changed = np.zeros(self.sources.size, np.uint8)
        changed[list(stale)] = 1
        marks: DeviceArray = wp.array(changed, dtype=wp.uint8, device="cpu")
        before = struct_array([set_fields(temporal_kernels.PreviousFrame(), stale=marks)], "cpu")
        samples, air = struct_array([self.data], "cpu"), struct_array([set_fields(Air(), ring_step=now)], "cpu")
        count, listed = self._list(self.sources.size)
        passes.stale_reflections(samples, air, before, self.mirrors, then, self.sources, count, listed, "cpu")
        return set(listed.numpy()[: count.numpy()[0]].tolist())


def test_what_mirrors_nothing_is_never_due() -> None:
    assert Puddle([0.0, 0.2, 0.0, 0.1], [-2, -2, -2, -2]).due() == {1, 3}


def test_a_mirror_image_is_due_when_its_own_light_or_its_sources_has_changed() -> None:
    puddle = Puddle([0.2] * 4, [3, 3, 0, -1])
    assert puddle.due() == set()
    assert puddle.due(stale=(1,)) == {1}
    assert puddle.due(stale=(3,)) == {0, 1, 3}
    assert puddle.due(stale=(0,)) == {0, 2}


def test_a_mirror_image_is_due_when_what_was_seen_beside_its_source_has_changed() -> None:
    puddle = Puddle([0.2] * 4, [-1, 1, 1, 3], [3, -1, 0, -1])
    assert puddle.due() == set()
    assert puddle.due(stale=(3,)) == {0, 3}
    assert puddle.due(stale=(0,)) == {0, 2}


def test_rings_are_due_by_turns_and_each_once_in_four_moments() -> None:
    puddle = Puddle([0.2] * 64, [-1] * 64)
    due = [puddle.due(then=moment, now=moment + 1) for moment in range(4)]
    assert set().union(*due) == set(range(64))
    assert sum(map(len, due)) == 64
    assert all(due)
    assert puddle.due(then=0, now=4) == set(range(64))


def test_a_body_darkens_nothing_from_where_its_darkening_ends() -> None:
    """Its list ends no earlier: what a tile does not list would have had all of the sky."""
    spread = 0.2
    end = spread * float(np.sqrt(8.0))
    found = [_sky_beside(0.1 + reach, spread) for reach in (0.0, 0.5 * end, 0.99 * end, 1.0001 * end, 3.0 * end)]
    assert found[0] < found[1] < found[2] < 1.0
    assert found[3:] == [1.0, 1.0]


@no_type_check  # written in Warp's language
@wp.kernel
def _ask(bodies: wp.array[Bodies], lists: wp.array2d[wp.int32], x: wp.float32, out: wp.array[wp.float32]):
    out[0] = contact_occlusion(bodies, lists, 0, wp.vec3f(x, 0.0, 0.0), wp.vec3f(0.0, 0.0, 1.0))


def _sky_beside(x: float, spread: float) -> float:
    """What a body 0.2 m wide leaves of the sky to the ground at a distance from its middle."""
    bodies = Bodies()
    bodies.centre = wp.array([[0.0, 0.0, 0.0]], dtype=wp.vec3f, device="cpu")
    bodies.axis, bodies.half = (wp.array([v], dtype=wp.vec2f, device="cpu") for v in ([1.0, 0.0], [0.1, 0.1]))
    bodies.spread, bodies.strength = (wp.array([v], dtype=wp.float32, device="cpu") for v in (spread, 0.7))
    bodies = set_fields(bodies, count=1)
    lists: DeviceArray = wp.array([[1, 0]], dtype=wp.int32, device="cpu")
    out = wp.zeros(1, dtype=wp.float32, device="cpu")
    launch(_ask, 1, "cpu", bodies=struct_array([bodies], "cpu"), lists=lists, x=x, out=out)
    return float(out.numpy()[0])
