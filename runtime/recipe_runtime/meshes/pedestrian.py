"""Pedestrians: thirteen rigid parts lofted from cross-sections; at a joint, both parts end with the same radius."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from recipe_runtime.body.skeleton import Figure, Joint
from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.heads import PersonSurfaces, head
from recipe_runtime.meshes.lofts import Section, loft, rings, tube
from recipe_runtime.meshes.mesh import Mesh, Surface

_SHORTS, _TROUSERS, _SKIRT = 0, 1, 2
_BACKPACK, _SATCHEL = 1, 2
_TWINS = ("upper_arm", "thigh", "shin", "foot")  # limbs that are equal on both sides
_FLARE, _HEM = 0.150, 0.37  # skirts: half depth at the hem, and height of the hem, as fractions of the person's height


def pedestrian_parts(shape: Mapping[str, float], tag: int) -> tuple[tuple[str, Mesh], ...]:
    """Return the base part `pelvis`, then the parts of `Figure.joints` in order, each in the frame of its joint."""
    figure, clothes = Figure.of(shape), PersonSurfaces.of(tag)
    return (("pelvis", _pelvis(figure, clothes, shape, 0.0)), *_limbs(figure, clothes, shape, figure.joints))


def rider_parts(shape: Mapping[str, float], tag: int, joints: Sequence[Joint]) -> list[tuple[str, Mesh]]:
    """Return the parts of a rider.

    Args:
        shape: The blueprint's shape.
        tag: CARLA's semantic tag.
        joints: The joints of the rider, the pelvis first.

    Returns:
        `pelvis`, with its origin between the hips, then the other parts.
    """
    figure, clothes = Figure.of(shape), PersonSurfaces.of(tag)
    return [("pelvis", _pelvis(figure, clothes, shape, figure.hip)), *_limbs(figure, clothes, shape, joints[1:])]


def _limbs(
    figure: Figure, clothes: PersonSurfaces, shape: Mapping[str, float], joints: Sequence[Joint]
) -> list[tuple[str, Mesh]]:
    made: dict[str, Mesh] = {}
    for joint in joints:
        kind, _, side = joint.part.rpartition("_")
        if kind in _TWINS and f"{kind}_left" in made:
            made[joint.part] = made[f"{kind}_left"]
            continue
        b, long, legs = Builder(), shape["sleeves"] > 0, int(shape["legs"])
        if joint.part == "torso":
            _torso(b, figure, clothes, shape)
        elif joint.part == "head":
            head(b, figure, clothes, int(shape["hair"]))
        elif kind == "upper_arm":
            _upper_arm(b, figure, clothes, long)
        elif kind == "forearm":
            _forearm(b, figure, clothes, long, 1.0 if side == "left" else -1.0)
        elif kind == "thigh":
            _thigh(b, figure, clothes, legs)
        elif kind == "shin":
            _shin(b, figure, clothes, legs)
        else:
            _foot(b, figure, clothes, legs)
        made[joint.part] = b.mesh()
    return list(made.items())


def _scaled(rows: Sequence[Section], h: float, g: float) -> list[Section]:
    return [(z * h, rx * h * g, ry * h * g, cx * h) for z, rx, ry, cx in rows]


def _pelvis(f: Figure, c: PersonSurfaces, shape: Mapping[str, float], down: float) -> Mesh:
    """Return the hips, with skirts and coat tails. The origin of the base part is `down` metres above the ground."""
    h, g, coat = f.height, f.girth, shape["coat"]
    b = Builder()
    rows = [
        (-0.052, 0.047, 0.062, 0.0),
        (-0.03, 0.060, 0.087, -0.002),
        (0.0, 0.064, 0.094, -0.005),
        (0.03, 0.057, 0.086, -0.003),
        (0.07, 0.048, 0.072, 0.0),
    ]
    hip = f.hip - down
    loft(b, c.trousers, [(z + hip, rx, ry, cx) for z, rx, ry, cx in _scaled(rows, h, g)], square=0.06, sides=12)
    if shape["legs"] == _SKIRT:
        hem = (hip - (0.52 - _HEM) * h, _FLARE * h, 0.118 * h * max(g, 1.0), 0.0)
        _skirt(b, c.trousers, [hem, (hip - 0.07 * h, 0.098 * h * g, 0.109 * h * g, 0.0)], h, g, hip)
    if coat > 0.0:
        tail = (hip - coat, 0.080 * h * g + 0.24 * coat, 0.108 * h * g + 0.06 * coat, 0.0)
        _skirt(b, c.shirt, [tail], h, g * 1.07, hip)
    return b.mesh()


def _skirt(b: Builder, surface: Surface, hem: list[Section], h: float, g: float, hip: float) -> None:
    """Add cloth from the waist to the hem, open below and visible from inside."""
    sections = [*hem, (hip, 0.070 * h * g, 0.099 * h * g, 0.0), (hip + 0.04 * h, 0.058 * h * g, 0.084 * h * g, 0.0)]
    outside = rings(sections, square=0.04, sides=14)
    b.grid(surface, outside, crease=-1.0)
    b.grid(surface, outside[:2, ::-1] * [0.97, 0.97, 1.0], crease=-1.0)


def _torso(b: Builder, f: Figure, c: PersonSurfaces, shape: Mapping[str, float]) -> None:
    """Add a shirt or coat from the hips to the collar, and the neck.

    Heights are fractions from hip (0.52) to neck (0.836).
    """
    h, g, w = f.height, f.girth, f.shoulder / f.height
    belly, k = max(0.0, g - 1.0), (f.neck - f.hip) / (0.316 * h)
    rows = [
        (0.532, 0.071 * g, 0.100 * g, -0.004),
        (0.555, 0.068 * g + 0.01 * belly, 0.094 * g, -0.002),
        (0.60, 0.061 * g + 0.04 * belly, 0.084 * g, 0.002 + 0.03 * belly),
        (0.65, 0.061 * g + 0.03 * belly, 0.083 * g, 0.003 + 0.02 * belly),
        (0.70, 0.065 * g, 0.089 * g, 0.003),
        (0.74, 0.066 * g, 0.80 * w + 0.014, 0.001),
        (0.77, 0.061, 0.94 * w + 0.014, -0.003),
        (0.793, 0.053, 1.03 * w + 0.010, -0.005),
        (0.811, 0.045, 0.98 * w + 0.004, -0.006),
        (0.824, 0.038, 0.68 * w, -0.007),
        (0.836, 0.034, 0.40 * w, -0.005),
        (0.846, 0.030, 0.031, -0.003),
    ]
    up = [((z - 0.52) * k * h + f.hip - f.chest, rx * h, ry * h, cx * h) for z, rx, ry, cx in rows]
    outside = rings(up, square=0.05, sides=14)
    b.grid(c.shirt, outside, crease=-1.0)
    b.fan(c.shirt, outside[0][::-1])
    neck = [(-0.036, 0.030, 0.030, -0.004), (0.0, 0.029, 0.028, -0.002), (0.04, 0.030, 0.029, 0.003)]
    loft(b, c.skin, [(z * h + f.neck - f.chest, rx * h, ry * h, cx * h) for z, rx, ry, cx in neck], domes=0)
    bag, shoulders = int(shape["bag"]), f.shoulders - f.chest
    if bag == _BACKPACK:
        sack = [
            (-0.20, 0.035, 0.058),
            (-0.17, 0.046, 0.075),
            (-0.10, 0.050, 0.078),
            (-0.03, 0.044, 0.072),
            (0.0, 0.03, 0.055),
        ]
        loft(b, c.bag, [(z * h + shoulders, rx * h, ry * h, -0.094 * h * g) for z, rx, ry in sack], square=0.12)
        for s in (1.0, -1.0):
            front = [(-0.05, 0.02), (-0.004, 0.034), (0.054, -0.012), (0.070 * g, -0.08), (0.052 * g, -0.17)]
            tube(b, c.bag, [(x * h, s * 0.055 * h, z * h + shoulders) for x, z in front], 0.008 * h, 6)
    elif bag == _SATCHEL:
        sack = [(-0.31, 0.048, 0.016), (-0.29, 0.055, 0.024), (-0.22, 0.053, 0.024), (-0.20, 0.046, 0.016)]
        loft(b, c.bag, [(z * h + shoulders, rx * h, ry * h, 0.0) for z, rx, ry in sack], y=0.118 * h * g, square=0.15)


_ELBOW, _KNEE = 0.0232, 0.0322  # radii of the joints, as fractions of the height


def _upper_arm(b: Builder, f: Figure, c: PersonSurfaces, long: bool) -> None:
    h, g = f.height, 0.5 + 0.5 * f.girth
    arm = [
        (-0.172, _ELBOW, _ELBOW, 0.0),
        (-0.13, 0.0250, 0.0245, 0.0),
        (-0.08, 0.0280, 0.0270, 0.0),
        (-0.035, 0.0295, 0.0275, 0.0),
        (-0.008, 0.0250, 0.0215, 0.0),
    ]
    wide = 1.12 if long else 1.0
    loft(b, c.shirt if long else c.skin, _scaled(arm if long else arm[:-2], h, g * wide))
    if not long:
        sleeve = [(-0.095, 0.036, 0.035, 0.0), (-0.035, 0.0335, 0.031, 0.0), (-0.008, 0.027, 0.023, 0.0)]
        loft(b, c.shirt, _scaled(sleeve, h, g), domes=1)


def _forearm(b: Builder, f: Figure, c: PersonSurfaces, long: bool, side: float) -> None:
    h, g = f.height, 0.5 + 0.5 * f.girth
    arm = [
        (-0.145, 0.0150, 0.0128, 0.0),
        (-0.10, 0.0190, 0.0180, 0.0),
        (-0.05, 0.0228, 0.0222, 0.0),
        (0.0, _ELBOW, _ELBOW, 0.0),
    ]
    if long:
        arm[0] = (-0.142, 0.0195, 0.0180, 0.0)
    loft(b, c.shirt if long else c.skin, _scaled(arm, h, g * (1.12 if long else 1.0)))
    hand = [
        (-0.238, 0.0100, 0.0065, 0.009),
        (-0.220, 0.0175, 0.0095, 0.007),
        (-0.195, 0.0215, 0.0115, 0.003),
        (-0.172, 0.0205, 0.0125, 0.001),
        (-0.150, 0.0145, 0.0120, 0.0),
        (-0.135, 0.0140, 0.0120, 0.0),
    ]
    loft(b, c.skin, _scaled(hand, h, 1.0), sides=8, domes=1)
    thumb = [(-0.203, 0.006, 0.006, 0.027), (-0.185, 0.008, 0.008, 0.022), (-0.165, 0.008, 0.008, 0.013)]
    loft(b, c.skin, _scaled(thumb, h, 1.0), y=-side * 0.006 * h, sides=6, domes=0)


def _thigh(b: Builder, f: Figure, c: PersonSurfaces, legs: int) -> None:
    h, g, k = f.height, 0.3 + 0.7 * f.girth, f.limb
    rows = [
        (-0.24 * k, _KNEE, _KNEE, 0.0),
        (-0.20 * k, 0.0345, 0.0335, 0.0),
        (-0.13 * k, 0.0415, 0.0390, 0.0),
        (-0.06 * k, 0.0480, 0.0440, -0.001),
        (-0.012, 0.0500, 0.0440, -0.003),
    ]
    loft(b, c.trousers if legs == _TROUSERS else c.skin, _scaled(rows, h, g * (1.06 if legs == _TROUSERS else 1.0)))
    if legs != _TROUSERS:  # below a skirt, the cloth is visible where a striding leg comes near the hem
        shorts = [(-0.205 * k, 0.051, 0.049, 0.0), (-0.12 * k, 0.053, 0.049, 0.0), (-0.01, 0.053, 0.047, -0.002)]
        loft(b, c.trousers, _scaled(shorts[legs == _SKIRT :], h, g), domes=1)


def _shin(b: Builder, f: Figure, c: PersonSurfaces, legs: int) -> None:
    h, g, k = f.height, 0.3 + 0.7 * f.girth, f.limb
    calf = [
        (-0.225 * k, 0.0195, 0.0180, 0.001),
        (-0.18 * k, 0.0220, 0.0205, -0.001),
        (-0.12 * k, 0.0290, 0.0270, -0.004),
        (-0.06 * k, 0.0318, 0.0300, -0.003),
        (0.0, _KNEE, _KNEE, 0.0),
    ]
    if legs != _TROUSERS:
        loft(b, c.skin, _scaled(calf, h, g))
        return
    cloth = [
        (-0.222 * k, 0.0330, 0.0300, 0.002),
        (-0.15 * k, 0.0325, 0.0300, -0.001),
        (-0.07 * k, 0.0335, 0.0315, -0.002),
    ]
    loft(b, c.trousers, _scaled([*cloth, calf[-1]], h, g * 1.06))


def _foot(b: Builder, f: Figure, c: PersonSurfaces, legs: int) -> None:
    """Add a shoe, flat below, with sections along x from heel to toe, and an ankle."""
    h = f.height
    sole = -f.ankle
    rows = [  # x, half width, height of the shoe's top above the sole
        (-0.036, 0.012, 0.024),
        (-0.031, 0.0205, 0.040),
        (-0.014, 0.0240, 0.052),
        (0.010, 0.0240, 0.051),
        (0.040, 0.0255, 0.038),
        (0.072, 0.0280, 0.028),
        (0.098, 0.0255, 0.0225),
        (0.110, 0.0185, 0.018),
        (0.116, 0.0085, 0.012),
    ]
    shape = []
    for x, w, top in rows:
        ring = []
        for cy, sz in circle(10):
            rise = max(0.0, min(1.0, 0.55 * sz + 0.42))
            ring.append((x * h, w * h * cy * (1.0 if sz > -0.3 else 0.95), sole + top * h * rise))
        shape.append(ring)
    b.grid(c.shoes, np.array(shape), crease=0.2, caps=(c.shoes, c.shoes))
    ankle = [(-0.012, 0.0215, 0.0195, -0.003), (0.012, 0.0205, 0.0190, 0.0)]
    loft(b, c.trousers if legs == _TROUSERS else c.skin, _scaled(ankle, h, 1.0), domes=0)
