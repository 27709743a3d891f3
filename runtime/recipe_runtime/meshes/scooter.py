"""The body of a motor scooter: leg shield, footboard, rear body with seat, and a fork with a covered handlebar."""

from __future__ import annotations

from recipe_runtime.body.skeleton import Bike
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.coachwork import Finish
from recipe_runtime.meshes.cycle_parts import guard, lamp, rear_lamps
from recipe_runtime.meshes.lofts import loft, tube
from recipe_runtime.meshes.mesh import Mesh


def scooter_body(f: Finish, k: Bike) -> Mesh:
    """Return what does not steer, with its origin on the ground between the wheels."""
    b = Builder()
    (hx, _, hz), (sx, _, sz), half, r = k.hips, k.steering, k.wheelbase / 2, k.wheel
    seat = hz - 0.095
    floor = r - 0.03
    b.box(f.trim, (-0.16, -0.19, floor), (sx - 0.04, 0.19, floor + 0.035))
    b.box(f.paint, (-0.18, -0.2, floor - 0.06), (sx - 0.05, 0.2, floor))
    middle = (hx - half) / 2 - 0.02
    body = [(floor - 0.05, 0.22, 0.10, 0.08), (floor + 0.06, 0.33, 0.17, 0.0), (floor + 0.2, 0.36, 0.19, -0.01),
            (seat - 0.06, 0.36, 0.16, -0.01), (seat - 0.03, 0.35, 0.13, -0.01)]  # fmt: skip
    loft(b, f.paint, [(z, rx, ry, middle + x) for z, rx, ry, x in body], square=0.15, sides=20, domes=0)
    bench = [(seat - 0.04, 0.34, 0.12, 0.02), (seat + 0.01, 0.37, 0.15, 0.02), (seat + 0.035, 0.33, 0.12, 0.0)]
    loft(b, f.trim, [(z, rx, ry, middle + x) for z, rx, ry, x in bench], sides=18)
    shield = []
    for z, x, wide in ((floor - 0.04, 0.0, 0.20), (floor + 0.2, 0.02, 0.25), (sz + 0.02, -0.02, 0.24),
                       (sz + 0.24, -0.09, 0.17)):  # fmt: skip
        arc = ((-1.0, -0.10), (-0.6, -0.01), (0.0, 0.03), (0.6, -0.01), (1.0, -0.10))
        shield.append([(sx - 0.03 + x + d, -t * wide, z) for t, d in arc])
    b.grid(f.paint, [row[::-1] for row in shield], closed=False, crease=0.5)
    b.grid(f.trim, [[(x - 0.015, y, z) for x, y, z in row] for row in shield], closed=False, crease=0.5)
    tube(b, f.rim, [(-half + 0.1, 0.12, r + 0.02), (-half, 0.10, r)], 0.04, 8)
    pipe = [(-0.12, -0.17, r - 0.08), (-half + 0.1, -0.19, r - 0.06), (-half - 0.18, -0.19, r)]
    tube(b, f.rim, pipe, (0.03, 0.055, 0.05))
    end = middle - 0.33
    rear_lamps(b, f, end, seat - 0.1)
    x, z = end - 0.04, seat - 0.34
    b.quads(f.plate, [[(x, 0.1, z), (x, -0.1, z), (x + 0.03, -0.1, z + 0.16), (x + 0.03, 0.1, z + 0.16)]])
    guard(b, f.trim, (-half, r), r + 0.02, 0.075, 20.0, 80.0)
    return b.mesh()


def scooter_fork(f: Finish, k: Bike) -> Mesh:
    """Return fork, front mudguard, handlebar with its cover, lamp and mirrors, in the frame of the steering axis."""
    b = Builder()
    ahead, down = k.wheelbase / 2 - k.steering[0], k.wheel - k.steering[2]
    x, y, z = k.grips
    tube(b, f.rim, [(-0.12, 0.0, z - 0.05), (ahead - 0.05, 0.0, down + k.wheel + 0.06)], 0.03)
    for s in (1.0, -1.0):
        tube(b, f.trim, [(ahead - 0.05, s * 0.07, down + k.wheel + 0.06), (ahead, s * 0.08, down)], 0.022)
        tube(b, f.rubber, [(x - 0.01, s * (y + 0.04), z - 0.003), (x + 0.035, s * 0.78 * y, z + 0.008)], 0.021, 6)
        tube(b, f.trim, [(x + 0.06, s * 0.6 * y, z), (x + 0.06, s * 0.85 * y, z + 0.19)], 0.006, 5)
        mirror = [(z + 0.16, 0.012, 0.05, 0.0), (z + 0.23, 0.012, 0.065, 0.0)]
        loft(b, f.trim, [(mz, rx, ry, x + 0.06) for mz, rx, ry, _ in mirror], y=s * 0.95 * y)
    bar = [(x, y, z), (x + 0.07, 0.6 * y, z + 0.015), (-0.1, 0.3 * y, z - 0.01), (-0.1, 0, z - 0.02)]
    tube(b, f.trim, [*bar, *[(px, -py, pz) for px, py, pz in bar[-2::-1]]], 0.016, 6)
    cover = [(z - 0.16, 0.09, 0.08, 0.0), (z - 0.06, 0.12, 0.15, -0.02), (z - 0.01, 0.09, 0.16, -0.04)]
    loft(b, f.paint, [(cz, rx, ry, x + 0.10 + cx) for cz, rx, ry, cx in cover], sides=16)
    lamp(b, f, (x + 0.2, 0.0, z - 0.08), 0.08, 6000.0)
    guard(b, f.paint, (ahead, down), k.wheel + 0.03, 0.09, -60.0, 75.0)
    return b.mesh()
