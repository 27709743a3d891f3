"""Patterns of vehicles: shut lines and dirt on paint, the cabin behind glass, reflectors of lamps, number plates.

Points and directions are in the frame of the vehicle, so the patterns move with it.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.meshes.cabin import PITCH
from recipe_runtime.meshes.lettering import FONT, bits
from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric import seeds
from recipe_runtime.render.numeric.noise import floor, noise3, scramble, smoothstep, unit
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum
from recipe_runtime.render.texture.detail import Detail, fade
from recipe_runtime.render.texture.lettering import ink_at

wp.set_module_options(OPTIONS)

_FIGURES = {
    "0": "0110 1001 1001 1001 1001 0110", "1": "0010 0110 0010 0010 0010 0111", "2": "0110 1001 0001 0110 1000 1111",
    "3": "1110 0001 0110 0001 0001 1110", "4": "1001 1001 1001 1111 0001 0001", "5": "1111 1000 1110 0001 0001 1110",
    "6": "0110 1000 1110 1001 1001 0110", "7": "1111 0001 0010 0010 0100 0100", "8": "0110 1001 0110 1001 1001 0110",
    "9": "0110 1001 1001 0111 0001 0110",
}  # fmt: skip
_LETTERS = "ABCDEFGHKLMNPRSTUWXYZ"
_DOTS = [tuple(int(rows.replace(" ", "")[k : k + 12], 2) for k in (0, 12)) for rows in _FIGURES.values()]
_DOTS += [bits(letter) for letter in _LETTERS if letter in FONT]
HIGH = wp.constant(wp.types.vector(length=32, dtype=wp.int32)(*[high for high, _ in _DOTS], *[0] * (32 - len(_DOTS))))
LOW = wp.constant(wp.types.vector(length=32, dtype=wp.int32)(*[low for _, low in _DOTS], *[0] * (32 - len(_DOTS))))
LETTERS = wp.constant(len(_DOTS) - 10)
GROOVES = wp.constant(wp.float32(64.0))  # uv of paint from here on are the places of shut lines
MIDDLE = wp.constant(wp.float32(80.0))  # added to these places
GROOVE = wp.constant(wp.float32(0.0045))  # half the width of a shut line, metres
FAR = wp.constant(wp.float32(99.0))


@wp.func
def is_of_vehicle(pattern: wp.int32) -> bool:
    """Return whether a pattern depends on the place in a vehicle's frame."""
    return pattern == Pattern.CAR_PAINT or pattern == Pattern.CABIN


@wp.func
def is_lamp(pattern: wp.int32) -> bool:
    """Return whether a surface is a lamp of a vehicle."""
    if pattern == Pattern.BRAKELIGHT or pattern == Pattern.INDICATOR or pattern == Pattern.REVERSELIGHT:
        return True
    return pattern == Pattern.HEADLIGHT or pattern == Pattern.TAILLIGHT or pattern == Pattern.LENS


@wp.func
def line_share(distance: wp.float32, half: wp.float32, foot: wp.float32) -> wp.float32:
    """Return the share of a pixel covered by a line 2 half wide whose middle is at a distance."""
    w = maximum(foot, 0.001)
    away = wp.abs(distance)
    return clamp01((minimum(away + 0.5 * w, half) - maximum(away - 0.5 * w, -half)) / w)


@wp.func
def bodywork(d: Detail, uv: wp.vec2f, p: wp.vec3f, foot: wp.float32) -> Detail:
    """Paint: shut lines at x = u - 80, and at z = v - 80 (on flat parts |y|); `second` is the share of dirt."""
    lines = fade(0.12, foot)
    if uv[0] >= GROOVES and lines > 0.0:
        share = line_share(p[0] - (uv[0] - MIDDLE), GROOVE, foot)
        across = wp.abs(p[1])
        if wp.abs(d.normal[2]) < 0.75:
            across = p[2]
        share = maximum(share, line_share(across - (uv[1] - MIDDLE), GROOVE, foot))
        d.tone = 1.0 - 0.92 * share * lines
    low = 1.0 - smoothstep(0.16, 0.62, p[2])
    if low > 0.0:
        cloud = wp.float32(0.5)
        near = fade(0.3, foot)
        if near > 0.0:
            cloud = 0.5 + near * (noise3(p[0] * 5.0, p[1] * 5.0, p[2] * 7.0, seeds.VEHICLE_DIRT) - 0.5)
        d.second = low * low * (0.15 + 0.5 * cloud)
    return d


@wp.func
def ball(p: wp.vec3f, s: wp.vec3f, at: wp.vec3f, size: wp.vec3f) -> wp.float32:
    """Return how far along a line of sight an ellipsoid with half axes `size` lies; `FAR` if it is missed."""
    o = wp.vec3f((p[0] - at[0]) / size[0], (p[1] - at[1]) / size[1], (p[2] - at[2]) / size[2])
    w = wp.vec3f(s[0] / size[0], s[1] / size[1], s[2] / size[2])
    a = (w[0] * w[0] + w[1] * w[1]) + w[2] * w[2]
    b = (w[0] * o[0] + w[1] * o[1]) + w[2] * o[2]
    c = ((o[0] * o[0] + o[1] * o[1]) + o[2] * o[2]) - 1.0
    root = b * b - a * c
    if root < 0.0:
        return FAR
    t = (-b - wp.sqrt(root)) / a
    if t < 0.0:
        return FAR
    return t


@wp.func
def block(p: wp.vec3f, s: wp.vec3f, at: wp.vec3f, size: wp.vec3f) -> wp.float32:
    """Return how far along a line of sight a box with half sides `size` lies; `FAR` if it is missed."""
    first = wp.float32(0.0)
    last = wp.float32(FAR)
    for k in range(3):
        o = at[k] - p[k]
        w = s[k]
        if wp.abs(w) < 1.0e-5:
            w = 1.0e-5
        a = (o - size[k]) / w
        b = (o + size[k]) / w
        first = maximum(first, minimum(a, b))
        last = minimum(last, maximum(a, b))
    if first >= last or first <= 0.0:
        return FAR
    return first


@wp.func
def seat_back(p: wp.vec3f, s: wp.vec3f, head: wp.vec3f, pair: bool) -> wp.float32:
    """Return how far along a line of sight a seat lies: one with a headrest, or a low pair of a bus without any."""
    if pair:
        return block(p, s, wp.vec3f(head[0], head[1], head[2] - 0.6), wp.vec3f(0.06, 0.4, 0.38))
    back = block(p, s, wp.vec3f(head[0], head[1], head[2] - 0.47), wp.vec3f(0.06, 0.24, 0.38))
    rest = block(p, s, wp.vec3f(head[0] - 0.02, head[1], head[2]), wp.vec3f(0.045, 0.12, 0.075))
    return minimum(back, rest)


@wp.func
def to_plane(p: wp.float32, s: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """Return how far along a line of sight it leaves an interval on one axis."""
    if s > 1.0e-4:
        return maximum((high - p) / s, 0.0)
    if s < -1.0e-4:
        return maximum((low - p) / s, 0.0)
    return FAR


@wp.func
def occupied(
    p: wp.vec3f,
    s: wp.vec3f,
    seat: wp.float32,
    half: wp.float32,
    head: wp.float32,
    rows: wp.int32,
    driven: wp.int32,
    code: wp.uint32,
    t: wp.float32,
    tone: wp.float32,
    cloth: wp.float32,
    street: wp.float32,
):
    """Return tone, share of the seats' colour, of skin and of the street, with seats, driver and steering wheel.

    `t` is the distance to the walls of the cabin; `tone`, `cloth` and `street` are theirs.
    """
    skin = wp.float32(0.0)
    aside = 0.5 * half + 0.04
    for row in range(rows):
        x = seat - PITCH * wp.float32(row)
        for n in range(2):
            y = aside * (1.0 - 2.0 * wp.float32(n))
            hit = seat_back(p, s, wp.vec3f(x, y, head), rows == 8)
            if hit < t:
                t = hit
                tone = 0.85 + 0.8 * (p[2] + s[2] * t - head + 0.2)
                if rows == 8 and wp.abs(p[1] + s[1] * t - y) < 0.02:
                    tone = 0.3 * tone  # between the two seats of a pair
                cloth = 1.0
                street = 0.0
    if driven == 1:
        hit = ball(p, s, wp.vec3f(seat + 0.2, aside, head - 0.42), wp.vec3f(0.15, 0.23, 0.31))
        if hit < t:
            t = hit
            tone = 0.9 + 0.7 * unit(code)
            cloth = unit(scramble(code))
            street = 0.0
        hit = ball(p, s, wp.vec3f(seat + 0.2, aside, head), wp.vec3f(0.105, 0.08, 0.13))
        if hit < t:
            t = hit
            tone = 1.0
            street = 0.0
            skin = 1.0
            if p[2] + s[2] * t > head + 0.05 or p[0] + s[0] * t < seat + 0.17:
                skin = 0.12  # hair
                tone = 0.3
    along = (seat + 0.62 - p[0]) / (s[0] + 1.0e-6)
    if along > 0.0 and along < t:
        y = p[1] + s[1] * along - aside
        z = p[2] + s[2] * along - head + 0.42
        r = wp.sqrt(y * y + z * z)
        if r > 0.155 and r < 0.19:
            tone = 0.12
            cloth = 0.0
            street = 0.0
            skin = 0.0
    return tone, cloth, skin, street


@wp.func
def cabin(d: Detail, uv: wp.vec2f, p: wp.vec3f, s: wp.vec3f, foot: wp.float32) -> Detail:
    """The inside of a vehicle, by tracing the line of sight: seats, steering wheel, driver, and the windows opposite.

    `tone` is the brightness of what is inside, `second` the share of the seats' colour, `wear` that of skin, and
    `parameter` that of the street seen through the windows opposite. See `meshes/cabin.py` for uv.
    """
    near = fade(0.5, foot)
    d.tone = 0.5
    d.second = 0.3
    d.wear = 0.01
    d.parameter = 0.22
    if near <= 0.0:
        return d
    u = floor(uv[0] + 0.5)
    v = floor(uv[1] + 0.5)
    seat = 0.02 * wp.float32((u & 511) - 256)
    half = 0.04 * wp.float32((u >> 9) & 31)
    rows = ((u >> 14) & 3) + 1
    if rows == 4:
        rows = 8
    head = 0.02 * wp.float32(v & 255)
    belt = 0.02 * wp.float32((v >> 8) & 255)
    roof = head + 0.2 * wp.float32(v >> 16)
    rear = seat - PITCH * wp.float32(rows - 1) - 0.35
    # The walls: floor and lining, doors below the belt, and the street above it.
    side = to_plane(p[1], s[1], -half, half)
    end = to_plane(p[0], s[0], rear, seat + 1.15)
    level = to_plane(p[2], s[2], belt - 0.45, roof)
    t = minimum(level, minimum(side, end))
    z = p[2] + s[2] * t
    tone = wp.float32(0.35)
    cloth = wp.float32(0.4)
    street = wp.float32(0.0)
    if level <= t:
        tone = 0.25
        if s[2] > 0.0:
            tone = 1.3
    elif z > belt:
        street = clamp01((z - belt) * 30.0) * clamp01((roof - 0.03 - z) * 30.0)
    elif end <= t and s[0] > 0.0:
        tone = 0.2  # the dashboard
        cloth = 0.0
    driven = (u >> 16) & 1
    tone, cloth, skin, street = occupied(p, s, seat, half, head, rows, driven, d.code, t, tone, cloth, street)
    d.tone = 0.5 + (clamp01(0.5 * tone) * 2.0 - 0.5) * near
    d.second = 0.3 + (cloth - 0.3) * near
    d.wear = 0.01 + (skin - 0.01) * near
    d.parameter = 0.22 + (street - 0.22) * near
    return d


@wp.func
def reflector(d: Detail, pattern: wp.int32, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A vehicle's lamp: round bowls behind a clear lens in headlights, ribs in the other lamps."""
    near = fade(0.1, foot)
    fu = uv[0] - wp.float32(floor(uv[0])) - 0.5
    fv = uv[1] - wp.float32(floor(uv[1])) - 0.5
    r = wp.sqrt(fu * fu + fv * fv)
    w = maximum(foot * 6.0, 0.03)
    tone = 0.9 + 0.4 * clamp01((0.36 - r) / w + 0.5) - 0.35 * clamp01((wp.abs(fv) - 0.38) / w + 0.5)
    if pattern == Pattern.HEADLIGHT:
        bowl = clamp01((0.42 - r) / w + 0.5)
        rim = clamp01((0.47 - r) / w + 0.5) - bowl
        bulb = clamp01((0.13 - r) / w + 0.5)
        # The bowl mirrors the road above and the sky below.
        chrome = 0.75 - 1.3 * fv - 1.2 * r * r
        tone = 0.3 + bowl * (chrome - 0.3) + 0.9 * rim + bulb * 0.9
    d.tone = 0.85 + (tone - 0.85) * near
    return d


@wp.func
def number_plate(d: Detail, uv: wp.vec2f, foot: wp.float32) -> Detail:
    """A character: floor(u) is its place among seven. Two letters, two figures and three letters, by the vehicle."""
    place = floor(uv[0])
    drawn = unit(scramble(d.code * wp.uint32(747796405) + wp.uint32(place * 977 + 13)))
    which = 10 + floor(drawn * wp.float32(LETTERS))
    if place == 2 or place == 3:
        which = floor(drawn * 10.0)
    high = HIGH[which]
    low = LOW[which]
    x = (uv[0] - wp.float32(place)) * 5.0 - 1.0
    y = uv[1] * 7.0 - 1.0
    i = floor(x)
    j = floor(y)
    fx = x - wp.float32(i)
    fy = y - wp.float32(j)
    below = ink_at(high, low, i, j) * (1.0 - fx) + ink_at(high, low, i + 1, j) * fx
    above = ink_at(high, low, i, j + 1) * (1.0 - fx) + ink_at(high, low, i + 1, j + 1) * fx
    ink = below + (above - below) * fy
    sharp = maximum(1.0 / maximum(foot * 60.0, 0.12), 1.0)
    d.second = 0.4 + (clamp01((ink - 0.42) * sharp + 0.42) - 0.4) * fade(0.1, foot)
    return d


@wp.func
def vehicle(d: Detail, pattern: wp.int32, uv: wp.vec2f, p: wp.vec3f, sight: wp.vec3f, foot: wp.float32) -> Detail:
    """Paint, glass, number plates and lamps of vehicles."""
    if pattern == Pattern.CAR_PAINT:
        return bodywork(d, uv, p, foot)
    elif pattern == Pattern.CABIN:
        return cabin(d, uv, p, sight, foot)
    elif pattern == Pattern.NUMBER_PLATE:
        return number_plate(d, uv, foot)
    return reflector(d, pattern, uv, foot)
