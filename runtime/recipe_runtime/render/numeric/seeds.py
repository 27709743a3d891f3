"""The register of noise seeds. A seed determines bytes: new patterns take new numbers, and no number is ever changed.

Seeds 8 to 11 each serve two patterns that never occur on one surface.
"""

from __future__ import annotations

import hashlib

from recipe_runtime.render.device.setup import wp

ASPHALT_AGE = wp.constant(wp.uint32(1))
ASPHALT_PATCH = wp.constant(wp.uint32(2))
ASPHALT_STONE = wp.constant(wp.uint32(3))
ASPHALT_GRAIN = wp.constant(wp.uint32(4))
SLAB_SPECK = wp.constant(wp.uint32(5))
SLAB_STAIN = wp.constant(wp.uint32(6))
GRASS_TUFT = wp.constant(wp.uint32(8))
LEAF_BOUGH = wp.constant(wp.uint32(8))
GRASS_BLADE = wp.constant(wp.uint32(9))
LEAF = wp.constant(wp.uint32(9))
GRASS_BLADE_FINE = wp.constant(wp.uint32(10))
LEAF_TWIG = wp.constant(wp.uint32(10))
GROUND_HEIGHT = wp.constant(wp.uint32(11))
LEAF_EDGE = wp.constant(wp.uint32(11))
GROUND_HEIGHT_MIDDLE = wp.constant(wp.uint32(12))
WALL_STAIN = wp.constant(wp.uint32(13))
WALL_GRAIN = wp.constant(wp.uint32(14))
PAINT_WEAR = wp.constant(wp.uint32(15))
BRICK_STAIN = wp.constant(wp.uint32(16))
BARK_RIB = wp.constant(wp.uint32(17))
GROUND_HEIGHT_FINE = wp.constant(wp.uint32(18))
WALL_RUN = wp.constant(wp.uint32(19))
STONE_GRAIN = wp.constant(wp.uint32(20))
ROOF_MOSS = wp.constant(wp.uint32(21))
BOARD_TONE = wp.constant(wp.uint32(22))
PLANK_TONE = wp.constant(wp.uint32(23))
PLANK_GRAIN = wp.constant(wp.uint32(24))
RIPPLE_X = wp.constant(wp.uint32(25))
RIPPLE_Y = wp.constant(wp.uint32(26))
FACADE_STAIN = wp.constant(wp.uint32(27))
ASPHALT_REPAIR = wp.constant(wp.uint32(28))
GRASS_FIELD = wp.constant(wp.uint32(29))
WIND_GUST = wp.constant(wp.uint32(41))
WIND_LEAF = wp.constant(wp.uint32(42))
SKYLINE = wp.constant(wp.uint32(43))
RING_PHASE = wp.constant(wp.uint32(44))
LEAF_PHASE = wp.constant(wp.uint32(45))
WINDOW_DIVISION = wp.constant(wp.uint32(71))
FACADE_BUILDING = wp.constant(wp.uint32(72))
TILE_TONE = wp.constant(wp.uint32(77))
POSTER = wp.constant(wp.uint32(91))
CLOUD_LARGE = wp.constant(wp.uint32(101))
CLOUD_MIDDLE = wp.constant(wp.uint32(102))
CLOUD_SMALL = wp.constant(wp.uint32(103))
CLOUD_FINE = wp.constant(wp.uint32(104))
CIRRUS = wp.constant(wp.uint32(105))
STAR = wp.constant(wp.uint32(106))


def noise_key(seed: int, name: str, frame: int) -> int:
    """Return a 32-bit key of a seed, a name and a frame."""
    digest = hashlib.sha256(f"{seed}/{name}/{frame}".encode()).digest()
    return int.from_bytes(digest[:4], "little")
