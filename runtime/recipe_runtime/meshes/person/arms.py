"""Arms and hands of a person: sleeves that continue the top, bare skin below short ones, and fingers near by."""

from __future__ import annotations

import numpy as np

from recipe_runtime.meshes.builder import circle
from recipe_runtime.meshes.curves import smooth
from recipe_runtime.meshes.person.hull import Hull, Weights
from recipe_runtime.meshes.person.outfit import HOOD, OPEN, Outfit
from recipe_runtime.meshes.person.trunk import ACROMION, ARMHOLE, ARMPIT, Build, height, ramp
from recipe_runtime.meshes.vectors import Array, Index

# Distance below the shoulder joint, then half depth and half width; fractions of the height. The elbow is at 0.172.
_DEPTH = ((0.03, 0.031), (0.06, 0.0305), (0.10, 0.0285), (0.14, 0.0255), (0.172, 0.0245), (0.20, 0.0245),
    (0.24, 0.0225),
          (0.29, 0.0185), (0.325, 0.0150), (0.34, 0.0145))  # fmt: skip
_WIDTH = ((0.03, 0.028), (0.06, 0.0275), (0.10, 0.0260), (0.14, 0.0235), (0.172, 0.0225), (0.20, 0.0235),
    (0.24, 0.0205),
          (0.29, 0.0160), (0.325, 0.0120), (0.34, 0.0115))  # fmt: skip
_WRIST = 0.325


def sleeve_columns(b: Build) -> int:
    """Return the number of columns of an arm's rings."""
    side, rows = ARMHOLE[b.detail]
    return 2 * (2 * side + rows)


def shoulder_ring(b: Build, o: Outfit, turn: float, count: int) -> Array:
    """Return a ring of the left shoulder, which bends from the armhole (turn 0) down into the arm (turn 1)."""
    f = b.figure
    h, thick = f.height, 0.004 if o.top in (HOOD, OPEN) or o.coat > 0.0 else 0.0
    fold = 0.008 * h  # radius about which the armpit bends, so that no triangle is flat
    low, high = height(f, ARMPIT), height(f, ACROMION)
    inner = f.shoulder - 0.021 * h
    begin, end = (high - low) / 2.0, (_half(b, _WIDTH, 0.05) - 0.0015 + 0.5 * thick) * h
    radius = begin + (end - begin) * turn
    depth = (0.031 + (_half(b, _DEPTH, 0.05) + 0.006 + thick - 0.031) * turn) * h
    sine, cosine = circle(1, 90.0 * turn)[0][::-1]
    rows = []
    for c, s in circle(count):
        away = fold + radius * (1.0 + c) * (1.0 - 0.10 * sine * cosine * (1.0 + c))
        rows.append((-depth * s - 0.004 * h, inner + away * sine, low - fold + away * cosine))
    return np.array(rows)


def _half(b: Build, table: tuple[tuple[float, float], ...], down: float) -> float:
    girth = 0.5 + 0.5 * b.figure.girth
    return smooth(table, down) * girth * (1.0 - 0.10 * b.female)


def add_arm(hull: Hull, b: Build, o: Outfit, side: str, s: float, edge: Index) -> None:
    """Add an arm of the `side`; s is 1 on the left, -1 on the right; `edge` numbers the vertices of the armhole."""
    count = sleeve_columns(b)
    turns = ((0.0, 1.0), (0.0, 0.3, 0.65, 1.0), (0.0, 0.15, 0.32, 0.5, 0.7, 0.87, 1.0))[b.detail]
    rings = [shoulder_ring(b, o, t, count) for t in turns]
    moved = list(turns)
    end = _WRIST - 0.004 if o.long else 0.105
    ease = 0.0085 if o.top in (HOOD, OPEN) or o.coat > 0.0 else 0.005
    long = (
        (0.172, 0.23),
        (0.10, 0.135, 0.16, 0.185, 0.215, 0.265),
        (0.085, 0.11, 0.135, 0.155, 0.172, 0.19, 0.21, 0.24, 0.275, 0.305),
    )[b.detail]
    for down in (*(d for d in long if d < end - 0.015), end):
        flare = 0.004 if not o.long and down == end else 0.003 * max(0.0, (down - 0.26) / 0.06)
        rings.append(_ring(b, down, ease + flare, count, shift=max(0.0, (0.15 - down) / 0.10)))
        moved.append(1.0)
    sleeve = np.stack(rings) * (1.0, s, 1.0)
    shoulder = np.array([min(1.0, 0.08 + 0.95 * t) for t in moved])
    hull.sheet(sleeve, _weights(b, side, sleeve, shoulder), o.shirt, welds={0: edge}, mirrored=s > 0)
    hem = np.stack([sleeve[-1], sleeve[-1] + (sleeve[-1].mean(axis=0) - sleeve[-1]) * 0.3 + (0.0, 0.0, 0.003)])
    hull.sheet(hem, _weights(b, side, hem, np.ones(2)), o.shirt, mirrored=s > 0)
    begin = end - 0.02
    downs = [begin, *(d for d in long if d > begin + 0.02), 0.30, _WRIST, 0.335]
    if o.long:
        downs = [begin, _WRIST, 0.335]
    bare = np.stack([_ring(b, d, 0.0, count) for d in sorted(set(downs))]) * (1.0, s, 1.0)
    numbers = hull.sheet(bare, _weights(b, side, bare, np.ones(len(bare))), o.skin, mirrored=s > 0)
    add_hand(hull, b, o, side, s, bare[-1], numbers[-1])


def _ring(b: Build, down: float, ease: float, count: int, shift: float = 0.0) -> Array:
    """Return a level ring of the left arm, at a distance below the shoulder joint."""
    f = b.figure
    h = f.height
    depth, width = (_half(b, _DEPTH, down) + ease) * h, (_half(b, _WIDTH, down) + ease) * h
    z = f.shoulders - down * h
    y = f.shoulder + 0.006 * shift * h
    away = (down - 0.15) / 0.15
    bow = -0.004 * h * (1.0 - away * away)
    return np.array([(-depth * s + bow, y + width * c, z) for c, s in circle(count)])


def _weights(b: Build, side: str, points: Array, shoulder: Array) -> Weights:
    f = b.figure
    elbow = f.shoulders - f.upper_arm
    lower = ramp(-points[..., 2], -elbow - 0.028 * f.height, -elbow + 0.028 * f.height)
    arm = np.broadcast_to(shoulder[:, None], lower.shape)
    shares = np.stack([1.0 - arm, arm * (1.0 - lower), arm * lower], axis=-1)
    return Weights(("torso", f"upper_arm_{side}", f"forearm_{side}"), shares)


def add_hand(hull: Hull, b: Build, o: Outfit, side: str, s: float, wrist: Array, numbers: Index) -> None:
    """Add a hand that continues the wrist: a palm, a thumb, and fingers near by; a closed shape farther away."""
    f = b.figure
    h, count = f.height, len(wrist)
    grip = Weights.whole(f"forearm_{side}")
    base = f.shoulders

    def ring(down: float, depth: float, width: float, x: float, y: float = 0.0) -> Array:
        points = [
            (x * h - depth * h * sn, f.shoulder + y * h + width * h * c, base - down * h) for c, sn in circle(count)
        ]
        return np.array(points) * (1.0, s, 1.0)

    palm = [
        ring(0.352, 0.0185, 0.0105, 0.002),
        ring(0.372, 0.0235, 0.0110, 0.004),
        ring(0.388, 0.0240, 0.0095, 0.005, -0.001),
    ]
    if b.detail == 0:
        rows = [palm[1], ring(0.42, 0.016, 0.009, 0.006, -0.004)]
    elif b.detail == 1:
        rows = [
            *palm[:2],
            ring(0.395, 0.0225, 0.0095, 0.005, -0.002),
            ring(0.42, 0.0165, 0.009, 0.006, -0.007),
            ring(0.435, 0.008, 0.005, 0.006, -0.011),
        ]
    else:
        rows = [*palm, ring(0.393, 0.021, 0.007, 0.005, -0.001)]
    points = np.stack([wrist, *rows])
    hull.sheet(points, grip, o.skin, welds={0: numbers}, mirrored=s > 0, caps=(False, True))
    if b.detail == 0:
        return
    sides = 6
    fingers = [((0.352, 0.016, 0.0), (0.372, 0.031, -0.006), (0.392, 0.035, -0.012), (0.403, 0.036, -0.014), 0.0075)]
    if b.detail == 2:
        fingers += [
            (
                (0.385, x, -0.001),
                (0.385 + 0.33 * n, x + 0.001, -0.004),
                (0.385 + 0.72 * n, x, -0.011),
                (0.385 + n, x, -0.018),
                0.0062,
            )
            for x, n in ((0.022, 0.050), (0.010, 0.056), (-0.002, 0.052), (-0.013, 0.042))
        ]
    for *path, radius in fingers:
        tube = []
        for k, (down, x, y) in enumerate(path):
            r = radius * h * (1.0, 1.0, 0.9, 0.45)[k]
            tube.append(
                [(x * h + r * c, (f.shoulder + y * h + r * sn) * s, base - down * h) for c, sn in circle(sides)]
            )
        hull.sheet(np.array(tube), grip, o.skin, mirrored=s > 0, caps=(False, True))
