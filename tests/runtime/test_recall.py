"""What a camera at rest need not ask again: each rule alone, with numbers made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recipe_runtime.render import recall, shadow
from recipe_runtime.render.air import Air
from recipe_runtime.render.device import launch, record, records, wp

AT_REST, SKY, TOUCHED, LEAF = (int(c) for c in (recall.AT_REST, recall.SKY, recall.TOUCHED, recall.LEAF))
CALM = int(shadow.UNTOUCHED)


class Camera:
    """Tiles of samples of which only what `enlist` asks for is given."""

    def __init__(self, *tiles: list[int]) -> None:
        self.known = wp.array(np.concatenate(tiles).astype(np.uint8), dtype=wp.uint8, device="cpu")
        self.firsts = wp.array(np.cumsum([0, *map(len, tiles)]).astype(np.int32), dtype=wp.int32, device="cpu")
        self.quiet = wp.zeros(len(tiles), dtype=wp.uint8, device="cpu")
        self.tiles = len(tiles)

    def asked(self, bits: int = CALM, *, then: int = 0, now: int = 0, sky: int = 1) -> set[int]:
        """The samples listed at a stir, `then` having been the frame before's."""
        air, before = Air(), recall.Before()
        air.stirs, before.stirs, before.sky = now, then, sky
        before.tiles = wp.array(np.full(self.tiles, bits, np.int32), dtype=wp.int32, device="cpu")
        count, listed = (wp.zeros(n, dtype=wp.int32, device="cpu") for n in (1, self.known.size))
        told: list[Any] = [record(v, "cpu") for v in (air, before)]
        inputs = [self.firsts, *told, self.known, self.quiet, count, listed]
        launch(recall.enlist, self.tiles, inputs, "cpu")
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


def beam(texel: float, shaded: tuple[int, int] | None) -> Any:
    """A map of 256 texels about the origin under a sun in the zenith, with one tile of it in use."""
    found = shadow.Sunbeam()
    found.u, found.v = wp.vec4f(1.0 / texel, 0.0, 0.0, 128.0), wp.vec4f(0.0, 1.0 / texel, 0.0, 128.0)
    found.q, found.size, found.texel, found.depth = wp.vec4f(0.0, 0.0, 0.001, 0.5), 256, texel, 1000.0
    bounds = np.zeros((16, 16, 2), np.float32)
    if shaded is not None:
        bounds[shaded] = 0.6
    found.depths = wp.zeros(256 * 256, dtype=wp.float32, device="cpu")
    found.bounds = wp.array(bounds.reshape(-1, 2), dtype=wp.vec2f, device="cpu")
    return found


def calm_at(x: float, y: float, fine: tuple[int, int] | None, coarse: tuple[int, int] | None) -> bool:
    """Whether a box of half a metre about a place is out of reach of what moves."""
    beams = records([beam(0.02, None), beam(0.2, None), beam(0.02, fine), beam(0.2, coarse)], "cpu")
    corners = [wp.array([[x + d, y + d, d]], dtype=wp.vec3f, device="cpu") for d in (-0.25, 0.25)]
    same = wp.array([1], dtype=wp.int32, device="cpu")
    launch(shadow.calm, 1, [*corners, beams, 1, same], "cpu")
    return bool(same.numpy()[0] & CALM)


def test_where_the_fine_shadow_map_holds_all_it_alone_tells() -> None:
    assert calm_at(0.0, 0.0, None, (8, 8))  # the coarse map's tile there is 3.2 m wide, and mostly empty
    assert not calm_at(0.0, 0.0, (8, 8), None)


def test_elsewhere_the_coarse_shadow_map_tells() -> None:
    assert not calm_at(10.0, 0.0, None, (8, 11))
    assert calm_at(10.0, 0.0, None, (11, 8))
    assert not calm_at(2.4, 0.0, None, (8, 8)), "beyond the fine map's rim"
