"""Heads: a skull with a face, several haircuts, caps and helmets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from recipe_compiler.ir import exact

from recipe_runtime.body.skeleton import Figure
from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.lofts import loft
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.vectors import Array

_SIDES = 14
CROPPED, SHORT, LONG, TIED, CAP, BEANIE, CYCLIST, FULL = range(8)
"""Values of `shape["hair"]`: four haircuts, a cap, a beanie, a bicycle helmet and a motorcycle helmet."""

_Section = tuple[float, float, float, float]  # z, front and back half depth, half width; fractions of the head's height
_SKULL: tuple[_Section, ...] = (  # above the joint
    (0.015, 0.20, 0.20, 0.16),
    (0.06, 0.33, 0.22, 0.225),
    (0.13, 0.385, 0.25, 0.275),
    (0.22, 0.395, 0.29, 0.305),
    (0.34, 0.40, 0.36, 0.335),
    (0.46, 0.405, 0.42, 0.352),
    (0.56, 0.405, 0.45, 0.358),
    (0.66, 0.415, 0.455, 0.355),
    (0.77, 0.385, 0.43, 0.332),
    (0.87, 0.315, 0.355, 0.275),
    (0.95, 0.20, 0.23, 0.175),
    (0.99, 0.08, 0.09, 0.07),
)


@dataclass(frozen=True)
class PersonSurfaces:
    """The surfaces of a person."""

    skin: Surface
    hair: Surface
    lips: Surface
    eye: Surface
    pupil: Surface
    hat: Surface
    shirt: Surface
    trousers: Surface
    shoes: Surface
    bag: Surface

    @classmethod
    def of(cls, tag: int) -> PersonSurfaces:
        """Return the surfaces with a semantic tag."""
        return cls(
            Surface("skin", Pattern.SKIN, tag),
            Surface("hair", Pattern.HAIR, tag),
            Surface("lips", Pattern.SKIN, tag),
            Surface("eye", Pattern.SKIN, tag),
            Surface("pupil", Pattern.PLAIN, tag),
            Surface("hat", Pattern.CLOTH, tag),
            Surface("shirt", Pattern.CLOTH, tag),
            Surface("trousers", Pattern.CLOTH, tag),
            Surface("shoes", Pattern.RUBBER, tag),
            Surface("bag", Pattern.CLOTH, tag),
        )


def head(b: Builder, f: Figure, s: PersonSurfaces, hair: int) -> None:
    """Add a head, in the frame of its neck joint."""
    size, base = 0.142 * f.height * f.head, 0.022 * f.height
    b.grid(s.skin, _rings(_SKULL, size, base), crease=-1.0, caps=(s.skin, s.skin))
    _face(b, s, size, base)
    dress = _HATS.get(hair)
    if dress is None or hair == CAP:
        _hair(b, s, hair, size, base)
    if dress is not None:
        dress(b, s, size, base)


def _rings(sections: Sequence[_Section], size: float, base: float) -> Array:
    return np.array(
        [
            [((front if c > 0 else back) * size * c, width * size * s, base + z * size) for c, s in circle(_SIDES)]
            for z, front, back, width in sections
        ]
    )


def _on_face(y: float, z: float, size: float, base: float, out: float) -> tuple[float, float, float]:
    """Return a point on the face at y and z (fractions of the head), `out` in front of the skin."""
    front, width = _at(z)
    share = max(0.0, 1.0 - (y / width) * (y / width))
    return ((front * float(np.sqrt(share)) + out) * size, y * size, base + z * size)


def _at(z: float) -> tuple[float, float]:
    for (z0, f0, _, w0), (z1, f1, _, w1) in pairwise(_SKULL):
        if z <= z1:
            t = (z - z0) / (z1 - z0)
            return f0 + (f1 - f0) * t, w0 + (w1 - w0) * t
    return _SKULL[-1][1], _SKULL[-1][3]


def _face(b: Builder, s: PersonSurfaces, size: float, base: float) -> None:
    """Add nose, eyes, brows, mouth and ears: enough to recognise the front and the direction of gaze."""

    def patch(surface: Surface, y: float, z: float, wide: float, tall: float, out: float, tilt: float = 0.0) -> None:
        ring = []
        for c, sn in circle(6):
            ring.append(_on_face(y + wide * c, z + tall * sn + tilt * wide * c, size, base, out))
        middle = np.mean(np.array(ring), axis=0)
        points = np.concatenate([np.array(ring), middle[None]])
        faces = np.array([(6, k, (k + 1) % 6) for k in range(6)])
        b.smooth(surface, points, faces, -1.0)

    for side in (1.0, -1.0):
        y = side * 0.145
        patch(s.eye, y, 0.49, 0.062, 0.028, 0.012)
        patch(s.pupil, y * 0.98, 0.49, 0.027, 0.029, 0.018)
        patch(s.hair, y * 1.02, 0.575, 0.085, 0.014, 0.022, 0.03 * side)
        ear = [
            (base + z * size, 0.05 * size * k, 0.03 * size, -0.03 * size)
            for z, k in ((0.36, 0.6), (0.44, 1.0), (0.54, 1.1))
        ]
        loft(b, s.skin, ear, y=side * 0.355 * size, sides=6, domes=1)
    patch(s.lips, 0.0, 0.205, 0.095, 0.024, 0.012)
    x, z = 0.40 * size, base + 0.40 * size
    tip, bridge = (x + 0.125 * size, 0.0, z - 0.06 * size), (x - 0.005 * size, 0.0, z + 0.13 * size)
    under = (x + 0.02 * size, 0.0, z - 0.105 * size)
    left, right = (x - 0.03 * size, 0.075 * size, z - 0.085 * size), (x - 0.03 * size, -0.075 * size, z - 0.085 * size)
    faces = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 4), (0, 4, 3)])
    b.smooth(s.skin, np.array([tip, bridge, left, right, under]), faces, 0.1)


def _dome(size: float, base: float, grow: float, rim: tuple[float, float, float], rows: int = 5) -> Array:
    """Return the rings of a shell around the skull, from its rim upwards.

    Args:
        size: Height of the head, metres.
        base: Height of the skull above the joint, metres.
        grow: Distance of the shell from the skull.
        rim: Angle from the top to the rim in front, at the sides and behind, degrees.
        rows: Number of rings.
    """
    front, side, rear = rim
    a, c1, c2 = (front + rear) / 4.0 + side / 2.0, (front - rear) / 2.0, (front + rear) / 4.0 - side / 2.0
    found = []
    for k in range(rows + 1):
        ring = []
        for n in range(_SIDES):
            c, s = circle(1, 360.0 * n / _SIDES)[0]
            limit = a + c1 * c + c2 * (2.0 * c * c - 1.0)
            sine, cosine = exact.sin_cos_deg(limit * (1.0 - k / (rows + 0.35)))
            rx, ry, rz = 0.425 if c > 0 else 0.462, 0.362, 0.445 if cosine > 0 else 0.56
            x, y = (rx + grow) * size * sine * c, (ry + grow) * size * sine * s
            ring.append((x, y, base + (0.56 + (rz + grow) * cosine) * size))
        found.append(ring)
    return np.array(found)


def _shell(b: Builder, surface: Surface, outer: Array, size: float) -> None:
    """Add a dome and a narrow edge that closes the gap to the skin."""
    middle = outer[0].mean(axis=0)
    edge = outer[0] + (middle - outer[0]) * 0.12 + np.array([0.0, 0.0, 0.012 * size])
    b.grid(surface, np.concatenate([edge[None], outer]), crease=-1.0, caps=(None, surface))


def _hair(b: Builder, s: PersonSurfaces, hair: int, size: float, base: float) -> None:
    """Add hair that leaves the face free; long hair covers the neck."""
    grow, rim = {
        CROPPED: (0.038, (54.0, 92.0, 118.0)),
        LONG: (0.07, (52.0, 112.0, 128.0)),
        TIED: (0.03, (50.0, 94.0, 122.0)),
    }.get(hair, (0.055, (50.0, 96.0, 122.0)))
    _shell(b, s.hair, _dome(size, base, grow, rim), size)
    if hair == LONG:
        falls = [(-0.42, 0.10, 0.27), (-0.2, 0.14, 0.35), (0.1, 0.19, 0.40), (0.5, 0.20, 0.41), (0.72, 0.15, 0.35)]
        loft(b, s.hair, [(base + z * size, rx * size, ry * size, -0.27 * size) for z, rx, ry in falls])
    if hair == TIED:
        bun = [(0.62, 0.08, 0.08), (0.70, 0.16, 0.16), (0.78, 0.17, 0.17), (0.86, 0.10, 0.10)]
        loft(b, s.hair, [(base + z * size, rx * size, ry * size, -0.56 * size) for z, rx, ry in bun])


def _cap(b: Builder, s: PersonSurfaces, size: float, base: float) -> None:
    """Add a cap with a peak."""
    _shell(b, s.hat, _dome(size, base, 0.075, (64.0, 74.0, 84.0)), size)
    z = base + 0.735 * size
    peak = [[(x * size, y * size, z - 0.10 * size * (x - 0.36)) for y in (w, w / 2, 0.0, -w / 2, -w)]
            for x, w in ((0.36, 0.34), (0.55, 0.31), (0.72, 0.22), (0.80, 0.10))]  # fmt: skip
    rows = np.array(peak)
    b.grid(s.hat, rows[:, ::-1], closed=False, crease=-1.0)
    b.grid(s.hat, rows - [0.0, 0.0, 0.012 * size], closed=False, crease=-1.0)


def _beanie(b: Builder, s: PersonSurfaces, size: float, base: float) -> None:
    """Add a beanie with a turned-up brim."""
    _shell(b, s.hat, _dome(size, base, 0.085, (62.0, 84.0, 100.0)), size)
    _hair(b, s, CROPPED, size, base)


def _cyclist(b: Builder, s: PersonSurfaces, size: float, base: float) -> None:
    """Add a bicycle helmet, longer behind, with dark vents and a strap."""
    _hair(b, s, CROPPED, size, base)
    dome = _dome(size, base, 0.13, (66.0, 74.0, 84.0))
    dome[..., 0] *= 1.06
    cells = [[s.hat] * _SIDES for _ in range(len(dome))]
    for row in (2, 3, 4):
        for k in (1, 12, 3, 10, 7):
            cells[row + 1][k] = s.pupil
    middle = dome[0].mean(axis=0)
    edge = dome[0] + (middle - dome[0]) * 0.15
    b.grid(cells, np.concatenate([edge[None], dome]), crease=-1.0, caps=(None, s.hat))


def _full(b: Builder, s: PersonSurfaces, size: float, base: float) -> None:
    """Add a full-face motorcycle helmet with a dark visor."""
    sections = (
        (-0.02, 0.36, 0.30, 0.34), (0.10, 0.52, 0.42, 0.43), (0.26, 0.57, 0.52, 0.47), (0.36, 0.56, 0.555, 0.485),
        (0.62, 0.53, 0.57, 0.485), (0.74, 0.50, 0.56, 0.475), (0.92, 0.40, 0.46, 0.40), (1.04, 0.26, 0.30, 0.27),
        (1.10, 0.10, 0.12, 0.11),
    )  # fmt: skip
    cells = [[s.hat] * _SIDES for _ in range(len(sections) - 1)]
    for row in (3, 4):
        cells[row][:4] = cells[row][-4:] = [s.pupil] * 4
    b.grid(cells, _rings(sections, size, base), crease=-1.0, caps=(s.hat, s.hat))


_HATS = {CAP: _cap, BEANIE: _beanie, CYCLIST: _cyclist, FULL: _full}
