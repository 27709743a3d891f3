"""Cars, vans, buses and trucks: a shell, its fittings, and four wheels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from recipe_compiler.ir.semantic_tags import BODIES

from recipe_runtime.body.skeleton import BUS, PICKUP, TRUCK, wheel_joints
from recipe_runtime.meshes.builder import Builder, level, upright
from recipe_runtime.meshes.cargo import cargo
from recipe_runtime.meshes.coachwork import Finish, Point, Shell, Sight
from recipe_runtime.meshes.fittings import (
    arch_lips,
    beacons,
    exhaust,
    grille,
    rails,
    rear_doors,
    roof_sign,
    wipers,
)
from recipe_runtime.meshes.lettering import bits
from recipe_runtime.meshes.mesh import Light, Mesh, Pattern, Surface
from recipe_runtime.meshes.styles import STYLES
from recipe_runtime.meshes.wheels import car_wheel

_NEAR = 25.0  # metres up to which details are shown


def vehicle_parts(shape: Mapping[str, float], tag: int, lit: bool) -> tuple[tuple[str, Mesh], ...]:
    """Return the base part `chassis`, whose origin is on the ground below the vehicle's middle, then the wheels."""
    finish = Finish.of(tag, lit)
    heavy = shape["width"] > 2.1
    wide, spokes = (0.28, 8) if heavy else (0.215, int(shape["spokes"]))
    sight = Sight(_NEAR, (0.0, 0.0, round(shape["height"] / 2, 6)))
    wheels = {side: car_wheel(finish, shape["wheel"], wide, side, spokes, sight) for side in (1.0, -1.0)}
    joints = [(joint.part, wheels[1.0 if joint.offset[1] > 0 else -1.0]) for joint in wheel_joints(shape)]
    return (("chassis", _chassis(finish, shape, lit, sight)), *joints)


def shell_of(shape: Mapping[str, float], coarse: bool = False) -> Shell:
    """Return the shell of a vehicle, without the sign of a taxi."""
    styles = STYLES[BODIES[int(shape["body"])]]
    style = styles[min(int(shape["style"]), len(styles) - 1)]
    if shape["blind"]:
        style = replace(style, windows=(0.63, style.windows[1]), pillars=())
    return Shell(style, {**shape, "height": shape["height"] - shape["sign"]}, coarse)


def _chassis(f: Finish, shape: Mapping[str, float], lit: bool, sight: Sight) -> Mesh:
    b, body, sign = Builder(), int(shape["body"]), shape["sign"]
    shell = shell_of(shape)
    with b.level(0.0, sight.near, anchor=sight.anchor, casts=False):
        shell.add(b, f, lit)
        _fittings(b, f, shell, body)
    with b.level(sight.near, anchor=sight.anchor, casts=True):
        shell_of(shape, coarse=True).add(b, f, lit)
    _underside(b, f, shell, body)
    _plates(b, f, shell, body)
    if lit:
        _beams(b, shell)
    if body == TRUCK:
        cargo(b, f, shell)
    elif body == PICKUP:
        _bed(b, f, shell)
    elif body == BUS:
        _destination(b, f, shell)
    elif sign > 0.0:
        beacons(b, f, shell, sign) if shell.style.livery else roof_sign(b, f, shell, sign, lit)
    _mirrors(b, f, shell, body)
    return b.mesh()


def _fittings(b: Builder, f: Finish, shell: Shell, body: int) -> None:
    """Add what one sees from near by only."""
    if body != BUS:
        grille(b, f, shell)
    if body not in (BUS, TRUCK):
        wipers(b, f, shell)
        exhaust(b, f, shell)
    if shell.shape["blind"]:
        rear_doors(b, f, shell)
    if shell.style.rails:
        rails(b, f, shell)
    arch_lips(b, f, shell)
    _handles(b, f, shell, body)


def _underside(b: Builder, f: Finish, shell: Shell, body: int) -> None:
    """Add a dark core and the wheel housings, so that no light passes through the arches."""
    wheel, clearance = shell.shape["wheel"], shell.shape["clearance"]
    y = shell.half - 0.36
    rear, front = shell.axles
    top = 2.13 * wheel + 0.02
    if body == TRUCK:
        y, top = 0.45 * shell.half, 0.29 * shell.height
    b.box(f.trim, (rear - 1.2 * wheel, -y, clearance - 0.02), (front + 1.2 * wheel, y, top))


def _plates(b: Builder, f: Finish, shell: Shell, body: int) -> None:
    """Add number plates at both ends."""
    for sign, u in ((1.0, 0.999), (-1.0, 0.001)):
        z = shell.flank(max(u, shell.style.start), 0.33 if sign > 0 else 0.36)[1] - 0.055
        x = shell.end(sign, 0.0, z + 0.055) + sign * (0.016 if sign > 0 else 0.006)  # before the bars of a grille
        if body == TRUCK and sign < 0:
            x, z = -shell.length / 2 - 0.02, 0.55
        b.box(f.trim, *_box(x - sign * 0.05, x - sign * 0.002, -0.27, 0.27, z - 0.012, z + 0.122))
        _panel(b, f.plate, x, sign, -0.26, 0.26, z, z + 0.11)
        for k in range(7):
            y = sign * (-0.24 + 0.064 * k + 0.02 * (k > 3))
            quad = upright(x + sign * 0.002, min(y, y + sign * 0.064), max(y, y + sign * 0.064), z + 0.012, z + 0.098)
            place = np.array([[(k, 0.0), (k + 0.999, 0.0), (k + 0.999, 1.0), (k, 1.0)]])
            b.quads(f.number, [quad if sign > 0 else [quad[k] for k in (1, 0, 3, 2)]], place)


def _box(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> tuple[Point, Point]:
    """Return the lower and the upper corner of a box between two x in any order."""
    return (min(x0, x1), y0, z0), (max(x0, x1), y1, z1)


def _beams(b: Builder, shell: Shell) -> None:
    """Add the headlight beams."""
    y, z = shell.flank(0.985, sum(shell.style.lamps) / 2)
    for side in (1.0, -1.0):
        place = (round(shell.length / 2 + 0.06, 6), round(side * 0.82 * y, 6), round(z, 6))
        b.lights.append(Light(place, (0.994988, 0.0, -0.1), (1.0, 0.93, 0.82), 9000.0, 0.88))


def _panel(b: Builder, surface: Surface, x: float, sign: float, y0: float, y1: float, z0: float, z1: float) -> None:
    """Add an upright rectangle that faces forward, or backward if `sign` is -1."""
    quad = upright(x, y0, y1, z0, z1)
    b.quads(surface, [quad if sign > 0 else quad[::-1]])


_LINES = ("CENTRE", "MARKET", "STATION")


def _destination(b: Builder, f: Finish, shell: Shell) -> None:
    """Add a bus' destination display above its windscreen."""
    x, w = shell.length / 2 - 0.02, 0.5 * shell.half
    z, tall = 0.91 * shell.height, 0.16
    b.box(f.trim, (x - 0.3, -w, z - 0.12), (x + 0.055, w, z + 0.12))
    amber = Surface("display", Pattern.LETTER, f.plate.tag)
    text = _LINES[int(shell.length * 100) % len(_LINES)]
    wide = 0.7 * tall
    for n, sign in enumerate(text):
        if sign == " ":
            continue
        y = (n - len(text) / 2) * 1.25 * wide
        high, low = bits(sign)
        place = [[(high + i, low + j) for i, j in ((0.004, 0.004), (0.996, 0.004), (0.996, 0.996), (0.004, 0.996))]]
        quad = upright(x + 0.057, y, y + wide, z - tall / 2, z + tall / 2)
        b.quads(amber, [quad], np.array(place))


def _bed(b: Builder, f: Finish, shell: Shell) -> None:
    """Add a pickup's open bed: a dark floor and walls inside the shell."""
    x0, x1, top = shell.x(0.012), shell.x(0.384), shell.belt(0.2)
    y, z = 0.915 * shell.half, top - 0.42
    b.quads(f.trim, [level(x0, x1, -y, y, z)])
    for s in (1.0, -1.0):
        wall = [(x0, s * y, z), (x1, s * y, z), (x1, s * y, top + 0.03), (x0, s * y, top + 0.03)]
        b.quads(f.trim, [wall if s > 0 else wall[::-1]])
    _panel(b, f.trim, x0, 1.0, -y, y, z, top)
    _panel(b, f.paint, x1 + 0.002, -1.0, -y, y, z, top + 0.05)


def _mirrors(b: Builder, f: Finish, shell: Shell, body: int) -> None:
    """Add wing mirrors: a rounded housing on a foot, with the glass facing backward."""
    heavy = body in (BUS, TRUCK)
    u = shell.style.windows[1] - (0.0 if heavy else 0.03)
    x, y0 = shell.x(u), shell.width(u) * 0.94
    z = shell.belt(u) + (0.35 if heavy else 0.035)
    tall, wide = (0.34, 0.18) if heavy else (0.13, 0.19)
    for s in (1.0, -1.0):
        rings = []
        for x1, k in ((-0.05, 0.85), (-0.045, 1.0), (0.02, 1.0), (0.06, 0.7), (0.075, 0.3)):
            c, m = s * (y0 + 0.05 + wide / 2), z + tall / 2
            ring = [(x + x1, c + k * wide / 2 * cy, m + k * tall / 2 * cz) for cy, cz in _OVAL]
            rings.append(ring)
        b.grid(f.trim if heavy else f.paint, rings, crease=0.3, caps=(f.mirror, f.trim))
        y, y1 = sorted((s * (y0 - 0.06), s * (y0 + 0.1)))
        b.box(f.trim, (x - 0.03, y, z + 0.005), (x + 0.04, y1, z + 0.04))


_OVAL = ((1.0, -0.6), (1.0, 0.6), (0.75, 1.0), (-0.75, 1.0), (-1.0, 0.6), (-1.0, -0.6), (-0.75, -1.0), (0.75, -1.0))


def _handles(b: Builder, f: Finish, shell: Shell, body: int) -> None:
    """Add a handle at the rear edge of each door."""
    if body == BUS:
        return
    for seam in shell.style.seams[:-1]:
        u = seam + 0.16 / shell.length
        y, z = shell.flank(u, 0.83)
        for s in (1.0, -1.0):
            y0, y1 = sorted((s * (y - 0.02), s * (y + 0.018)))
            b.box(f.paint, (shell.x(u) - 0.085, y0, z - 0.014), (shell.x(u) + 0.085, y1, z + 0.012))
