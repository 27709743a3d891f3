"""Suburb: detached houses in gardens along quiet streets, with fences, hedges, driveways and grass verges.

As in downtown, the main street runs along y at x = 0. A block has two rows of lots back to back, which face the
streets along y. Cars are parked on the driveways. Lengths are in metres.
"""

from __future__ import annotations

from recipe_compiler.ir.plan import Pose
from recipe_compiler.library.towns import network
from recipe_compiler.library.towns.network import Block
from recipe_compiler.library.towns.site import Site, beside, ground, skyline
from recipe_compiler.library.towns.streets import KERB, StreetGrid
from recipe_compiler.library.towns.town import Town, TownParameter

PITCH = (78.0, 108.0)  # distance between the centre lines of neighbouring streets, along x and along y
EDGE = 39.0  # distance from the outermost streets' centre lines to the outer edge of the blocks beyond them
VERGE = 2.2  # from the kerb to the near edge of the pavement
PAVED = 5.0  # from the kerb to the far edge of the pavement
GARDEN = 5.9  # from the kerb to the front fence
FRONT = 11.5  # from the kerb to the house

SUMMARY = "houses in gardens, hedges and fences, driveways for parking; the main street is along y at x = 0"
PARAMETERS: dict[str, TownParameter] = {
    "blocks": TownParameter(1, 6, (2, 2), "blocks along x and along y", 2),
    "lot": TownParameter(16, 40, 22, "width of a lot in metres"),
    "trees": TownParameter(0, 100, 60, "percentage of tree positions that have a tree"),
}


def elements(*, blocks: tuple[int, int], lot: int, trees: int) -> int:
    """Estimate the number of elements of the town."""
    nx, ny = blocks
    rows, lots = 2 * (nx + 1) * ny, int(86.0 / lot)
    return 110 + 30 * (nx + ny) + int(rows * lots * (9.5 + 0.03 * trees))


def build(seed: int, *, blocks: tuple[int, int], lot: int, trees: int) -> Town:
    """Generate the town; `PARAMETERS` describes the arguments."""
    nx, ny = blocks
    xs = tuple(PITCH[0] * (i - nx // 2) for i in range(nx + 1))
    ys = tuple(PITCH[1] * (j - (ny + 1) // 2) + PITCH[1] / 2 for j in range(ny + 1))
    streets = StreetGrid(xs, ys, (0.0,) * (nx + 1), (0.0,) * (ny + 1), EDGE)
    site, middle = Site("suburb", seed), ((xs[0] + xs[-1]) / 2, (ys[0] + ys[-1]) / 2)
    ground(site, middle)
    network.roads(site, streets, 30)
    for block in network.blocks(streets):
        network.sidewalk(site, block, PAVED - 0.5, VERGE)
        for yaw in block.sides:
            _verge(site, block, yaw, trees)
            if yaw in (0, 180):
                _lots(site, block, yaw, lot, trees)
        if not block.sides:
            _grove(site, block, trees)
    network.signals(site, streets, None, 30)
    near = ((xs[-1] - xs[0]) / 2 + EDGE + 60, (ys[-1] - ys[0]) / 2 + EDGE + 60)
    _wood(site, middle, near)
    skyline(site, middle, (near[0] + 120, near[1] + 120), 34.0)
    return Town(site.plan(), site.looks, tuple(network.spawn_points(streets)), streets, tuple(site.parking))


def _verge(site: Site, block: Block, yaw: int, trees: int) -> None:
    """Add street trees and lamps on the grass between kerb and pavement."""
    kerb, length = block.side(yaw, 0.0)
    name, half = f"{block.name}.{yaw}", length / 2 - 13.0
    for n, at in enumerate((-half, 0.0, half)):
        site.add(f"lamp.{name}.{n}", "lamp", beside(kerb, -0.6, at), (0.16, 0.16, 5.6), arm=1.3)
    count = int(2 * half / 11.0)
    for n in range(count):
        if yaw in (0, 180) and site.chance(0.6 * trees / 100, "street tree", name, str(n)):
            at = -half + 2 * half * (n + 0.5) / count
            site.tree(f"tree.{name}.street.{n}", beside(kerb, -1.2, at), 8.5, (0, 0, 3))


def _lots(site: Site, block: Block, yaw: int, lot: int, trees: int) -> None:
    """Add the lots along one side of a block."""
    kerb, length = block.side(yaw, 0.0)
    room = length - 2 * GARDEN
    count = max(1, int(room / lot))
    wide, depth = room / count, (block.x[1] - block.x[0]) / 2
    if len(block.sides) == 1 or not {0, 180} <= set(block.sides):
        depth = block.x[1] - block.x[0] - 1.0  # no lots behind
    for n in range(count):
        at = -room / 2 + wide * (n + 0.5)
        _lot(site, f"{block.name}.{yaw}.{n}", beside(kerb, 0.0, at), wide, depth, trees, n == count - 1)
    edge = beside(kerb, -(GARDEN + depth) / 2, -room / 2, 0.0)
    site.keyed(
        f"hedge.{block.name}.{yaw}.first", "hedge", beside(edge, 0.0, 0.0, 90.0), (0.8, depth - GARDEN - 0.4, 1.7)
    )


def _lot(site: Site, name: str, kerb: Pose, wide: float, depth: float, trees: int, last: bool) -> None:
    """Add one lot: house, driveway, fences and garden.

    Args:
        site: the elements are added to it.
        name: the name of the lot.
        kerb: the pose of the middle of its street side, facing the street.
        wide: its width along the street.
        depth: its depth from the kerb.
        trees: the town's parameter, percent.
        last: whether it is the last lot of its row, which ends with a hedge instead of a fence.
    """
    stream = site.stream("lot", name)
    floors = stream.choice((1, 2, 2, 2))
    garage = int(stream.unit() < 0.65)
    width = min(wide - 6.0, stream.uniform(9.5, 13.0))
    deep = stream.uniform(8.0, 10.0)
    storey = stream.uniform(2.6, 2.9)
    side = min(0.5 * (wide - width) - 1.6, stream.uniform(0.0, 2.0))
    setback = FRONT + stream.uniform(0.0, 1.5)
    house = beside(kerb, -setback, side)
    site.add(
        f"house.{name}", "house", house, (deep, width, floors * storey + 0.3),
        floors=floors, storey=storey, roof=stream.choice((0, 0, 1, 2)), pitch=stream.uniform(0.55, 0.85),
        style=stream.choice((0, 1, 2)), garage=garage, porch=int(stream.unit() < 0.5), key=stream.integer(0, 63),
    )  # fmt: skip
    gate = side - width / 2 + 1.85 if garage else side - width / 2 - 1.5
    _driveway(site, name, kerb, gate, setback + (0.0 if garage else 3.0))
    walk = side + stream.uniform(0.5, 1.5)
    _garden(site, name, kerb, (wide, setback, deep), (gate, walk), trees)
    style = stream.choice((0, 0, 1, 2))
    _front(site, name, kerb, wide, (gate - 1.7, gate + 1.7), style)
    far = beside(kerb, -(GARDEN + depth) / 2, wide / 2, 90.0)
    if last:
        site.keyed(f"hedge.{name}.side", "hedge", far, (0.8, depth - GARDEN - 0.4, 1.7))
    else:
        back = beside(kerb, -(setback + depth) / 2, wide / 2, 90.0)
        site.add(f"fence.{name}.side", "fence", back, (0.08, depth - setback - 0.4, 1.7), style=2)


def _driveway(site: Site, name: str, kerb: Pose, gate: float, far: float) -> None:
    """Add a concrete driveway and its parking place.

    Args:
        site: the elements are added to it.
        name: the name of the lot.
        kerb: the pose of the middle of the lot's street side.
        gate: the position of the driveway's middle along the street, from `kerb` to the left.
        far: the distance of its far end from the kerb.
    """
    near = 0.16
    flat = beside(kerb, -(near + far) / 2, gate)
    site.add(f"path.{name}.drive", "path", flat, (far - near, 3.0, 0.006), drive=1)
    site.parking.append(beside(kerb, -(far - 3.2), gate, 0.0 if site.chance(0.3, "parked", name) else 180.0))


def _front(site: Site, name: str, kerb: Pose, wide: float, gap: tuple[float, float], style: int) -> None:
    """Add a fence or a hedge along the sidewalk, with a gap at the driveway."""
    hedge = site.chance(0.4, "front", name)
    for n, (a, b) in enumerate(((-wide / 2 + 0.3, gap[0]), (gap[1], wide / 2 - 0.3))):
        if b - a < 0.8:
            continue
        line = beside(kerb, -GARDEN, (a + b) / 2)
        if hedge:
            site.keyed(f"hedge.{name}.front.{n}", "hedge", line, (0.6, b - a, 1.0))
        else:
            site.add(f"fence.{name}.front.{n}", "fence", line, (0.08, b - a, 1.0), style=style % 2)


def _garden(
    site: Site, name: str, kerb: Pose, sizes: tuple[float, float, float], ways: tuple[float, float], trees: int
) -> None:
    """Add trees in front of and behind the house, and bushes along its front."""
    wide, setback, deep = sizes
    stream = site.stream("garden", name)
    left = max(ways) + 2.6
    spots = ((-(setback - 3.4), min(left, wide / 2 - 1.5)), (-(setback + deep + 5.5), stream.uniform(-4.0, 4.0)))
    for n, (out, at) in enumerate(spots):
        if site.chance(trees / 100, "tree", name, str(n)):
            site.tree(f"tree.{name}.{n}", beside(kerb, out, at), 9.0 if n else 6.0, (0, 0, 1, 3, 4))
    for n in range(2):
        size = stream.uniform(0.9, 1.3)
        at = wide / 2 - 1.2 - 1.5 * n
        if at > max(ways) + 3.0 and site.chance(0.7, "bush", name, str(n)):
            place = beside(kerb, -(setback - 0.8), min(at, wide / 2 - 1.0))
            site.keyed(f"bush.{name}.{n}", "bush", place, (size, size, 0.85 * size))


def _grove(site: Site, block: Block, trees: int) -> None:
    """Add trees to a corner block, which has no lots."""
    for n in range(6):
        if site.chance(trees / 100, "grove", block.name, str(n)):
            at = Pose(x=block.middle.x + 9.0 * (n % 3 - 1), y=block.middle.y + 8.0 * (n // 3) - 4.0, z=KERB)
            site.tree(f"tree.{block.name}.grove.{n}", at, 10.0, (0, 1, 2, 3, 4))


def _wood(site: Site, middle: tuple[float, float], near: tuple[float, float]) -> None:
    """Add trees around the suburb, in front of the skyline."""
    for n in range(48):
        stream = site.stream("wood", str(n))
        along, out = stream.uniform(-1.0, 1.0), stream.uniform(0.0, 40.0) - 45.0
        side = n % 4
        x, y = (along * near[0], near[1] + out) if side % 2 else (near[0] + out, along * near[1])
        sign = 1 if side < 2 else -1
        site.tree(f"tree.wood.{n}", Pose(x=middle[0] + sign * x, y=middle[1] + sign * y), 14.0, (0, 0, 1, 2, 3, 4))
