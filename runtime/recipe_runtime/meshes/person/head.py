"""Heads of people: a skull whose face is shaped by smooth bumps, eyes, brows, lips, ears, beards and glasses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.meshes.builder import circle
from recipe_runtime.meshes.curves import smooth
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import Outfit
from recipe_runtime.meshes.person.trunk import Build, height, ring, trunk_weights
from recipe_runtime.meshes.vectors import Array

HEAD = Weights.whole("head")
# Height above the lower end of the skull, then depth in front and behind, half width: fractions of the head's height.
_FRONT = ((0.0, 0.20), (0.03, 0.315), (0.08, 0.375), (0.14, 0.390), (0.25, 0.398), (0.38, 0.405), (0.50, 0.402),
    (0.60, 0.420),
          (0.70, 0.418), (0.80, 0.375), (0.88, 0.305), (0.95, 0.20), (0.985, 0.10), (1.0, 0.0))  # fmt: skip
_BACK = ((0.0, 0.16), (0.06, 0.20), (0.15, 0.24), (0.25, 0.29), (0.36, 0.36), (0.50, 0.43), (0.62, 0.455),
    (0.74, 0.44), (0.85, 0.365),
         (0.94, 0.235), (0.985, 0.11), (1.0, 0.0))  # fmt: skip
_WIDTH = ((0.0, 0.13), (0.03, 0.175), (0.08, 0.215), (0.16, 0.260), (0.26, 0.292), (0.40, 0.322), (0.52, 0.338),
    (0.64, 0.345),
          (0.76, 0.325), (0.86, 0.272), (0.94, 0.185), (0.985, 0.09), (1.0, 0.0))  # fmt: skip
_COLUMNS = (
    (0, 60, 120, 180),
    (0, 13, 27, 44, 66, 90, 116, 148, 180),
    (0, 5, 10, 15, 20.5, 27, 35, 45, 58, 74, 90, 110, 135, 158, 180),
)
_ROWS: tuple[tuple[float, ...], ...] = (
    (0.02, 0.20, 0.42, 0.66, 0.86, 0.99),
    (0.0, 0.04, 0.10, 0.19, 0.28, 0.35, 0.42, 0.49, 0.57, 0.68, 0.80, 0.90, 0.97, 0.997),
    (0.0, 0.02, 0.05, 0.09, 0.13, 0.165, 0.19, 0.21, 0.23, 0.255, 0.285, 0.315, 0.34, 0.37, 0.40, 0.43, 0.46, 0.485,
    0.51, 0.54, 0.57,
     0.60, 0.65, 0.71, 0.78, 0.85, 0.91, 0.955, 0.985, 0.998),
)  # fmt: skip


@lru_cache(maxsize=4)
def columns(detail: int) -> tuple[tuple[float, float], ...]:
    """Return cosine and sine of the columns of the head's rings, counter-clockwise from the front."""
    half = _COLUMNS[detail]
    return tuple((c, s) for s, c in map(exact.sin_cos_deg, [*half[:-1], *(360.0 - a for a in half[:0:-1])]))


def frame(b: Build) -> tuple[float, float, float]:
    """Return height of the head, height of its lower end above the ground, and how far it is ahead, metres."""
    f = b.figure
    return 0.142 * f.height * f.head, f.neck + 0.021 * f.height, 0.004 * f.height


def _bump(v: Array, middle: float, half: float) -> Array:
    t = np.maximum(0.0, 1.0 - ((v - middle) / half) * ((v - middle) / half))
    out: Array = t * t
    return out


def _relief(b: Build, y: Array, z: Array, front: Array) -> Array:
    """Return how far the face stands out at y and z (fractions of the head): nose, brows, sockets, lips, chin."""
    age = 1.0 if b.figure.head < 1.1 else 0.55
    side = np.abs(y)
    ridge = np.clip((0.60 - z) / 0.27, 0.0, 1.0) * (z > 0.30)
    nose = 0.105 * ridge * _bump(y, 0.0, 0.050) + 0.05 * _bump(z, 0.335, 0.06) * _bump(y, 0.0, 0.085)
    nose = nose * (0.85 if b.female else 1.0) * age
    socket = -0.042 * _bump(side, 0.150, 0.115) * _bump(z, 0.485, 0.085)
    brow = 0.016 * _bump(side, 0.14, 0.16) * _bump(z, 0.575, 0.06) * (1.0 - 0.6 * b.female)
    cheek = 0.020 * _bump(side, 0.20, 0.12) * _bump(z, 0.375, 0.12)
    lips = 0.011 * _bump(y, 0.0, 0.12) * (_bump(z, 0.228, 0.032) + 1.1 * _bump(z, 0.183, 0.034))
    mouth = 0.014 * _bump(y, 0.0, 0.17) * _bump(z, 0.21, 0.12)
    chin = 0.030 * _bump(y, 0.0, 0.16) * _bump(z, 0.075, 0.085) - 0.012 * _bump(y, 0.0, 0.2) * _bump(z, 0.135, 0.035)
    out: Array = (nose + socket + brow + cheek + lips + mouth + chin) * np.maximum(front, 0.0)
    return out


def skull(b: Build, grow: float = 0.0) -> Array:
    """Return the rings of the skull [R, C, 3] in the frame of the body, `grow` (of the head's height) thicker."""
    size, base, ahead = frame(b)
    slim = 1.0 - 0.05 * b.female
    turn = np.array(columns(b.detail))
    z = np.array(_ROWS[b.detail])
    front, back, wide = (np.array([smooth(table, v) for v in z]) for table in (_FRONT, _BACK, _WIDTH))
    jaw = np.where(z < 0.3, slim, 1.0)
    c, s = turn[:, 0][None], turn[:, 1][None]
    y = (wide * jaw + grow)[:, None] * s
    x = np.where(c > 0.0, (front + grow)[:, None], (back + grow)[:, None]) * c
    x = x + _relief(b, y, np.broadcast_to(z[:, None], y.shape), np.broadcast_to(c, y.shape))
    up = np.broadcast_to(z[:, None], y.shape)
    return np.stack([x * size + ahead, y * size, base + up * size], axis=-1)


def face_point(b: Build, y: float, z: float, out: float) -> tuple[float, float, float]:
    """Return a point of the face at y and z (fractions of the head), `out` in front of the skin."""
    size, base, ahead = frame(b)
    wide, front = smooth(_WIDTH, z), smooth(_FRONT, z)
    share = max(0.0, 1.0 - (y / wide) * (y / wide))
    c = float(np.sqrt(share))
    x = front * c + float(_relief(b, np.array(y), np.array(z), np.array(c)))
    return (x + out) * size + ahead, y * size, base + z * size


def add_head(hull: Hull, b: Build, o: Outfit, *, beard: float, glasses: float) -> None:
    """Add neck and head; beard: 1 for one; glasses: 1 clear, 2 dark."""
    rows = []
    for z in (0.81, 0.88) if b.detail == 0 else (0.81, 0.835, 0.85, 0.868, 0.884):
        at = ring(b, max(z, 0.85), 0.0, 0.01)
        at[:, 2] += height(b.figure, z) - height(b.figure, max(z, 0.85))
        rows.append(at)
    neck = np.stack(rows)
    hull.sheet(neck, trunk_weights(b, neck), o.skin)
    points = skull(b)
    hull.sheet(points, HEAD, o.skin, uv=_skin_uv(points), caps=(True, True))
    if beard > 0.0:
        _add_beard(hull, b, o)
    if b.detail:
        _features(hull, b, o, beard=beard, glasses=glasses)


def _skin_uv(points: Array) -> Array:
    ends = np.concatenate([points, points[:, :1]], axis=1)
    return np.stack([ends[..., 1], ends[..., 2]], axis=-1)


def _add_beard(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a short beard with a moustache: a sheet over the jaw that ends in front of the ears."""
    columns = (7, 13, 23)[b.detail]
    rows: list[list[tuple[float, float, float]]] = []
    turns = [exact.sin_cos_deg(-88.0 + 176.0 * n / (columns - 1)) for n in range(columns)]
    for t in (0.0, 0.3, 0.6, 0.85, 1.0):
        row = []
        for s, _ in turns:
            y = 0.30 * s
            high = 0.265 - 0.55 * max(0.0, abs(y) - 0.07) if abs(y) < 0.13 else 0.232 + 1.6 * max(0.0, abs(y) - 0.17)
            row.append(face_point(b, y, 0.012 + (min(high, 0.44) - 0.012) * t, -0.004 if t == 1.0 else 0.012))
        rows.append(row)
    hull.sheet(np.array(rows), HEAD, o.hair, closed=False)


def _patch(
    hull: Hull,
    b: Build,
    surface: Surface,
    at: tuple[float, float],
    size: tuple[float, float],
    out: float,
    *,
    bend: float = 0.0,
    sides: int = 8,
) -> None:
    """Add a small oval on the face; `bend` lowers its ends."""
    (y, z), (wide, tall) = at, size
    rim = [face_point(b, y + wide * c, z + tall * s - bend * c * c, out) for c, s in circle(sides)]
    middle = [face_point(b, y + 0.4 * wide * c, z + 0.4 * tall * s, out + 0.008) for c, s in circle(sides)]
    hull.sheet(np.array([rim, middle]), HEAD, surface, caps=(False, True))


def _features(hull: Hull, b: Build, o: Outfit, *, beard: float, glasses: float) -> None:
    """Add eyes with lids, brows, lips, ears and glasses."""
    size, base, ahead = frame(b)
    near = b.detail == 2
    for s in (1.0, -1.0):
        y = 0.148 * s
        if near:
            _patch(hull, b, o.hair, (y, 0.492), (0.078, 0.036), 0.004, bend=0.012)
        _patch(hull, b, o.eye, (y, 0.484), (0.060, 0.023), 0.010, bend=0.006)
        _patch(hull, b, o.pupil, (y * 0.99, 0.486), (0.025, 0.025), 0.016)
        _patch(hull, b, o.hair, (y * 1.02, 0.572), (0.085, 0.015 if not b.female else 0.010), 0.012, bend=0.02)
        ear = []
        for z, depth, out in (
            (0.315, 0.020, 0.0),
            (0.34, 0.045, 0.012),
            (0.42, 0.062, 0.035),
            (0.50, 0.075, 0.055),
            (0.55, 0.065, 0.050),
            (0.575, 0.03, 0.030),
        ):
            ear.append(
                [
                    (
                        ahead + size * (-0.055 + depth * c),
                        s * size * (0.318 + out * 0.6 + 0.024 * sn + out * 0.35 * (c < 0)),
                        base + z * size,
                    )
                    for c, sn in circle(8)
                ]
            )
        hull.sheet(np.array(ear), HEAD, o.skin, mirrored=s < 0, caps=(True, True))
        if near and glasses < 0.5:
            _patch(hull, b, o.pupil, (0.030 * s, 0.315), (0.016, 0.009), 0.004, sides=6)
    _patch(hull, b, o.lips, (0.0, 0.208), (0.085, 0.024), 0.016 if beard > 0.0 else 0.006, bend=-0.006, sides=12)
    if glasses > 0.5:
        _glasses(hull, b, o, dark=glasses > 1.5)


def _glasses(hull: Hull, b: Build, o: Outfit, *, dark: bool) -> None:
    size, base, ahead = frame(b)
    x = 0.475
    for s in (1.0, -1.0):

        def rim(k: float, back: float, s: float = s) -> list[tuple[float, float, float]]:
            return [
                (
                    ahead + size * (x - back - 0.10 * abs(0.15 + 0.10 * c * s * s)),
                    s * size * (0.155 + k * 0.115 * c),
                    base + size * (0.475 + k * 0.080 * sn),
                )
                for c, sn in circle(12)
            ]

        if dark:
            hull.sheet(np.array([rim(1.0, 0.0), rim(0.5, -0.005)]), HEAD, o.pupil, mirrored=s < 0, caps=(False, True))
        hull.sheet(
            np.array([rim(1.1, 0.01), rim(1.12, -0.008), rim(0.92, -0.008), rim(0.92, 0.01)]),
            HEAD,
            o.pupil,
            mirrored=s < 0,
        )
        bar = [
            [(ahead + size * u, s * size * w, base + size * (0.49 + t)) for t in (-0.012, 0.012)]
            for u, w in ((x - 0.04, 0.285), (0.2, 0.345), (-0.04, 0.352))
        ]
        hull.sheet(np.array(bar), HEAD, o.pupil, closed=False, mirrored=s < 0)
    bridge = [
        [(ahead + size * (x + 0.008), size * y, base + size * (0.495 + t)) for t in (-0.012, 0.012)]
        for y in (-0.045, 0.045)
    ]
    hull.sheet(np.array(bridge), HEAD, o.pupil, closed=False)
