"""Parts that two-wheelers share: mudguards and lamps."""

from __future__ import annotations

from recipe_runtime.meshes.builder import Builder, circle
from recipe_runtime.meshes.coachwork import Finish
from recipe_runtime.meshes.mesh import Light, Surface


def guard(
    b: Builder, surface: Surface, hub: tuple[float, float], radius: float, half: float, start: float, end: float
) -> None:
    """Add a mudguard around a wheel, from `start` to `end` degrees from its top."""
    rows = []
    for n in range(9):
        s, c = (v for v in circle(1, start + (end - start) * n / 8)[0][::-1])
        arc = [(half, -0.5), (0.6 * half, 0.0), (-0.6 * half, 0.0), (-half, -0.5)]
        rows.append([(hub[0] - (radius + half * d) * s, y, hub[1] + (radius + half * d) * c) for y, d in arc])
    b.grid(surface, rows, closed=False, crease=0.2)
    b.grid(surface, [row[::-1] for row in rows], closed=False, crease=0.2)


def lamp(b: Builder, f: Finish, at: tuple[float, float, float], radius: float, candela: float) -> None:
    """Add a round headlamp."""
    x, y, z = at

    def rings(profile: list[tuple[float, float]]) -> list[list[tuple[float, float, float]]]:
        return [[(px, y + radius * k * c, z + radius * k * s) for c, s in circle(10)] for px, k in profile]

    shell = rings([(x - 1.5 * radius, 0.3), (x - 0.8 * radius, 0.85), (x, 1.0)])
    b.grid(f.trim, shell, crease=0.2, caps=(f.trim, None))
    b.grid(f.headlight, rings([(x, 1.0), (x + 0.3 * radius, 0.6)]), crease=0.2, caps=(None, f.headlight))
    b.lights.append(Light((round(x + 0.5 * radius, 6), y, z), (0.994988, 0.0, -0.1), (1.0, 0.93, 0.82), candela, 0.88))


def rear_lamps(b: Builder, f: Finish, x: float, z: float) -> None:
    """Add the tail light, the brake light above it, and the indicators on both sides."""
    b.box(f.taillight, (x - 0.05, -0.08, z - 0.03), (x + 0.02, 0.08, z))
    b.box(f.brakelight, (x - 0.05, -0.08, z), (x + 0.02, 0.08, z + 0.03))
    for surface, s in zip(f.indicators, (1.0, -1.0), strict=True):
        y0, y1 = sorted((s * 0.11, s * 0.17))
        b.box(f.trim, (x - 0.01, *sorted((0.0, s * 0.11))[:1], z - 0.01), (x, max(0.0, s * 0.11), z + 0.01))
        b.box(surface, (x - 0.04, y0, z - 0.02), (x + 0.01, y1, z + 0.02))
