"""Downtown: blocks of buildings on a grid of two-lane streets.

The main street runs along y, centred on x = 0, and has parking bays on its sidewalks, beside each block's middle; the
other streets have parking bays along both kerbs. The two nearest cross streets are centred on y = -36 and y = 36, so
the sidewalks of the main street (3 < |x| < 9) are uninterrupted for |y| < 25. All lengths are in metres.
"""

from __future__ import annotations

from recipe_compiler.ir.plan import Pose
from recipe_compiler.library.towns import network
from recipe_compiler.library.towns.network import Block
from recipe_compiler.library.towns.rows import Manner, close_streets, close_yards, corner, row, shopfronts
from recipe_compiler.library.towns.site import Site, beside, ground, skyline
from recipe_compiler.library.towns.streets import BAY, LANE, StreetGrid
from recipe_compiler.library.towns.town import Town, TownParameter

PITCH = 72.0  # distance between the centre lines of neighbouring streets
EDGE = 29.3  # distance from the outermost streets' centre lines to the outer edge of the blocks beyond them

SUMMARY = (
    "closed rows of buildings, traffic lights along the main street, which is along y at x = 0, and "
    "parking bays: on its sidewalks, and along the other streets"
)
PARAMETERS: dict[str, TownParameter] = {
    "blocks": TownParameter(1, 9, (3, 3), "blocks along x and along y", 2),
    "storeys": TownParameter(2, 16, (4, 9), "storeys of the lowest and of the highest buildings", 2, rising=True),
}


def elements(*, blocks: tuple[int, int], storeys: tuple[int, int]) -> int:
    """Estimate the number of elements of the town."""
    nx, ny = blocks
    return 82 + 45 * (nx + ny) + 62 * nx * ny


def build(seed: int, *, blocks: tuple[int, int], storeys: tuple[int, int]) -> Town:
    """Generate the town; `PARAMETERS` describes the arguments."""
    nx, ny = blocks
    xs = tuple(PITCH * (i - nx // 2) for i in range(nx + 1))
    ys = tuple(PITCH * (j - (ny + 1) // 2) + PITCH / 2 for j in range(ny + 1))
    main = nx // 2
    streets = StreetGrid(xs, ys, tuple(0.0 if i == main else BAY for i in range(nx + 1)), (BAY,) * (ny + 1), EDGE)
    site, manner = Site("downtown", seed), Manner(storeys)
    middle = ((xs[0] + xs[-1]) / 2, (ys[0] + ys[-1]) / 2)
    ground(site, middle)
    network.roads(site, streets, 30)
    yards = []
    for block in network.blocks(streets):
        network.sidewalk(site, block)
        for yaw in block.sides:
            yard = row(site, block, yaw, manner)
            yards += [yard] if yard else []
            _furniture(site, block, yaw)
        if not block.sides:
            corner(site, block, manner)
    close_yards(site, yards)
    close_streets(site, streets, manner)
    network.signals(site, streets, main, 30)
    skyline(site, middle, ((xs[-1] - xs[0]) / 2 + EDGE + 42, (ys[-1] - ys[0]) / 2 + EDGE + 42))
    points = tuple(network.spawn_points(streets))
    return Town(site.plan(), site.looks, points, streets, tuple(site.parking))


# Positions of street furniture along a sidewalk, from the middle of the block's side. The middle stays free.
_LAMPS = (-15.5, 15.5)
_TREES = (-22.0, -11.5, 11.5, 20.0)
_BENCHES = (-17.5, 18.0)
_BINS = (-13.5, 14.0)
_MAIN_BAYS = (-6.3, 6.3)  # on the main street, each before a tree
_CAFES = (-19.0, -16.6, 15.0, 17.4)


def _furniture(site: Site, block: Block, yaw: int) -> None:
    """Place the street furniture along one side of a block, all of it within two metres of the kerb."""
    name = f"{block.name}.{yaw}"
    kerb, _ = block.side(yaw, 0.0)

    def place(at: float, from_kerb: float, turn: float = 0.0) -> Pose:
        return beside(kerb, -from_kerb, at, turn)

    for n, at in enumerate(_LAMPS):
        site.add(f"lamp.{name}.{n}", "lamp", place(at, 0.45), (0.16, 0.16, 6.5), arm=1.6)
    for n, at in enumerate(_TREES):
        if (yaw in (0, 180) and len(block.sides) > 1 and n != 3) or n == 1:
            site.tree(f"tree.{name}.{n}", place(at, 0.7), 7.0)
    for n, at in enumerate(_BENCHES):
        if site.chance(0.5, "bench", name, str(n)):
            site.add(f"bench.{name}.{n}", "bench", place(at, 0.9, 180), (0.5, 1.6, 0.85))
    for n, at in enumerate(_BINS):
        if site.chance(0.45, "bin", name, str(n)):
            site.add(f"bin.{name}.{n}", "bin", place(at, 0.6), (0.42, 0.42, 0.95))
    if site.chance(0.5, "hydrant", name):
        site.add(f"hydrant.{name}", "hydrant", place(-19.6, 0.6), (0.3, 0.3, 0.8))
    if yaw in (0, 180) and site.chance(0.3, "bus_stop", name):
        site.add(f"bus_stop.{name}", "bus_stop", place(22.4, 1.4), (1.6, 4.0, 2.6))
    elif site.chance(0.4, "planter", name):
        site.keyed(f"planter.{name}", "planter", place(22.0, 1.0), (1.2, 1.2, 0.9))
    if site.chance(0.4, "bicycles", name):
        site.keyed(f"bicycles.{name}", "bicycles", place(-25.0, 1.1, 90), (1.9, 1.8, 1.1))
    if site.chance(0.35, "letter_box", name):
        site.add(f"letter_box.{name}", "letter_box", place(25.5, 0.7, 180), (0.4, 0.44, 1.3))
    if abs(kerb.x) == LANE:  # the main street
        for n, at in enumerate(_MAIN_BAYS):
            network.kerbside_parking(site, f"{name}.{n}", kerb, at, 1)
    shopfronts(site, name, kerb, _CAFES)
