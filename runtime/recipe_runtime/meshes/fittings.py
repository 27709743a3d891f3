"""What is fitted to the shell of a car: lips of arches, grille, wipers, rails, exhaust, and signs on the roof."""

from __future__ import annotations

from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.coachwork import Finish, Point, Shell
from recipe_runtime.meshes.lofts import tube
from recipe_runtime.meshes.mesh import Pattern, Surface


def arch_lips(b: Builder, f: Finish, shell: Shell) -> None:
    """Add a raised lip around each wheel arch, of plastic on clad bodies, and the dark housing behind it."""
    surface = f.trim if shell.style.clad else f.paint
    wide = 0.085 if shell.style.clad else 0.035
    for axle in shell.axles:
        if axle - shell.arch < shell.x(shell.style.start):
            continue
        rows: list[list[Point]] = []
        for c, s in circle(48)[:25]:
            if shell.shape["wheel"] + shell.arch * s < shell.shape["clearance"] + 0.02:
                continue
            row = []
            for r, out in ((shell.arch - 0.01, -0.10), (shell.arch - 0.008, 0.012), (shell.arch + 0.6 * wide, 0.014),
                           (shell.arch + wide, -0.004)):  # fmt: skip
                x, z = axle + r * c, shell.shape["wheel"] + r * s
                row.append((x, shell.side(x, z) + out, z))
            rows.append(row)
        b.grid(surface, rows, closed=False, crease=0.8)
        b.grid(surface, [[(x, -y, z) for x, y, z in row] for row in rows[::-1]], closed=False, crease=0.8)


def grille(b: Builder, f: Finish, shell: Shell) -> None:
    """Add the bars of the grille, those at its edges bright, and a badge."""
    front = shell.style.front
    low, high = (shell.flank(0.985, k)[1] for k in front.grille[:2])
    half, count = 0.9 * front.grille[2] * shell.width(1.0), front.bars
    for n in range(count):
        share = (n + 0.5) / count
        if front.upright:
            y = half * (2.0 * share - 1.0)
            bar = [(shell.end(1.0, y, z) + 0.004, y, z) for z in (low, (low + high) / 2, high)]
        else:
            z = low + (high - low) * share
            bar = [(shell.end(1.0, y, z) + 0.004, y, z) for y in (-half, -0.5 * half, 0.0, 0.5 * half, half)]
        tube(b, f.rim if front.upright or n in (0, count - 1) else f.trim, bar, 0.008, 5)
    z = (low + high) / 2 if count else shell.flank(0.985, 0.75)[1]
    x = shell.end(1.0, 0.0, z) + 0.012
    b.fan(f.rim, [(x, 0.055 * c, z + 0.055 * s) for c, s in circle(16)])


def wipers(b: Builder, f: Finish, shell: Shell) -> None:
    """Add two wipers at the foot of the windscreen."""
    foot = shell.x(shell.style.roof[-1][0])
    for y0, y1 in ((0.45 * shell.half, -0.1 * shell.half), (-0.15 * shell.half, -0.62 * shell.half)):
        path = [(x, y, shell.top(x, y) + 0.016) for x, y in ((foot - 0.02, y0), (foot - 0.10, y1))]
        tube(b, f.trim, path, 0.009, 5)


def rails(b: Builder, f: Finish, shell: Shell) -> None:
    """Add rails along the roof."""
    first, last = shell.x(shell.style.windows[0]) + 0.15, shell.x(shell.style.screens[1]) + 0.02
    for s in (1.0, -1.0):
        y = 0.93 * shell.style.roof_width * shell.half
        path = [(first + (last - first) * k / 6, s * y) for k in range(7)]
        rail = [(x, y, shell.top(x, y) + (0.022 if 0 < k < 6 else 0.0)) for k, (x, y) in enumerate(path)]
        tube(b, f.rim, rail, 0.012, 6)


def exhaust(b: Builder, f: Finish, shell: Shell) -> None:
    """Add a tail pipe under the right of the bumper."""
    z, y = shell.shape["clearance"] + 0.06, -0.55 * shell.half
    x = shell.end(-1.0, y, z + 0.06)
    tube(b, f.disc, [(x + 0.25, y, z), (x + 0.03, y, z)], 0.03, 10)


def rear_doors(b: Builder, f: Finish, shell: Shell) -> None:
    """Add the gap between the two doors at the rear of a van, and their hinges."""
    low, belt = shell.shape["clearance"] + 0.25, shell.belt(0.01)
    below = [(shell.end(-1.0, 0.0, z) - 0.002, 0.0, z) for z in (low, (low + belt) / 2, belt - 0.03)]
    above = [shell.bend(shell.x(u) - 0.004, 0.0, shell.roof(u)) for u, _ in shell.style.roof[1:3]]
    tube(b, f.trim, [*below, *above], 0.009, 5)
    for s in (1.0, -1.0):
        for share in (0.5, 0.9):
            y, z = shell.flank(0.01, share)
            x = shell.end(-1.0, 0.86 * y, z)
            y0, y1 = sorted((s * 0.82 * y, s * 0.9 * y))
            b.box(f.trim, (x - 0.02, y0, z), (x + 0.05, y1, z + 0.05))


def roof_sign(b: Builder, f: Finish, shell: Shell, tall: float, lit: bool) -> None:
    """Add a taxi's roof sign, lit at night unless the taxi is parked."""
    face = Surface("plate", Pattern.LAMP if lit else Pattern.PLAIN, f.plate.tag)
    x, z = shell.x(0.46), shell.height
    b.box(f.trim, (x - 0.09, -0.28, z - 0.02), (x + 0.09, 0.28, z + 0.02))
    b.box(face, (x - 0.07, -0.25, z + 0.02), (x + 0.07, 0.25, z + tall))


def beacons(b: Builder, f: Finish, shell: Shell, tall: float) -> None:
    """Add the light bar of the police."""
    blue = Surface("beacon", Pattern.LENS, f.plate.tag)
    x, z, w = shell.x(0.46), shell.height, 0.62 * shell.half
    b.box(f.trim, (x - 0.12, -w, z - 0.02), (x + 0.12, w, z + 0.03))
    for y0, y1 in ((-w, -0.35 * w), (0.35 * w, w)):
        b.box(blue, (x - 0.11, y0, z + 0.03), (x + 0.11, y1, z + tall))
    b.box(f.rim, (x - 0.10, -0.35 * w, z + 0.03), (x + 0.10, 0.35 * w, z + 0.75 * tall))
