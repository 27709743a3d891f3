"""Which mirrored rays and which mirrored light of an earlier frame still hold."""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.lighting.air import Air
from recipe_runtime.render.lighting.temporal_kernels import Before, spoil
from recipe_runtime.render.numeric.noise import hash2, whole
from recipe_runtime.render.numeric.scalars import index
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.camera import Lens

wp.set_module_options(OPTIONS)

WIDEST = wp.constant(255 * 16)  # pixels along a side, of pictures whose rays are kept: a tile's place is a byte


@wp.func
def turn_at(p: wp.vec3f) -> wp.int32:
    """Which of four turns a patch of ground has."""
    return wp.int32(hash2(whole(p[0] * 1.9), whole(p[1] * 1.9), wp.uint32(44)) >> wp.uint32(30))


@wp.func
def rings_at(turn: wp.int32, moment: wp.int32) -> wp.int32:
    """Which pattern of rings a patch has: another after four moments, each patch at its own."""
    return (moment + turn) >> 2


@wp.func
def undisturbed(x0: wp.int32, y0: wp.int32, before: wp.array[Before], lens: Lens) -> bool:
    """Whether the light of a block's pixels is what it was when they were last developed."""
    x1 = wp.min(x0 + 1, lens.width - 1)
    top = y0 * lens.width
    bottom = wp.min(y0 + 1, lens.height - 1) * lens.width
    first = before[0].stale[index(top + x0)] | before[0].stale[index(top + x1)]
    second = before[0].stale[index(bottom + x0)] | before[0].stale[index(bottom + x1)]
    return (first | second) == wp.uint8(0)


@wp.func
def disturb(x0: wp.int32, y0: wp.int32, before: wp.array[Before], lens: Lens):
    """What a block of 2 x 2 pixels mirrors changes, and perhaps what the blocks beside it do."""
    for y in range(wp.max(y0 - 2, 0), wp.min(y0 + 4, lens.height)):
        for x in range(wp.max(x0 - 2, 0), wp.min(x0 + 4, lens.width)):
            spoil(before, y * lens.width + x)


@wp.func
def tiles_of(left: wp.int32, top: wp.int32, right: wp.int32, bottom: wp.int32, lens: Lens) -> wp.uint32:
    """The tiles, fewer than 255 a side, that hold a rectangle of pixels and those beside it: four bytes."""
    x0 = wp.uint32(wp.max(left - 1, 0) / TILE)
    y0 = wp.uint32(wp.max(top - 1, 0) / TILE)
    x1 = wp.uint32(wp.min(right + 1, lens.width - 1) / TILE)
    y1 = wp.uint32(wp.min(bottom + 1, lens.height - 1) / TILE)
    return x0 | (y0 << wp.uint32(8)) | (x1 << wp.uint32(16)) | (y1 << wp.uint32(24))


@wp.func
def calm(moved: wp.array2d[wp.int32], tiles: wp.uint32) -> wp.bool:
    """Whether nothing moves in a rectangle of tiles; `moved` counts those above and to the left of each corner."""
    x0 = wp.int32(tiles & wp.uint32(255))
    y0 = wp.int32((tiles >> wp.uint32(8)) & wp.uint32(255))
    x1 = wp.int32((tiles >> wp.uint32(16)) & wp.uint32(255)) + 1
    y1 = wp.int32(tiles >> wp.uint32(24)) + 1
    return moved[y1, x1] - moved[y0, x1] - moved[y1, x0] + moved[y0, x0] == 0


@wp.kernel
def pools(
    samples: wp.array[Samples], gleam: wp.array[wp.vec2f], count: wp.array[wp.int32], mirrors: wp.array[wp.int32]
):
    """List the samples that mirror anything, and the turn of the ground there in the two highest bits but one."""
    i = index(wp.tid())
    if gleam[i][0] > 0.0:
        mirrors[wp.atomic_add(count, 0, 1)] = i | (turn_at(samples[0].positions[i]) << 29)


@wp.kernel
def due(
    samples: wp.array[Samples],
    air: wp.array[Air],
    before: wp.array[Before],
    mirrors: wp.array[wp.int32],
    moment: wp.int32,
    sources: wp.array[wp.vec2i],
    count: wp.array[wp.int32],
    listed: wp.array[wp.int32],
):
    """List those of `pools` that mirror something else than before, when the rings were those of `moment`.

    So do they where their own light or ray has changed, the water, or what is seen at the two pixels that `sources`
    tells: -1 is what lies beyond the picture, -2: it is not known. `count` comes zeroed. Their order tells in no byte.
    """
    entry = mirrors[wp.tid()]
    i = index(entry & 0x1FFFFFFF)
    turn = entry >> 29
    source = sources[i]
    same = rings_at(turn, moment) == rings_at(turn, air[0].moment) and source[0] > -2
    if same:
        same = before[0].stale[index(samples[0].pixels[i])] == wp.uint8(0)
        if same and source[0] >= 0:
            same = before[0].stale[index(source[0])] == wp.uint8(0)
        if same and source[1] >= 0:
            same = before[0].stale[index(source[1])] == wp.uint8(0)
    if not same:
        listed[wp.atomic_add(count, 0, 1)] = i
