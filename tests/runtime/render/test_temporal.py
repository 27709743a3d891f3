"""Temporal reuse for static cameras: each rule alone, with hand-made inputs."""

from typing import no_type_check

import numpy as np
import pytest
from recipe_runtime.render.atmosphere.air import Air
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting import reflection_reuse_kernels, temporal_kernels
from recipe_runtime.render.lighting.tile_list_kernels import Bodies, contact_occlusion
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.shadows import shadow_kernels

wp.set_module_options(OPTIONS)

AT_REST, SKY, TOUCHED, LEAF = (int(getattr(temporal_kernels, name)) for name in ("AT_REST", "SKY", "TOUCHED", "LEAF"))
UNSHADOWED = int(shadow_kernels.UNTOUCHED)


class TiledSamples:
    """Tiles of samples with only the arrays that `collect_dirty` reads."""

    def __init__(self, *tiles: list[int]) -> None:
        self.known: DeviceArray = wp.array(np.concatenate(tiles).astype(np.uint8), dtype=wp.uint8, device="cpu")
        firsts = np.cumsum([0, *map(len, tiles)]).astype(np.int32)
        self.firsts: DeviceArray = wp.array(firsts, dtype=wp.int32, device="cpu")
        self.quiet = wp.zeros(len(tiles), dtype=wp.uint8, device="cpu")
        self.tiles = len(tiles)

    def dirty(self, bits: int = UNSHADOWED, *, then: int = 0, now: int = 0, sky: int = 1) -> set[int]:
        """Return the dirty samples at leaf step `now` if the previous frame had leaf step `then`."""
        tiles: DeviceArray = wp.array(np.full(self.tiles, bits, np.int32), dtype=wp.int32, device="cpu")
        air = set_fields(Air(), leaf_step=now)
        before = set_fields(temporal_kernels.PreviousFrame(), leaf_step=then, sky=sky, tiles=tiles)
        count, listed = (wp.zeros(n, dtype=wp.int32, device="cpu") for n in (1, self.known.size))
        out = {"out_quiet": self.quiet, "out_count": count, "out_samples": listed}
        inputs = {"firsts": self.firsts, "reuse_class": self.known}
        records = {"air": struct_array([air], "cpu"), "previous": struct_array([before], "cpu")}
        launch(temporal_kernels.collect_dirty, self.tiles, "cpu", **inputs, **records, **out)
        return set(listed.numpy()[: count.numpy()[0]].tolist())


def test_only_touched_samples_are_dirty_where_nothing_moves() -> None:
    assert TiledSamples([AT_REST, SKY], [AT_REST, TOUCHED]).dirty() == {3}


def test_all_samples_but_the_sky_are_dirty_near_motion() -> None:
    assert TiledSamples([AT_REST, SKY, LEAF + 2]).dirty(bits=0) == {0, 2}


def test_the_sky_is_dirty_after_clouds_have_moved() -> None:
    assert TiledSamples([AT_REST, SKY]).dirty(sky=0) == {1}


@pytest.mark.parametrize("now", range(1, 9))
def test_each_leaf_is_dirty_in_one_of_four_leaf_steps(now: int) -> None:
    leaves = TiledSamples([LEAF + phase for phase in range(4)])
    assert leaves.dirty(then=now - 1, now=now) == {(-now) % 4}


def test_a_tile_whose_leaves_rest_is_checked_again_at_the_next_leaf_step() -> None:
    """Such a tile must not be marked quiet."""
    leaves = TiledSamples([AT_REST, LEAF + 1])
    assert leaves.dirty(then=0, now=1) == set()
    assert leaves.dirty(then=1, now=2) == set()
    assert leaves.dirty(then=2, now=3) == {1}


def test_a_quiet_tile_is_dirty_again_near_motion() -> None:
    tile = TiledSamples([AT_REST, AT_REST])
    assert tile.dirty() == set()
    assert tile.dirty() == set()
    assert tile.dirty(bits=0) == {0, 1}


def beam(texel: float, shaded: tuple[int, int] | None) -> shadow_kernels.Sunbeam:
    """Return a shadow map of 256 x 256 texels around the origin with the sun at the zenith and one tile in use."""
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


def unshadowed_at(x: float, y: float, fine: tuple[int, int] | None, coarse: tuple[int, int] | None) -> bool:
    """Return whether no moving shadow reaches a box of 0.5 m around a place."""
    beams = struct_array([beam(0.02, None), beam(0.2, None), beam(0.02, fine), beam(0.2, coarse)], "cpu")
    corners: list[DeviceArray] = [wp.array([[x + d, y + d, d]], dtype=wp.vec3f, device="cpu") for d in (-0.25, 0.25)]
    same: DeviceArray = wp.array([1], dtype=wp.int32, device="cpu")
    lows, highs = corners
    launch(shadow_kernels.mark_unshadowed, 1, "cpu", lows=lows, highs=highs, beams=beams, needed_bits=1, out_bits=same)
    return bool(same.numpy()[0] & UNSHADOWED)


def test_the_fine_shadow_map_decides_within_its_area() -> None:
    assert unshadowed_at(0.0, 0.0, None, (8, 8))  # the coarse map's tile is 3.2 m wide there, and mostly empty
    assert not unshadowed_at(0.0, 0.0, (8, 8), None)


def test_the_coarse_shadow_map_decides_elsewhere() -> None:
    assert not unshadowed_at(10.0, 0.0, None, (8, 11))
    assert unshadowed_at(10.0, 0.0, None, (11, 8))
    assert not unshadowed_at(2.4, 0.0, None, (8, 8)), "beyond the fine map's border"


class Puddle:
    """Samples in one row of pixels, with only the arrays that `stale_reflections` reads."""

    def __init__(self, mirrors: list[float], sources: list[int], others: list[int] | None = None) -> None:
        count = len(mirrors)
        self.data = Samples()
        self.data.positions = wp.array([[0.7 * i, 0.3, 0.0] for i in range(count)], dtype=wp.vec3f, device="cpu")
        self.data.pixels = wp.array(np.arange(count, dtype=np.int32), dtype=wp.int32, device="cpu")
        mirror: DeviceArray = wp.array([[g, 0.9] for g in mirrors], dtype=wp.vec2f, device="cpu")
        found, listed = self._list(count)
        inputs, out = {"samples": struct_array([self.data], "cpu")}, {"out_count": found, "out_samples": listed}
        launch(reflection_reuse_kernels.collect_reflective, count, "cpu", mirror=mirror, **inputs, **out)
        self.mirrors = wp.clone(listed[: int(found.numpy()[0])])
        pairs = np.stack([sources, others or [-1] * count], axis=-1).astype(np.int32)
        self.sources: DeviceArray = wp.array(pairs, dtype=wp.vec2i, device="cpu")

    @staticmethod
    def _list(count: int) -> tuple[DeviceArray, DeviceArray]:
        return wp.zeros(1, dtype=wp.int32, device="cpu"), wp.zeros(count, dtype=wp.int32, device="cpu")

    def stale_after(self, changed_pixels: tuple[int, ...] = (), then: int = 0, now: int = 0) -> set[int]:
        """Return the samples whose reflection is stale after the light of some pixels has changed."""
        flags = np.zeros(self.sources.size, np.uint8)
        flags[list(changed_pixels)] = 1
        marks: DeviceArray = wp.array(flags, dtype=wp.uint8, device="cpu")
        before = struct_array([set_fields(temporal_kernels.PreviousFrame(), stale=marks)], "cpu")
        samples, air = struct_array([self.data], "cpu"), struct_array([set_fields(Air(), ring_step=now)], "cpu")
        count, listed = self._list(self.sources.size)
        inputs = {"samples": samples, "air": air, "previous": before, "reflective": self.mirrors}
        earlier, out = (
            {"previous_ring_step": then, "sources": self.sources},
            {"out_count": count, "out_samples": listed},
        )
        launch(reflection_reuse_kernels.stale_reflections, self.mirrors.size, "cpu", **inputs, **earlier, **out)
        return set(listed.numpy()[: count.numpy()[0]].tolist())


def test_a_sample_without_reflection_is_never_stale() -> None:
    assert Puddle([0.0, 0.2, 0.0, 0.1], [-2, -2, -2, -2]).stale_after() == {1, 3}


def test_a_reflection_is_stale_when_its_own_light_or_its_sources_changed() -> None:
    puddle = Puddle([0.2] * 4, [3, 3, 0, -1])
    assert puddle.stale_after() == set()
    assert puddle.stale_after(changed_pixels=(1,)) == {1}
    assert puddle.stale_after(changed_pixels=(3,)) == {0, 1, 3}
    assert puddle.stale_after(changed_pixels=(0,)) == {0, 2}


def test_a_reflection_is_stale_when_the_pixel_beside_its_source_changed() -> None:
    puddle = Puddle([0.2] * 4, [-1, 1, 1, 3], [3, -1, 0, -1])
    assert puddle.stale_after() == set()
    assert puddle.stale_after(changed_pixels=(3,)) == {0, 3}
    assert puddle.stale_after(changed_pixels=(0,)) == {0, 2}


def test_each_ring_is_stale_in_one_of_four_ring_steps() -> None:
    puddle = Puddle([0.2] * 64, [-1] * 64)
    stale = [puddle.stale_after(then=step, now=step + 1) for step in range(4)]
    assert set().union(*stale) == set(range(64))
    assert sum(map(len, stale)) == 64
    assert all(stale)
    assert puddle.stale_after(then=0, now=4) == set(range(64))


def test_contact_occlusion_is_zero_beyond_its_end() -> None:
    """So leaving a body out of a tile's list beyond this distance changes nothing."""
    spread = 0.2
    end = spread * float(np.sqrt(8.0))
    found = [_sky_beside(0.1 + reach, spread) for reach in (0.0, 0.5 * end, 0.99 * end, 1.0001 * end, 3.0 * end)]
    assert found[0] < found[1] < found[2] < 1.0
    assert found[3:] == [1.0, 1.0]


@no_type_check  # written in Warp's language
@wp.kernel
def _occlusion(bodies: wp.array[Bodies], lists: wp.array2d[wp.int32], x: wp.float32, out: wp.array[wp.float32]):
    out[0] = contact_occlusion(bodies, lists, 0, wp.vec3f(x, 0.0, 0.0), wp.vec3f(0.0, 0.0, 1.0))


def _sky_beside(x: float, spread: float) -> float:
    """Return the share of the sky that ground at a distance from the centre of a body 0.2 m wide sees."""
    bodies = Bodies()
    bodies.centre = wp.array([[0.0, 0.0, 0.0]], dtype=wp.vec3f, device="cpu")
    bodies.axis, bodies.half = (wp.array([v], dtype=wp.vec2f, device="cpu") for v in ([1.0, 0.0], [0.1, 0.1]))
    bodies.spread, bodies.strength = (wp.array([v], dtype=wp.float32, device="cpu") for v in (spread, 0.7))
    bodies = set_fields(bodies, count=1)
    lists: DeviceArray = wp.array([[1, 0]], dtype=wp.int32, device="cpu")
    out = wp.zeros(1, dtype=wp.float32, device="cpu")
    launch(_occlusion, 1, "cpu", bodies=struct_array([bodies], "cpu"), lists=lists, x=x, out=out)
    return float(out.numpy()[0])
