"""Plaza: a paved square with a fountain, trees and benches, surrounded by stone facades.

The square is centred on (0, 0) and surrounded by four streets with parking. Pedestrians cross it along the lines of a
lattice, whose cells hold the trees and the furniture (see `square`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from recipe_compiler.ir.plan import Pose
from recipe_compiler.library.towns import network
from recipe_compiler.library.towns.network import WALK, Block
from recipe_compiler.library.towns.rows import Manner, close_streets, corner, row, shopfronts
from recipe_compiler.library.towns.site import Site, beside, ground, skyline
from recipe_compiler.library.towns.square import SquareGrid, lines
from recipe_compiler.library.towns.streets import BAY, KERB, LANE
from recipe_compiler.library.towns.town import SpawnPoint, Town, TownParameter

EDGE = 29.3  # distance from the streets' centre lines to the outer edge of the blocks beyond them, metres

SUMMARY = "a paved square around the origin with a fountain, which people cross; shops and parking around it"
PARAMETERS: dict[str, TownParameter] = {
    "size": TownParameter(40, 120, (64, 52), "size of the square along x and along y, metres", 2),
    "storeys": TownParameter(2, 8, 4, "storeys of the surrounding buildings"),
    "trees": TownParameter(0, 100, 80, "percentage of tree positions that have a tree"),
}


def elements(*, size: tuple[int, int], storeys: int, trees: int) -> int:
    """Estimate the number of elements of the town."""
    return 190 + int((size[0] + size[1]) * 1.0 + size[0] * size[1] / 60.0)


def build(seed: int, *, size: tuple[int, int], storeys: int, trees: int) -> Town:
    """Generate the town; `PARAMETERS` describes the arguments."""
    kerb = LANE + BAY
    half = (size[0] / 2, size[1] / 2)
    xs, ys = (-half[0] - kerb, half[0] + kerb), (-half[1] - kerb, half[1] + kerb)
    streets = SquareGrid(xs, ys, (BAY, BAY), (BAY, BAY), EDGE, half)
    site = Site("plaza", seed)
    ground(site, (0.0, 0.0))
    network.roads(site, streets, 20)
    manner = Manner((storeys, storeys), (5, 5, 1), 0.6, 1.0, 0.15, alike=True, yards=False)
    for block in network.blocks(streets):
        inner = block.name == "0.0"
        network.sidewalk(site, block, 2.0 if inner else WALK, paved=inner)
        if not inner:
            for yaw in block.sides:
                row(site, block, yaw, manner)
                _sidewalk(site, block, yaw)
            if not block.sides:
                corner(site, block, manner)
    _square(site, half, trees)
    close_streets(site, streets, manner)
    network.signals(site, streets, None, 20)
    skyline(site, (0.0, 0.0), (xs[1] + EDGE + 42, ys[1] + EDGE + 42))
    points = (*_on_square(half), *network.spawn_points(streets))
    return Town(site.plan(), site.looks, points, streets, tuple(site.parking))


def _sidewalk(site: Site, block: Block, yaw: int) -> None:
    """Add lamps and bins on the sidewalk along one side of a block."""
    kerb, length = block.side(yaw, 0.0)
    name, count = f"{block.name}.{yaw}", max(2, int(length / 18.0))
    for n in range(count):
        at = length * ((n + 0.5) / count - 0.5)
        site.add(f"lamp.{name}.{n}", "lamp", beside(kerb, -0.45, at), (0.16, 0.16, 5.6), arm=1.3)
    site.add(f"bin.{name}", "bin", beside(kerb, -0.6, 3.0), (0.42, 0.42, 0.95))
    site.keyed(f"bicycles.{name}", "bicycles", beside(kerb, -1.1, 6.0, 90), (1.9, 1.8, 1.1))
    shopfronts(site, name, kerb, tuple(2.4 * n - 12.0 for n in range(11)))


def _square(site: Site, half: tuple[float, float], trees: int) -> None:
    """Add the square's elements: the fountain in the middle, those along its edges, and those in the lattice cells."""
    site.add("fountain", "fountain", Pose(z=KERB), (7.0, 7.0, 2.6))
    for yaw, reach, length in (
        (0, half[0], half[1]),
        (180, half[0], half[1]),
        (90, half[1], half[0]),
        (270, half[1], half[0]),
    ):
        _rim(site, yaw, reach, 2 * length, trees)
    columns, lanes = lines(half[0]), lines(half[1])
    for i, (x0, x1) in enumerate(pairwise(columns)):
        for j, (y0, y1) in enumerate(pairwise(lanes)):
            x, y = (x0 + x1) / 2, (y0 + y1) / 2
            if min(x1 - x0, y1 - y0) < 4.4 or (abs(x) < 1.0 and abs(y) < 1.0):
                continue
            ring = min(i, j, len(columns) - 2 - i, len(lanes) - 2 - j)
            middle = Pose(x=x, y=y, z=KERB)
            if _cell(site, f"{i}.{j}", middle, ring, trees) and (i + j) % 2 == 0:
                lamp = beside(middle, 0.0, -0.8)
                site.add(f"lamp.cell.{i}.{j}", "lamp", lamp, (0.16, 0.16, 4.6), arm=0.9)


def _rim(site: Site, yaw: int, reach: float, length: float, trees: int) -> None:
    """Add bollards, lamps and trees along one edge of the square, within 1.5 m of its kerb."""
    edge = beside(Pose(z=KERB, yaw=yaw), reach, 0.0)
    count = int((length - 16.0) / 3.0)
    for n in range(count + 1):
        at = (length - 16.0) * (n / count - 0.5)
        if n % 4 == 2:
            site.add(f"lamp.square.{yaw}.{n}", "lamp", beside(edge, -1.1, at, 180.0), (0.16, 0.16, 4.6), arm=0.9)
        elif n % 4 == 0 and site.chance(trees / 100, "rim", str(yaw), str(n)):
            site.tree(f"tree.square.{yaw}.{n}", beside(edge, -1.1, at), 7.5)
        else:
            site.add(f"bollard.square.{yaw}.{n}", "bollard", beside(edge, -0.5, at), (0.2, 0.2, 0.9))


def _cell(site: Site, name: str, middle: Pose, ring: int, trees: int) -> bool:
    """Add the elements of one lattice cell, at least 1.4 m from its lines; return whether there is room for a lamp.

    Args:
        site: the elements are added to it.
        name: the key of the cell's random draws.
        middle: the middle of the cell.
        ring: number of cells between this one and the nearest edge of the square.
        trees: the town's parameter, percent.
    """
    stream = site.stream("cell", name)
    toward = Pose(x=middle.x, y=middle.y, z=KERB, yaw=90.0 * stream.integer(0, 3))
    draw = stream.unit()
    if draw < (0.55 if ring == 0 else 0.3) * trees / 100:
        site.tree(f"tree.cell.{name}", toward, 7.0, (0, 0, 2))
        site.add(f"bench.cell.{name}", "bench", beside(toward, 1.1, 0.0), (0.5, 1.6, 0.85))
        return False
    if draw < 0.62:
        site.keyed(f"planter.cell.{name}", "planter", toward, (1.2, 1.2, 0.9))
        for n, out in enumerate((1.15, -1.15)):
            if stream.unit() < 0.7:
                bench = beside(toward, out, 0.0, 0.0 if out > 0 else 180.0)
                site.add(f"bench.cell.{name}.{n}", "bench", bench, (0.5, 1.6, 0.85))
    elif draw < 0.68 and ring == 0:
        site.keyed(f"kiosk.cell.{name}", "kiosk", toward, (2.5, 3.0, 2.8))
        return False
    elif draw < 0.74:
        site.keyed(f"statue.cell.{name}", "statue", toward, (2.0, 2.0, 4.5))
        return False
    elif draw < 0.85:
        site.add(f"bench.cell.{name}", "bench", toward, (0.5, 1.6, 0.85))
        site.add(f"bin.cell.{name}", "bin", beside(toward, 0.0, 1.25), (0.42, 0.42, 0.95))
    return True


def _on_square(half: tuple[float, float]) -> Iterator[SpawnPoint]:
    """Yield pedestrian spawn points midway between neighbouring nodes of the lattice."""
    columns, lanes = lines(half[0]), lines(half[1])
    for i, x in enumerate(columns):
        for j, (a, b) in enumerate(pairwise(lanes)):
            yield SpawnPoint("pedestrian", Pose(x=x, y=(a + b) / 2, z=KERB, yaw=90 if (i + j) % 2 else 270))
    for j, y in enumerate(lanes):
        for i, (a, b) in enumerate(pairwise(columns)):
            yield SpawnPoint("pedestrian", Pose(x=(a + b) / 2, y=y, z=KERB, yaw=0 if (i + j) % 2 else 180))
