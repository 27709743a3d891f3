"""Hair as volume, hats and helmets: shells around the skull, whose rim is an angle from the top of the head."""

from __future__ import annotations

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.meshes.builder import circle, noises
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.person.head import HEAD, frame
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import Outfit
from recipe_runtime.meshes.person.trunk import Build
from recipe_runtime.meshes.vectors import Array

CROPPED, SHORT, LONG, TIED, CAP, BEANIE, CYCLIST, FULL, CURLY, BOB, BALD = range(11)
"""Values of `shape["hair"]`: haircuts, a cap, a beanie, a bicycle helmet, a motorcycle helmet, more haircuts."""

_PEAK = (1.0, 0.5, 0.0, -0.5, -1.0)  # columns of the peak of a cap, shares of half its width
_CUTS = {  # thickness of the hair, degrees from the top to its rim in front, at the sides and behind
    CROPPED: (0.028, (50.0, 88.0, 116.0)),
    SHORT: (0.060, (47.0, 92.0, 120.0)),
    LONG: (0.060, (48.0, 112.0, 130.0)),
    TIED: (0.030, (47.0, 92.0, 120.0)),
    CAP: (0.035, (50.0, 94.0, 120.0)),
    BEANIE: (0.035, (50.0, 94.0, 120.0)),
    CYCLIST: (0.035, (50.0, 94.0, 120.0)),
    CURLY: (0.105, (48.0, 104.0, 124.0)),
    BOB: (0.075, (48.0, 124.0, 128.0)),
}


def add_hair(hull: Hull, b: Build, o: Outfit, style: int) -> None:
    """Add hair, and what is worn on the head."""
    if style in _CUTS:
        grow, rim = _CUTS[style]
        lump = {CURLY: 0.026, CROPPED: 0.004}.get(style, 0.012)
        _shell(hull, b, o.hair, grow, rim, lump, ragged=9.0 if style in (SHORT, CURLY) else 4.0)
    if style == BALD:
        _fringe(hull, b, o)
    if style == LONG:
        _falling(hull, b, o, -0.52, 0.14)
    if style == BOB:
        _falling(hull, b, o, 0.10, 0.10)
    if style == TIED:
        _tail(hull, b, o)
    if style == CAP:
        _cap(hull, b, o)
    elif style == BEANIE:
        _shell(hull, b, o.hat, 0.075, (60.0, 84.0, 100.0), 0.004)
        _shell(hull, b, o.hat, 0.095, (60.0, 84.0, 100.0), 0.0, from_row=0.75)
    elif style == CYCLIST:
        _cyclist(hull, b, o)
    elif style == FULL:
        _full(hull, b, o)


def _dome(b: Build, grow: float, rim: tuple[float, float, float], lump: float = 0.0, ragged: float = 0.0) -> Array:
    """Return the rings of a shell around the skull, from its rim upwards."""
    size, base, ahead = frame(b)
    rows, count = ((2, 8), (5, 16), (8, 28))[b.detail]
    front, side, rear = rim
    a, c1, c2 = (front + rear) / 4.0 + side / 2.0, (front - rear) / 2.0, (front + rear) / 4.0 - side / 2.0
    random = noises(int(grow * 1000) + 17, np.arange((rows + 1) * count)).reshape(rows + 1, count)
    found = []
    for k in range(rows + 1):
        ring = []
        t = k / rows
        for n, (c, s) in enumerate(circle(count)):
            limit = a + c1 * c + c2 * (2.0 * c * c - 1.0) + ragged * (1.0 - t) * float(random[0, n]) * (b.detail > 0)
            sine, cosine = exact.sin_cos_deg(limit * (1.0 - k / (rows + 0.3)))
            full = (0.35 + 0.65 * min(1.0, 2.5 * t)) if lump else 1.0  # hair is thinner at its rim
            g = grow * full + lump * float(random[k, n]) * (b.detail > 0)
            rx, ry, rz = 0.418 if c > 0 else 0.455, 0.345, 0.44 if cosine > 0 else 0.56
            ring.append(
                (
                    ahead + (rx + g) * size * sine * c,
                    (ry + g) * size * sine * s,
                    base + (0.56 + (rz + g) * cosine) * size,
                )
            )
        found.append(ring)
    return np.array(found)


def _strands(points: Array, base: float) -> Array:
    """Return uv of hair in metres: u around the head, v down from the crown."""
    ends = np.concatenate([points, points[:, :1]], axis=1)
    u = np.broadcast_to(np.arange(ends.shape[1]) * (0.6 / (ends.shape[1] - 1)), ends.shape[:2])
    return np.stack([u, ends[..., 2] - base], axis=-1)


def _shell(
    hull: Hull,
    b: Build,
    surface: Surface,
    grow: float,
    rim: tuple[float, float, float],
    lump: float,
    *,
    ragged: float = 0.0,
    from_row: float = 1.0,
) -> None:
    """Add a shell with a narrow edge that closes the gap to the skin; `from_row` cuts off what is above a share."""
    size, base, _ = frame(b)
    outer = _dome(b, grow, rim, lump, ragged)
    middle = outer[0].mean(axis=0)
    edge = outer[0] + (middle - outer[0]) * 0.14 + np.array([0.0, 0.0, 0.015 * size])
    closed = from_row == 1.0
    kept = outer if closed else outer[: max(2, int(len(outer) * (1.0 - from_row) + 0.5) + 1)]
    points = np.concatenate([edge[None], kept])
    hull.sheet(points, HEAD, surface, uv=_strands(points, base), caps=(False, closed))


def _fringe(hull: Hull, b: Build, o: Outfit) -> None:
    """Add the ring of hair of a bald man, around the back of the head."""
    size, base, ahead = frame(b)
    half = [exact.sin_cos_deg(75.0 + 210.0 * n / 12) for n in range(13)]
    sections = ((0.24, 0.004, 0.75), (0.30, 0.03, 0.86), (0.42, 0.035, 0.98), (0.56, 0.032, 1.0), (0.66, 0.004, 0.985))
    rows = [
        [(ahead + (0.455 + g) * size * c * k, (0.345 + g) * size * s * k, base + z * size) for s, c in half]
        for z, g, k in sections
    ]
    hull.sheet(np.array(rows), HEAD, o.hair, closed=False)


def _falling(hull: Hull, b: Build, o: Outfit, low: float, wave: float) -> None:
    """Add hair that falls beside the face and behind the neck, down to a height `low` (of the head)."""
    size, base, ahead = frame(b)
    count, rows = ((7, 3), (13, 5), (21, 8))[b.detail]
    random = noises(91, np.arange(count * (rows + 1))).reshape(rows + 1, count)
    shoulder = Weights(("head", "torso"), np.zeros(2))
    outer, inner, shares = [], [], []
    for k in range(rows + 1):
        t = k / rows
        z = 0.66 + (low - 0.66) * t
        line, inside = [], []
        for n in range(count):
            s, c = exact.sin_cos_deg(66.0 + 228.0 * n / (count - 1))
            drop = 0.10 * (1.0 - abs(2.0 * n / (count - 1) - 1.0)) if low < 0.0 else 0.0
            out = (
                1.0
                + 0.05 * t * wave / 0.1 * (1.0 if low > 0 else 0.3)
                + 0.07 * float(random[k, n]) * (0.3 + t) * (b.detail > 0)
            )
            close = 1.0 if low > 0.0 else 1.0 - 0.12 * t * (c < -0.3)
            x, y = (
                (0.50 if c < 0 else 0.42) * c * out * close,
                0.41 * s * out * (1.0 - (0.18 * t if low < 0 else 0.05 * t)),
            )
            place = (ahead + size * (x - (0.06 * t if low < 0 else 0.0)), size * y, base + size * (z - drop * t))
            line.append(place)
            inside.append((ahead + (place[0] - ahead) * 0.86, place[1] * 0.84, place[2] + 0.01 * size))
        outer.append(line)
        inner.append(inside)
        shares.append([1.0 - 0.55 * max(0.0, t - 0.4), 0.55 * max(0.0, t - 0.4)])
    weights = Weights(shoulder.names, np.array(shares)[:, None, :])
    points = np.array(outer)
    uv = np.stack(
        [np.broadcast_to(np.arange(count) * (0.4 / (count - 1)), points.shape[:2]), points[..., 2] - base], axis=-1
    )
    hull.sheet(points, weights, o.hair, uv=uv, closed=False, mirrored=True)
    hull.sheet(np.array(inner), weights, o.hair, uv=uv, closed=False)
    hem = Weights(weights.names, weights.shares[-1:])
    hull.sheet(np.array([outer[-1], inner[-1]]), hem, o.hair, closed=False, mirrored=True)
    for column in (0, -1):
        strip = np.stack([points[:, column], np.array(inner)[:, column]], axis=1)
        hull.sheet(strip, weights, o.hair, closed=False, mirrored=column == -1)


def _tail(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a ponytail."""
    size, base, ahead = frame(b)
    path = (
        (-0.44, 0.72, 0.07),
        (-0.56, 0.73, 0.10),
        (-0.66, 0.66, 0.12),
        (-0.70, 0.50, 0.125),
        (-0.68, 0.30, 0.11),
        (-0.64, 0.10, 0.08),
        (-0.62, -0.02, 0.02),
    )
    sides = (5, 8, 12)[b.detail]
    rows = [
        [(ahead + size * (x + 0.8 * r * c), size * r * s, base + size * (z + 0.5 * r * c)) for c, s in circle(sides)]
        for x, z, r in path
    ]
    hull.sheet(np.array(rows), HEAD, o.hair, mirrored=True, caps=(True, True))


def _cap(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a cap with a peak."""
    size, base, ahead = frame(b)
    _shell(hull, b, o.hat, 0.065, (62.0, 74.0, 88.0), 0.0)
    z = base + 0.745 * size
    rows = [
        [(ahead + x * size, k * w * size, z - (0.10 * (x - 0.36) + 0.5 * k * k * w * w) * size) for k in _PEAK]
        for x, w in ((0.34, 0.36), (0.55, 0.32), (0.72, 0.23), (0.80, 0.10))
    ]
    peak = np.array(rows)
    hull.sheet(peak, HEAD, o.hat, closed=False, mirrored=True)
    hull.sheet(peak - [0.0, 0.0, 0.014 * size], HEAD, o.hat, closed=False)


def _cyclist(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a bicycle helmet, longer behind, with dark vents."""
    _, base, ahead = frame(b)
    dome = _dome(b, 0.12, (64.0, 74.0, 84.0))
    dome[..., 0] = ahead + (dome[..., 0] - ahead) * 1.06
    rows, count = dome.shape[:2]
    cells = [[o.hat] * count for _ in range(rows)]
    for row in range(2, rows - 1):
        for k in range(0, count, 4):
            cells[row][(k + 1) % count] = o.pupil
    middle = dome[0].mean(axis=0)
    points = np.concatenate([(dome[0] + (middle - dome[0]) * 0.15)[None], dome])
    hull.sheet(points, HEAD, cells, uv=_strands(points, base), caps=(False, True))


def _full(hull: Hull, b: Build, o: Outfit) -> None:
    """Add a full-face motorcycle helmet with a dark visor."""
    size, base, ahead = frame(b)
    sections = (
        (-0.06, 0.34, 0.28, 0.31), (0.02, 0.50, 0.38, 0.40), (0.10, 0.54, 0.44, 0.43), (0.26, 0.57, 0.52, 0.465),
        (0.36, 0.555, 0.555, 0.48),
        (0.50, 0.545, 0.57, 0.485), (0.64, 0.525, 0.57, 0.48), (0.76, 0.49, 0.55, 0.465), (0.90, 0.40, 0.46, 0.40),
        (1.00, 0.29, 0.34, 0.30),
        (1.06, 0.17, 0.20, 0.17), (1.085, 0.05, 0.06, 0.05),
    )  # fmt: skip
    count = (8, 16, 24)[b.detail]
    rows = [
        [(ahead + (front if c > 0 else back) * size * c, wide * size * s, base + z * size) for c, s in circle(count)]
        for z, front, back, wide in sections
    ]
    cells = [[o.hat] * count for _ in range(len(sections) - 1)]
    open_ = count // 4
    for row in (4, 5, 6):
        cells[row] = [o.pupil] * open_ + [o.hat] * (count - 2 * open_) + [o.pupil] * open_
    hull.sheet(np.array(rows), HEAD, cells, caps=(True, True))
