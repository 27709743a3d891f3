"""Reflections on wet ground: what a puddle mirrors is looked up in the picture itself.

The mirrored ray is followed until it passes behind something that the camera sees; that sample's light is reflected.
Four pixels share one ray's length, each goes that far along a ray of its own; at an edge, as far as those beside it.
A ray that meets nothing sees the sky, or, if it is low, the street beyond the picture.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.air import Air, decay, reflected_sky
from recipe_runtime.render.bounds import clamp01, greater, index, lesser
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import hash2, noise2, step_between, whole
from recipe_runtime.render.observation import TILE
from recipe_runtime.render.recall import Asked, Before, asked_of, spoil
from recipe_runtime.render.shade import Samples
from recipe_runtime.render.vectors import inner, mix
from recipe_runtime.render.visibility import Lens

wp.set_module_options(OPTIONS)

STEPS = wp.constant(13)
WIDEST = wp.constant(255 * 16)  # pixels along a side, of pictures whose rays are kept: a tile's place is a byte
GROWTH = wp.constant(wp.float32(1.47))
FAR = wp.constant(wp.float32(60.0))  # metres of air before what a ray meets beyond the picture
DRY = wp.constant(-2)  # in the place of a sample: a block that mirrors nothing
FAINT = wp.constant(wp.float32(0.016))  # shares below this only see the sky


@wp.func
def seen_from(view: wp.array2d[wp.float32], v: wp.vec3f) -> wp.vec3f:
    """A direction of the world in the camera's frame."""
    return wp.vec3f(
        (view[0, 0] * v[0] + view[0, 1] * v[1]) + view[0, 2] * v[2],
        (view[0, 4] * v[0] + view[0, 5] * v[1]) + view[0, 6] * v[2],
        (view[0, 8] * v[0] + view[0, 9] * v[1]) + view[0, 10] * v[2],
    )


@wp.func
def place_of(q: wp.vec3f, lens: Lens) -> wp.vec2i:
    """The column and the row of the pixel that a point before the camera falls on; -1 and -1 outside of the picture."""
    scale = wp.float32(lens.focal) / q[2]
    x = q[0] * scale + wp.float32(lens.cx)
    y = q[1] * scale + wp.float32(lens.cy)
    within = x >= 0.0 and y >= 0.0 and x < wp.float32(lens.width) and y < wp.float32(lens.height)
    return wp.vec2i(wp.where(within, wp.int32(x), -1), wp.where(within, wp.int32(y), -1))


@wp.func
def turn_at(p: wp.vec3f) -> wp.int32:
    """Which of four turns a patch of ground has."""
    return wp.int32(hash2(whole(p[0] * 1.9), whole(p[1] * 1.9), wp.uint32(44)) >> wp.uint32(30))


@wp.func
def rings_at(turn: wp.int32, moment: wp.int32) -> wp.int32:
    """Which pattern of rings a patch has: another after four moments, each patch at its own."""
    return (moment + turn) >> 2


@wp.func
def rippled(air: wp.array[Air], p: wp.vec3f, rings: wp.int32, gloss: wp.float32) -> wp.float32:
    """How far ripples, grain and falling drops tilt wet ground at p along the sight, as on any wet road."""
    return (noise2(p[0] * 23.0, p[1] * 23.0, wp.uint32(rings)) - 0.5) * (0.006 + 0.3 * (1.0 - gloss) + air[0].pelting)


@wp.func
def mirrored(to_point: wp.vec3f, ripple: wp.float32) -> wp.vec3f:
    """The unit direction in which wet ground sends the sight on: upward, and a little astray."""
    one = 1.0 / wp.sqrt(greater(inner(to_point, to_point), 1.0e-8))
    sight = to_point * one
    n = wp.vec3f(sight[0] * ripple, sight[1] * ripple, 1.0)
    r = sight - n * (2.0 * inner(n, sight) / inner(n, n))
    return wp.vec3f(r[0], r[1], greater(r[2], 0.02))


@wp.func
def first_wet(
    x0: wp.int32, y0: wp.int32, gleam: wp.array[wp.vec2f], starts: wp.array[wp.int32], lens: Lens
) -> wp.int32:
    """The first sample of a block of 2 x 2 pixels that mirrors enough to be followed; -1 if none does."""
    found = wp.int32(-1)
    for y in range(y0, wp.min(y0 + 2, lens.height)):
        for x in range(x0, wp.min(x0 + 2, lens.width)):
            s = index(starts[index(y * lens.width + x)])
            if found < 0 and gleam[s][0] > FAINT:
                found = s
    return found


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
def close_in(
    start: wp.vec3f, way: wp.vec3f, before: wp.float32, behind: wp.float32, depth: wp.array[wp.float32], lens: Lens
) -> wp.float32:
    """Where on its way a ray first passed behind what is seen: halvings between before it and behind it."""
    low = before
    high = behind
    for _halving in range(4):
        middle = (low + high) * 0.5
        q = start + way * middle
        at = place_of(q, lens)
        hidden = False
        if at[0] >= 0:
            hidden = depth[index(at[1] * lens.width + at[0])] < q[2] - 0.03
        if hidden:
            high = middle
        else:
            low = middle
    return high


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


@wp.func
def followed(
    i: wp.int32,
    x0: wp.int32,
    y0: wp.int32,
    samples: wp.array[Samples],
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    lens: Lens,
):
    """How far the mirrored ray of a sample goes to what it meets, -1 if it meets nothing; and the tiles on its way."""
    to_point = samples[0].positions[i] - samples[0].eye
    start = seen_from(view, to_point)
    way = seen_from(view, mirrored(to_point, 0.0))
    hit = wp.int32(0)
    last = wp.float32(0.05)
    t = wp.float32(0.2)
    left = x0
    top = y0
    right = x0 + 1
    bottom = y0 + 1
    for _step in range(STEPS):
        q = start + way * t
        if q[2] <= 0.2:
            break
        at = place_of(q, lens)
        x = at[0]
        y = at[1]
        if x < 0:
            break
        left = wp.min(left, x)
        top = wp.min(top, y)
        right = wp.max(right, x)
        bottom = wp.max(bottom, y)
        seen = depth[index(y * lens.width + x)]
        if seen < q[2] - 0.03 and seen > q[2] - 0.3 - 1.3 * (t - last):
            hit = 1
            break
        last = t
        t = t * GROWTH
    found = wp.float32(-1.0)
    if hit != 0:
        found = close_in(start, way, last, t, depth, lens)
    return found, tiles_of(left, top, right, bottom, lens)


@wp.kernel
def march(
    samples: wp.array[Samples],
    gleam: wp.array[wp.vec2f],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view: wp.array2d[wp.float32],
    lens: Lens,
    before: wp.array[Before],
    moved: wp.array2d[wp.int32],
    span: wp.int32,
    reach: wp.array[wp.float32],
    asked: wp.array[wp.int32],
    ways: wp.array[wp.uint32],
):
    """How far the mirrored rays of blocks of 2 x 2 pixels go to what they meet; `span` blocks of a row to a thread.

    The ray of an earlier frame, from sample `asked` past the tiles `ways`, is kept where all of them are still; so is
    the knowledge (`DRY`) that a block mirrors nothing. A block whose ray goes another way than it did is disturbed.
    """
    columns = (lens.width + 1) / 2
    spans = (columns + span - 1) / span
    row = wp.tid() / spans
    first = (wp.tid() % spans) * span
    small = before[0].kept > 0 and wp.max(lens.width, lens.height) <= WIDEST
    y0 = row * 2
    for column in range(first, wp.min(first + span, columns)):
        x0 = column * 2
        block = index(row * columns + column)
        known = asked[block]
        same = bool(False)
        # (Nested, for what a kernel works out of an `and` is Warp's affair, and `calm` needs a small picture.)
        if small and known != -1:  # noqa: SIM102
            if undisturbed(x0, y0, before, lens):
                same = known == DRY
                if not same:
                    same = calm(moved, ways[block])
        if not same:
            i = first_wet(x0, y0, gleam, starts, lens)
            was = reach[block]
            now = wp.float32(-1.0)
            asked[block] = DRY
            if i >= 0:
                now, way = followed(i, x0, y0, samples, depth, view, lens)
                ways[block] = way
                asked[block] = -1
                if small and i < before[0].kept:  # noqa: SIM102
                    if calm(moved, way):
                        asked[block] = i
            reach[block] = now
            if was != now:
                disturb(x0, y0, before, lens)


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


@wp.func
def met(
    t: wp.float32,
    to_point: wp.vec3f,
    d: wp.vec3f,
    depth: wp.array[wp.float32],
    view: wp.array2d[wp.float32],
    lens: Lens,
) -> wp.vec2i:
    """The pixel that a ray which goes t metres from a point ends on, and whether what is seen there lies at its end.

    -1 and 0 if t is not above 0, or if that is beyond the picture.
    """
    at = wp.int32(-1)
    close = wp.int32(0)
    if t > 0.0:
        q = seen_from(view, to_point + d * t)
        if q[2] > 0.2:
            place = place_of(q, lens)
            if place[0] >= 0:
                at = place[1] * lens.width + place[0]
                seen = depth[index(at)]
                close = wp.where(seen < q[2] + 0.1 + 0.03 * t and seen > q[2] - 0.3 - 0.2 * t, 1, 0)
    return wp.vec2i(at, close)


@wp.func
def block_beside(block: wp.int32, pixel: wp.int32, t: wp.float32, reach: wp.array[wp.float32], lens: Lens) -> wp.int32:
    """The block next to a pixel of a block whose ray went t metres, if that one's went another way; else its own.

    It is the one on the pixel's side; or, if that is no other, the one above or below.
    """
    columns = (lens.width + 1) / 2
    rows = (lens.height + 1) / 2
    column = block % columns
    row = block / columns
    c = wp.min(wp.max(column + ((pixel % lens.width) & 1) * 2 - 1, 0), columns - 1)
    r = wp.min(wp.max(row + ((pixel / lens.width) & 1) * 2 - 1, 0), rows - 1)
    found = row * columns + c
    if wp.abs(reach[index(found)] - t) <= 0.15 * wp.abs(t):
        found = r * columns + column
        if wp.abs(reach[index(found)] - t) <= 0.15 * wp.abs(t):
            found = block
    return found


@wp.kernel
def reflect(
    samples: wp.array[Samples],
    air: wp.array[Air],
    gleam: wp.array[wp.vec2f],
    reach: wp.array[wp.float32],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view: wp.array2d[wp.float32],
    lens: Lens,
    before: wp.array[Before],
    asked: wp.array[Asked],
    radiance: wp.array[wp.vec3f],
    sources: wp.array[wp.vec2i],
    out: wp.array[wp.vec3f],
):
    """Add to the samples that are asked what they mirror: along their own ray, as far as their block's ray went.

    Where that ends in the air or behind something, as it may at the edge of what is mirrored, or goes nowhere, the ray
    of a block beside it may end better. `sources` is told which pixel's light it was, and which other pixel's depth had
    a part in that, as `due` takes it.
    """
    i = asked_of(asked, wp.tid())
    share = gleam[i][0]
    if share <= 0.0:
        return
    pixel = samples[0].pixels[i]
    if pixel < 0:  # a slot that no sample took
        return
    light = radiance[i]
    pixel = index(pixel)
    block = index((pixel / lens.width / 2) * ((lens.width + 1) / 2) + (pixel % lens.width) / 2)
    keep = i < before[0].kept
    spoil(before, pixel)
    p = samples[0].positions[i]
    to_point = p - samples[0].eye
    d = mirrored(to_point, rippled(air, p, rings_at(turn_at(p), air[0].moment), gleam[i][1]))
    t = reach[block]
    own = met(t, to_point, d, depth, view, lens)
    at = own[0]
    other = wp.int32(-1)
    if own[1] == 0:
        beside = reach[index(block_beside(block, pixel, t, reach, lens))]
        if beside > 0.0 and beside != t:
            end = met(beside, to_point, d, depth, view, lens)
            other = end[0]
            if end[1] != 0:
                other = at
                at = end[0]
    if at >= 0:
        # A film spreads a lamp's image over the ground about it; only standing water shows it whole.
        most = air[0].sideways * (4.0 + 500.0 * greater(gleam[i][1] - 0.82, 0.0))
        seen = index(starts[index(at)])
        shown = radiance[seen]
        shown = wp.vec3f(lesser(shown[0], most[0]), lesser(shown[1], most[1]), lesser(shown[2], most[2]))
        out[i] = light + shown * share
        if seen >= before[0].kept:
            at = -2
    else:
        street = clamp01(step_between(0.34, 0.12, d[2]))
        beyond = mix(reflected_sky(air, d), air[0].sideways * 0.45, street)
        out[i] = light + mix(air[0].fog_colour, beyond, decay(air, (air[0].fog + air[0].haze) * FAR)) * share
    if keep:
        sources[i] = wp.vec2i(at, other)
