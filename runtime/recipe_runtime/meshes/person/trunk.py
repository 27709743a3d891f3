"""The trunk of a person: trousers from the crotch to the waist, and a top from its hem to the collar.

The rings have the same columns from the crotch to the neck. Legs continue halves of the lowest ring, arms the edges of
a hole on each side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.body.skeleton import Figure
from recipe_runtime.meshes.curves import smooth
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import COLLAR, HOOD, OPEN, SKIRT, Outfit
from recipe_runtime.meshes.vectors import Array, Index

_HALF: tuple[tuple[float, ...], ...] = (  # degrees of the columns of half a ring, from the front, by detail
    (0, 56, 90, 124, 180),
    (0, 24, 46, 66, 90, 114, 134, 156, 180),
    (0, 15, 30, 44, 58, 74, 90, 106, 122, 136, 150, 165, 180),
)
ARMHOLE = ((1, 1), (1, 3), (2, 4))  # columns to either side of the middle, and rows, by detail
ARMPIT, ACROMION = 0.748, 0.819  # heights of the lowest and the highest point of the armhole

# Heights are fractions of an adult's height, from the crotch (0.47) to the neck (0.836); depths and half widths too.
_FRONT = ((0.47, 0.050), (0.49, 0.057), (0.52, 0.060), (0.56, 0.061), (0.605, 0.060), (0.65, 0.063), (0.70, 0.069),
          (0.735, 0.0695), (0.765, 0.063), (0.79, 0.050), (0.819, 0.036), (0.835, 0.031), (0.88, 0.031))  # fmt: skip
_BACK = ((0.47, 0.062), (0.495, 0.073), (0.52, 0.074), (0.55, 0.066), (0.58, 0.056), (0.61, 0.050), (0.65, 0.052),
         (0.70, 0.061), (0.75, 0.069), (0.78, 0.066), (0.80, 0.058), (0.82, 0.044), (0.84, 0.033),
         (0.88, 0.029))  # fmt: skip
_MALE = ((0.47, 0.092), (0.50, 0.097), (0.53, 0.095), (0.56, 0.090), (0.605, 0.083), (0.65, 0.083), (0.70, 0.089),
         (0.748, 0.090), (0.79, 0.086), (0.819, 0.078), (0.831, 0.058), (0.842, 0.041), (0.852, 0.034),
         (0.88, 0.031))  # fmt: skip
_FEMALE = ((0.47, 0.098), (0.50, 0.103), (0.53, 0.099), (0.56, 0.089), (0.605, 0.074), (0.65, 0.075), (0.70, 0.084),
           (0.748, 0.086), (0.79, 0.082), (0.819, 0.074), (0.831, 0.054), (0.842, 0.037), (0.852, 0.030),
           (0.88, 0.027))  # fmt: skip


@dataclass(frozen=True)
class Build:
    """The build of a person: the figure, and how female and how old it is, 0 to 1."""

    figure: Figure
    female: float
    detail: int  # 0 far, 1, 2 near

    @property
    def columns(self) -> int:
        """Number of columns of the trunk's rings."""
        return 8 * (self.detail + 1)


@lru_cache(maxsize=4)
def directions(detail: int) -> tuple[tuple[float, float], ...]:
    """Return cosine and sine of the trunk's columns, counter-clockwise from the front, seen from above."""
    half = _HALF[detail]
    angles = [*half[:-1], *(360.0 - a for a in half[:0:-1])]
    return tuple((c, s) for s, c in map(exact.sin_cos_deg, angles))


def height(f: Figure, z: float) -> float:
    """Return the height above the ground, metres, of a height of the tables above."""
    if z <= 0.52:
        return f.hip - (0.52 - z) * f.height
    return f.hip + (z - 0.52) * (f.neck - f.hip) / 0.316


def section(b: Build, z: float, ease: float = 0.0) -> tuple[float, float, float]:
    """Return depth in front and behind, and half the width, metres, at a height of the tables.

    Args:
        b: The build.
        z: Height.
        ease: Distance of the cloth from the body, as a fraction of the height.
    """
    f, belly = b.figure, max(0.0, b.figure.girth - 1.0)
    low = min(1.0, max(0.0, (0.80 - z) / 0.05))  # 1 below the shoulders, which are not wider in a stout person
    girth = 1.0 + (f.girth - 1.0) * low
    broad = 1.0 + (f.shoulder / (0.1 * f.height) - 1.0) * min(1.0, max(0.0, (z - 0.66) / 0.08))
    paunch, chest = (z - 0.60) / 0.09, (z - 0.712) / 0.042
    paunch, chest = max(0.0, 1.0 - paunch * paunch), max(0.0, 1.0 - chest * chest)
    front = smooth(_FRONT, z) * girth + 0.16 * belly * paunch + 0.021 * b.female * chest
    back = smooth(_BACK, z) * (0.4 + 0.6 * girth)
    wide = (smooth(_MALE, z) * (1.0 - b.female) + smooth(_FEMALE, z) * b.female) * girth * broad + 0.04 * belly * paunch
    return (front + ease) * f.height, (back + ease) * f.height, (wide + ease) * f.height


def ring(b: Build, z: float, ease: float = 0.0, tilt: float = 0.0) -> Array:
    """Return a ring of the trunk [C, 3]; `tilt` lowers its front and raises its back, as a fraction of the height."""
    front, back, wide = section(b, z, ease)
    up, square = height(b.figure, z), 0.13 * min(1.0, max(0.0, (0.81 - z) / 0.05))
    rows = []
    for c, s in directions(b.detail):
        k = 1.0 + square * 4.0 * c * c * s * s
        rows.append(((front if c > 0.0 else back) * c * k, wide * s * k, up - tilt * b.figure.height * c))
    return np.array(rows)


def trunk_weights(b: Build, points: Array) -> Weights:
    """Return the weights of points of the trunk: thighs near the crotch, pelvis, torso, head near the neck."""
    f = b.figure
    y, z = points[..., 1], points[..., 2]
    torso = ramp(z, f.chest - 0.045 * f.height, f.chest + 0.045 * f.height)
    head = 0.5 * ramp(z, f.neck - 0.012 * f.height, f.neck + 0.03 * f.height)
    low = 0.75 * ramp(-z, -f.hip - 0.012 * f.height, -f.hip + 0.055 * f.height)
    left = ramp(y, -0.03 * f.height, 0.03 * f.height)
    shares = np.stack([low * left, low * (1.0 - left), (1.0 - low) * (1.0 - torso), torso * (1.0 - head), head], -1)
    return Weights(("thigh_left", "thigh_right", "pelvis", "torso", "head"), shares)


def ramp(v: Array, low: float, high: float) -> Array:
    """Return 0 below `low`, 1 above `high`, and a smooth transition between them."""
    t = np.clip((v - low) / (high - low), 0.0, 1.0)
    out: Array = t * t * (3.0 - 2.0 * t)
    return out


def add_hips(hull: Hull, b: Build, o: Outfit) -> tuple[Index, Array]:
    """Add trousers or the top of a skirt, crotch to waist; return the numbers and points of the lowest ring."""
    heights = ((0.47, 0.515, 0.575), (0.47, 0.49, 0.515, 0.545, 0.58), (0.47, 0.482, 0.497, 0.515, 0.54, 0.56, 0.59))
    rows = [ring(b, z, 0.003) for z in heights[b.detail]]
    points = np.stack(rows)
    if b.detail:  # the lowest ring curves up at the hips, where the legs begin
        _, s = np.array(directions(b.detail)).T
        points[0, :, 2] += 0.022 * b.figure.height * s * s
    return hull.sheet(points, trunk_weights(b, points), o.trousers)[0], points[0]


def add_top(hull: Hull, b: Build, o: Outfit, armhole: Array) -> tuple[Index, Index]:
    """Add a top with a hem and a neckline; return the numbers of the edges of the armholes, left and right.

    Args:
        hull: The surface.
        b: The build.
        o: The outfit.
        armhole: Edge of the left armhole [N, 3], from the middle of its top backwards.
    """
    jacket = o.top in (HOOD, OPEN) or o.coat > 0.0
    hem = 0.505 if o.coat == 0.0 else 0.50
    if o.legs == SKIRT and o.coat == 0.0:  # tucked in
        hem = 0.555
    side, count = ARMHOLE[b.detail]
    below = ((0.60, 0.69), (0.535, 0.57, 0.61, 0.66, 0.71), (0.52, 0.54, 0.565, 0.59, 0.62, 0.65, 0.68, 0.705, 0.728))
    heights = [hem, *below[b.detail]]
    first = len(heights)
    heights += [ARMPIT + (ACROMION - ARMPIT) * n / count for n in range(count + 1)]
    above = ((0.840,), (0.830, 0.841), (0.824, 0.830, 0.836, 0.841))[b.detail]
    heights += above
    rows = []
    for z in heights:
        loose = (0.010 if jacket else 0.007) * min(1.0, max(0.25, (0.80 - z) / 0.1)) + 0.006 * _bump(z, 0.585, 0.07)
        flare = 0.006 * max(0.0, (0.56 - z) / 0.06) * (o.coat == 0.0)
        rows.append(ring(b, z, loose + flare, 0.018 * min(1.0, max(0.0, (z - 0.79) / 0.04))))
    points = np.stack(rows)
    middle = b.columns // 4
    loops = []
    for centre, s in ((middle, 1.0), (3 * middle, -1.0)):
        rim = _rim(first, centre, int(s) * side, count)
        for (row, column), point in zip(rim, armhole, strict=True):
            points[row, column] = point * (1.0, s, 1.0)
        loops.append(rim)
    cells = _surfaces(b, o, heights, first, count, side)
    numbers = hull.sheet(points, trunk_weights(b, points), cells, uv=_trunk_uv(b, points), seam=b.columns // 2)
    inside = np.stack([points[0] * (0.88, 0.88, 1.0) + (0.0, 0.0, 0.008), points[0]])
    hull.sheet(inside, trunk_weights(b, inside), o.shirt, uv=_trunk_uv(b, inside), seam=b.columns // 2)
    _collar(hull, b, o, points[-1], numbers[-1])
    left, right = (np.array([numbers[row, column] for row, column in loop]) for loop in loops)
    return left, right


def _trunk_uv(b: Build, points: Array) -> Array:
    """Return uv in metres: u around the body from back to back, 0 in front, with one scale for all rings.

    v is the height above the shoulders.
    """
    half = np.array(_HALF[b.detail]) / 360.0
    turn = np.concatenate([-half[::-1], half[1:]])
    u = np.broadcast_to(turn * 0.55 * b.figure.height, (len(points), len(turn)))
    z = np.roll(points[..., 2], -(b.columns // 2), axis=1)
    return np.stack([u, np.concatenate([z, z[:, :1]], axis=1) - b.figure.shoulders], axis=-1)


def _surfaces(
    b: Build, o: Outfit, heights: Sequence[float], first: int, count: int, side: int
) -> list[list[Surface | None]]:
    """Return the surface of each cell: holes for the arms, and what an open jacket shows in front."""
    cells: list[list[Surface | None]] = []
    columns, middle = b.columns, b.columns // 4
    for row in range(len(heights) - 1):
        found: list[Surface | None] = [o.shirt] * columns
        if o.top == OPEN and b.detail:
            wide = 2 if heights[row] > 0.76 and b.detail == 2 else 1
            found[:wide] = found[columns - wide :] = [o.inner] * wide
        if first <= row < first + count:
            for centre in (middle, 3 * middle):
                found[centre - side : centre + side] = [None] * (2 * side)
        cells.append(found)
    return cells


def _bump(z: float, middle: float, half: float) -> float:
    away = (z - middle) / half
    t = max(0.0, 1.0 - away * away)
    return t * t


def _rim(first: int, middle: int, side: int, count: int) -> list[tuple[int, int]]:
    """Return row and column of the edge of an armhole: from the middle of its top backwards, all around.

    `side` is the number of columns behind the middle, negative on the right, where columns advance to the front.
    """
    top, half, step = first + count, abs(side), 1 if side > 0 else -1
    rim = [(top, middle + step * k) for k in range(half + 1)]
    rim += [(top - k, middle + step * half) for k in range(1, count + 1)]
    rim += [(first, middle + step * (half - k)) for k in range(1, 2 * half + 1)]
    rim += [(first + k, middle - step * half) for k in range(1, count + 1)]
    rim += [(top, middle - step * (half - k)) for k in range(1, half)]
    return rim


def _collar(hull: Hull, b: Build, o: Outfit, edge: Array, numbers: Index) -> None:
    """Add what is above the neckline: a band, a collar, or the hood that lies on the back."""
    h = b.figure.height
    tall = {COLLAR: 0.018, HOOD: 0.012}.get(o.top, 0.014 if o.coat > 0.0 else 0.004)
    up = edge * (0.97, 0.97, 1.0) + (0.0, 0.0, tall * h)
    inside = edge * (0.84, 0.84, 1.0) + (0.0, 0.0, 0.4 * tall * h)
    points = np.stack([edge, up, inside])
    if o.top == COLLAR and b.detail:  # turned over, and open in front
        points = np.stack([edge * (1.16, 1.16, 1.0) - (0.0, 0.0, 0.004 * h), up * (1.0, 1.0, 1.002), inside])
        cells: list[list[Surface | None]] = [[None, *[o.shirt] * (b.columns - 2), None], [o.shirt] * b.columns]
        hull.sheet(points, trunk_weights(b, points), cells, uv=_trunk_uv(b, points), seam=b.columns // 2)
    else:
        hull.sheet(
            points, trunk_weights(b, points), o.shirt, welds={0: numbers}, uv=_trunk_uv(b, points), seam=b.columns // 2
        )
    if o.top == HOOD and b.detail:
        c, _ = np.array(directions(b.detail)).T
        back = np.clip(0.25 - c, 0.0, 1.0)[:, None]
        rows = [
            edge + back * np.array([-x * h, 0.0, z * h])
            for x, z in ((0.0, -0.012), (0.030, -0.02), (0.034, 0.006), (0.014, 0.02), (-0.012, 0.012))
        ]
        hood = np.stack(rows)
        hull.sheet(hood, trunk_weights(b, hood), o.shirt, uv=_trunk_uv(b, hood), seam=b.columns // 2)


def add_skirt(hull: Hull, b: Build, o: Outfit) -> None:
    """Add the cloth of a skirt, or the tails of a coat: open below, and visible from inside."""
    f = b.figure
    h = f.height
    jobs = []
    if o.legs == SKIRT:
        jobs.append((o.trousers, f.hip - 0.215 * h, 0.592, 0.012, 0.034))
    if o.coat > 0.0:
        jobs.append((o.shirt, f.hip - o.coat, 0.525, 0.0145, 0.004 + 0.10 * o.coat / h))
    for surface, hem, waist, ease, flare in jobs:
        top = height(f, waist)
        rows = []
        count = 3 + 2 * b.detail
        for n in range(count + 1):
            t = n / count
            z = hem + (top - hem) * t
            at = ring(b, max(0.50, min(waist, 0.52 + (z - f.hip) / (f.neck - f.hip) * 0.316)), ease + flare * (1.0 - t))
            at[:, 2] = z
            if z < f.hip:  # pleats, which vanish at the waist
                wave = np.where(np.arange(b.columns) % 2 == 0, 1.0, -1.0) * 0.004 * h * (f.hip - z) / (f.hip - hem)
                at[:, :2] *= (1.0 + wave / (0.1 * h))[:, None] if b.detail else 1.0
            rows.append(at)
        points = np.stack(rows)
        left = ramp(points[..., 1], -0.085 * h, 0.085 * h)
        moved = 0.78 * ramp(-points[..., 2], -f.hip - 0.02 * h, -f.hip + 0.10 * h)
        upper = ramp(points[..., 2], f.chest - 0.045 * h, f.chest + 0.045 * h)  # as the top below it
        weights = Weights(
            ("thigh_left", "thigh_right", "pelvis", "torso"),
            np.stack([moved * left, moved * (1.0 - left), (1.0 - moved) * (1.0 - upper), (1.0 - moved) * upper], -1),
        )
        hull.sheet(points, weights, surface, uv=_trunk_uv(b, points), seam=b.columns // 2)
        inner = points[: count - 1] * (0.97, 0.97, 1.0)
        hull.sheet(
            inner,
            Weights(weights.names, weights.shares[: count - 1]),
            surface,
            mirrored=True,
            uv=_trunk_uv(b, inner),
            seam=b.columns // 2,
        )
