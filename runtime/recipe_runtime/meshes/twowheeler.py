"""Motorcycles and bicycles with their riders: first the vehicle's parts, then the rider's, each with its own tag."""

from __future__ import annotations

from collections.abc import Mapping

from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.body.skeleton import SCOOTER, Bike
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.coachwork import Finish
from recipe_runtime.meshes.cycle_parts import guard, lamp, rear_lamps
from recipe_runtime.meshes.lofts import loft, tube
from recipe_runtime.meshes.mesh import NO_MESH, Mesh
from recipe_runtime.meshes.person.people import with_rider
from recipe_runtime.meshes.scooter import scooter_body, scooter_fork
from recipe_runtime.meshes.wheels import spoked_wheel


def twowheeler_parts(shape: Mapping[str, float], tag: int) -> tuple[tuple[str, Mesh], ...]:
    """Return the base part `chassis`, with its origin on the ground between the wheels, then those of `Bike.joints`."""
    bike, f = Bike.of(shape), Finish.of(tag)
    joints = bike.joints()
    scooter = int(shape["body"]) == SCOOTER
    wheel = spoked_wheel(
        f.rubber,
        f.rim,
        bike.wheel,
        bike.tyre,
        6 if scooter else 10 if bike.motor else 22,
        f.trim if bike.motor else None,
    )
    fork = scooter_fork if scooter else _motor_fork
    made = {"fork": fork(f, bike) if bike.motor else _fork(f, bike), "crank": _crank(f, bike)}
    made |= {"wheel_front": wheel, "wheel_rear": wheel}
    body = scooter_body if scooter else _motor
    own = 3 if bike.motor else 4
    chassis = body(f, bike) if bike.motor else _frame(f, bike)
    machine = [("chassis", with_rider(chassis, shape, Tag.RIDER))]
    machine += [(joint.part, made[joint.part]) for joint in joints[:own]]
    return (*machine, *((joint.part, NO_MESH) for joint in joints[own:]))


def _frame(f: Finish, k: Bike) -> Mesh:
    """Return a bicycle's frame: tubes between head, cranks, saddle and rear hub, with saddle, mudguards and lamps."""
    b = Builder()
    (hx, _, hz), (cx, _, cz), (sx, _, sz) = k.hips, k.crank, k.steering
    rear = -k.wheelbase / 2
    top = (hx + 0.055, 0.0, hz - 0.28)
    head, neck = (sx - 0.05, 0.0, sz + 0.17), (sx - 0.03, 0.0, sz + 0.08)
    tube(b, f.paint, [top, head], 0.016)
    tube(b, f.paint, [(cx, 0, cz), neck], 0.020)
    tube(b, f.paint, [(cx, 0, cz), top, (hx + 0.045, 0, hz - 0.22)], 0.017)
    tube(b, f.paint, [(sx - 0.055, 0.0, sz + 0.20), (sx - 0.02, 0, sz + 0.03)], 0.021)
    tube(b, f.rim, [(hx + 0.05, 0, hz - 0.24), (hx + 0.02, 0, hz - 0.12)], 0.013)
    for s in (1.0, -1.0):
        hub = (rear, s * 0.05, k.wheel)
        tube(b, f.paint, [(cx - 0.02, s * 0.02, cz), hub], 0.010, 6)
        tube(b, f.paint, [(top[0], s * 0.02, top[2] - 0.04), hub], 0.009, 6)
    saddle = [(hz - 0.125, 0.10, 0.035, 0.05), (hz - 0.10, 0.14, 0.06, 0.0), (hz - 0.085, 0.13, 0.065, -0.02)]
    loft(b, f.trim, [(z, rx, ry, hx + 0.03 + x) for z, rx, ry, x in saddle])
    tx, tz = rear - 0.79 * (k.wheel + 0.045), k.wheel + 0.61 * (k.wheel + 0.045)
    b.box(f.taillight, (tx - 0.02, -0.03, tz - 0.02), (tx + 0.01, 0.03, tz + 0.03))
    guard(b, f.trim, (rear, k.wheel), k.wheel + 0.02, 0.03, -70.0, 100.0)
    tube(b, f.trim, [(rear, -0.055, k.wheel + 0.045), (cx, -0.055, cz + 0.09)], 0.006, 5)
    tube(b, f.trim, [(rear, -0.055, k.wheel - 0.045), (cx, -0.055, cz - 0.09)], 0.006, 5)
    return b.mesh()


def _fork(f: Finish, k: Bike) -> Mesh:
    """Return fork, stem, handlebar and lamp, in the frame of the steering axis' lower end."""
    b = Builder()
    ahead, down = k.wheelbase / 2 - k.steering[0], k.wheel - k.steering[2]
    x, y, z = k.grips
    for s in (1.0, -1.0):
        blade = [(0.0, s * 0.045, 0.02), (0.02, s * 0.05, -0.06), (ahead, s * 0.05, down)]
        tube(b, f.paint, blade, (0.015, 0.014, 0.009), 6)
    tube(b, f.paint, [(0.0, -0.05, 0.015), (0.0, 0.05, 0.015)], 0.018, 6)
    tube(b, f.rim, [(-0.03, 0, 0.1), (-0.085, 0, 0.34), (-0.04, 0, z - 0.02)], 0.013)
    bar = [(x, y, z), (x + 0.1, 0.75 * y, z + 0.01), (-0.03, 0.3 * y, z - 0.01), (-0.04, 0, z - 0.02)]
    tube(b, f.rim, [*bar, *[(px, -py, pz) for px, py, pz in bar[-2::-1]]], 0.011, 6)
    for s in (1.0, -1.0):
        tube(b, f.rubber, [(x - 0.01, s * (y + 0.01), z), (x + 0.085, s * 0.79 * y, z + 0.009)], 0.016, 6)
    lamp(b, f, (0.05, 0.0, 0.10), 0.035, 600.0)
    guard(b, f.trim, (ahead, down), k.wheel + 0.02, 0.03, -38.0, 70.0)
    return b.mesh()


def _crank(f: Finish, k: Bike) -> Mesh:
    """Return chainring, cranks and round pedals in the frame of the bottom bracket; at rest the left crank is up."""
    b = Builder()
    tube(b, f.rim, [(0, -0.075, 0), (0, 0.075, 0)], 0.016, 8)
    tube(b, f.rim, [(0, -0.06, 0), (0, -0.052, 0)], 0.09, 16)
    for s in (1.0, -1.0):
        tube(b, f.rim, [(0, s * 0.075, 0), (0, s * 0.08, s * k.pedals)], 0.010, 6)
        tube(b, f.rubber, [(0, s * 0.085, s * k.pedals), (0, s * 0.17, s * k.pedals)], 0.014, 6)
    return b.mesh()


def _motor(f: Finish, k: Bike) -> Mesh:
    """Return the body of a motorcycle: engine, tank, seat and tail, swing arm, exhaust, number plate and lamp."""
    b = Builder()
    (hx, _, hz), (sx, _, sz), half, r = k.hips, k.steering, k.wheelbase / 2, k.wheel
    seat = hz - 0.095
    engine = [
        (r - 0.10, 0.20, 0.10, 0.02),
        (r, 0.24, 0.15, 0.0),
        (r + 0.14, 0.21, 0.15, 0.02),
        (r + 0.24, 0.16, 0.12, 0.05),
    ]
    loft(b, f.trim, engine, square=0.2, sides=12)
    for n in range(4):
        z = r + 0.03 + 0.045 * n
        loft(b, f.rim, [(z, 0.13, 0.165, 0.06), (z + 0.018, 0.13, 0.165, 0.06)], square=0.2, domes=0)
    tank = [(seat - 0.03, 0.20, 0.09, 0.0), (seat + 0.05, 0.25, 0.145, 0.01), (seat + 0.13, 0.22, 0.14, 0.03),
            (seat + 0.18, 0.13, 0.09, 0.05)]  # fmt: skip
    loft(b, f.paint, [(z, rx, ry, hx + 0.46 + x) for z, rx, ry, x in tank], square=0.1, sides=14)
    bench = [(seat - 0.05, 0.36, 0.10, 0.0), (seat, 0.38, 0.14, -0.01), (seat + 0.02, 0.36, 0.12, -0.02)]
    loft(b, f.trim, [(z, rx, ry, hx - 0.08 + x) for z, rx, ry, x in bench], sides=14)
    tail = [(seat - 0.13, 0.16, 0.06, 0.08), (seat - 0.05, 0.30, 0.125, 0.0), (seat - 0.02, 0.30, 0.12, -0.04)]
    loft(b, f.paint, [(z, rx, ry, hx - 0.16 + x) for z, rx, ry, x in tail], sides=12)
    tube(b, f.rim, [(0.26, 0.0, r + 0.02), (sx - 0.1, 0.0, sz + 0.02), (sx - 0.06, 0, sz + 0.22)], 0.035)
    tube(b, f.rim, [(sx - 0.06, 0, sz + 0.2), (hx + 0.3, 0, seat)], 0.03)
    for s in (1.0, -1.0):
        tube(b, f.rim, [(-0.12, s * 0.09, r + 0.02), (-half, s * 0.085, r)], 0.026, 6)
        tube(b, f.rim, [(-half + 0.06, s * 0.09, r + 0.03), (hx - 0.1, s * 0.10, seat - 0.06)], 0.022, 6)
        tube(b, f.rubber, [(0.03 * k.wheelbase, s * y, r + 0.015) for y in (0.12, 0.24)], 0.014, 6)
    pipe = [(0.24, -0.13, r + 0.16), (0.26, -0.15, r - 0.06), (-0.1, -0.17, r - 0.10), (-half - 0.1, -0.18, r + 0.06)]
    tube(b, f.rim, pipe, (0.026, 0.026, 0.04, 0.05))
    end = hx - 0.44
    guard(b, f.trim, (-half, r), r + 0.02, 0.075, -35.0, 75.0)
    rear_lamps(b, f, end, seat - 0.02)
    px, pz = -half - 0.30, r + 0.10
    for surface, low, high, y in ((f.plate, px, px + 0.03, 0.1), (f.trim, px + 0.004, px + 0.034, -0.1)):
        b.quads(surface, [[(low, y, pz), (low, -y, pz), (high, -y, pz + 0.16), (high, y, pz + 0.16)]])
    tube(b, f.trim, [(px + 0.03, 0, pz + 0.14), (end + 0.05, 0.0, seat - 0.06)], 0.03, 6)
    return b.mesh()


def _motor_fork(f: Finish, k: Bike) -> Mesh:
    """Return telescopic fork, lamp, dials, mirrors and handlebar, in the frame of the steering axis' lower end."""
    b = Builder()
    ahead, down = k.wheelbase / 2 - k.steering[0], k.wheel - k.steering[2]
    x, y, z = k.grips
    for s in (1.0, -1.0):
        tube(b, f.rim, [(-0.13, s * 0.10, z - 0.08), (ahead - 0.06, s * 0.095, down + 0.2)], 0.024)
        tube(b, f.trim, [(ahead - 0.06, s * 0.095, down + 0.22), (ahead, s * 0.095, down)], 0.032)
    bar = [(x, y, z), (x + 0.07, 0.6 * y, z + 0.015), (-0.13, 0.3 * y, z - 0.04), (-0.13, 0, z - 0.05)]
    tube(b, f.trim, [*bar, *[(px, -py, pz) for px, py, pz in bar[-2::-1]]], 0.014, 6)
    for s in (1.0, -1.0):
        tube(b, f.rubber, [(x - 0.01, s * (y + 0.04), z - 0.003), (x + 0.035, s * 0.78 * y, z + 0.008)], 0.021, 6)
        tube(b, f.trim, [(x + 0.06, s * 0.7 * y, z), (x + 0.06, s * 0.85 * y, z + 0.17)], 0.007, 5)
        mirror = [(z + 0.14, 0.012, 0.05, 0.0), (z + 0.20, 0.012, 0.065, 0.0)]
        loft(b, f.trim, [(mz, rx, ry, x + 0.06) for mz, rx, ry, _ in mirror], y=s * 0.95 * y)
    lamp(b, f, (0.06, 0.0, z - 0.16), 0.095, 7000.0)
    loft(b, f.trim, [(z - 0.05, 0.05, 0.10, -0.04), (z, 0.04, 0.09, -0.06)])
    guard(b, f.paint, (ahead, down), k.wheel + 0.025, 0.075, -40.0, 60.0)
    return b.mesh()
