"""Rows of adjoining buildings along the sides of a block, and the gaps (yards) in them. Lengths are in metres."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from recipe_compiler.ir.plan import Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns.network import WALK, Block
from recipe_compiler.library.towns.site import Site, beside
from recipe_compiler.library.towns.streets import StreetGrid

DEPTH = 12.0  # depth of a building
GAP = 9.0  # width of the gap in a row
_END = 22.0  # width of the building behind a dead end


@dataclass(frozen=True)
class Manner:
    """The architecture of a town's buildings."""

    storeys: tuple[int, int]  # fewest and most
    styles: tuple[int, ...] = (0, 0, 1, 1, 2, 3, 4, 5)  # facade styles; a style's probability is its share of entries
    pitched: float = 0.25  # probability of a pitched roof, for low buildings
    shops: float = 0.65  # probability of a shop on the ground floor
    awnings: float = 0.6  # probability that a shop has an awning
    alike: bool = False  # whether all buildings have the same number of storeys and the same heights
    yards: bool = True  # whether rows along y have a gap near their middle


def row(site: Site, block: Block, yaw: int, manner: Manner) -> Pose | None:
    """Add the buildings along one side of a block.

    Rows along y reach the corners of the block; rows along x fit between them.

    Returns:
        The pose of the gap, in the line of the facades, or None if the row has no gap.
    """
    name = f"{block.name}.{yaw}"
    front, length = block.side(yaw)
    corners = yaw in (0, 180)
    if not corners:
        length -= 2 * DEPTH * (len(block.sides) > 1)
    stream = site.stream("row", name)
    gap = GAP if manner.yards and corners and length > 40 else 0.0
    shift = stream.uniform(-3.0, 3.0)
    runs = [(-length / 2, shift - gap / 2), (shift + gap / 2, length / 2)] if gap else [(-length / 2, length / 2)]
    lots = []
    for k, (start, end) in enumerate(runs):
        for width in _widths(site.stream("row", name, str(k)), end - start):
            lots.append((start + width / 2, width))
            start += width
    for n, (at, width) in enumerate(lots):
        ends = (n == 0, n == len(lots) - 1)
        pose = beside(front, 0.0, at)
        _building(site, f"building.{name}.{n}", pose, width, manner, (corners and ends[1], corners and ends[0]))
    if not gap:
        return None
    yard = beside(front, 0.0, shift)
    site.tree(f"tree.{name}.yard", beside(yard, -4.0, site.stream("yard", name).uniform(-2.5, 2.5)), 8.0, (0, 3))
    return yard


def _widths(stream: Stream, length: float) -> list[float]:
    """Draw the widths of the buildings in a row, about 10 to 18 m; all but the last end on a grid of 0.5 m."""
    count = max(1, int(length / 13.5 + 0.5))
    weights = [stream.uniform(0.8, 1.2) for _ in range(count)]
    total = sum(weights)
    cuts = [0.0]
    for weight in weights[:-1]:
        cuts.append(cuts[-1] + length * weight / total)
    cuts = [int(2 * cut + 0.5) / 2 for cut in cuts] + [length]
    return [b - a for a, b in pairwise(cuts)]


def _building(site: Site, name: str, pose: Pose, width: float, manner: Manner, free: tuple[bool, bool]) -> None:
    stream = site.stream(name)
    low, high = manner.storeys
    draw = stream.unit()
    floors = (low + high) // 2 if manner.alike else low + int((high - low + 1) * draw * (0.4 + 0.6 * draw))
    style = stream.choice(manner.styles)
    storey, ground = stream.uniform(2.9, 3.3), stream.uniform(3.7, 4.3)
    if manner.alike:
        storey, ground = 3.4, 4.6
    shop = 1 if stream.unit() < manner.shops else 0
    site.add(
        name,
        "building",
        pose,
        (DEPTH, width, ground + floors * storey - storey),
        floors=floors,
        storey=storey,
        ground=ground,
        bays=max(3, int(width / stream.uniform(2.6, 3.3))),
        style=style,
        shop=shop,
        awning=1 if shop and stream.unit() < manner.awnings else 0,
        left=int(free[0]),
        right=int(free[1]),
        roof=1 if floors < 7 and style != 4 and stream.unit() < manner.pitched else 0,
        key=stream.integer(0, 63),
    )


def corner(site: Site, block: Block, manner: Manner) -> None:
    """Add a building to a block at a corner of the town, which has no sides; it faces the street along y."""
    east, north = (index == "-1" for index in block.name.split("."))  # whether the streets are there
    front, length = block.side(0 if east else 180)
    shift = (WALK / 2 - 0.2) * (-1 if east == north else 1)
    _building(site, f"building.{block.name}", beside(front, 0.0, shift), length + WALK - 0.4, manner, (True, True))


def close_yards(site: Site, yards: list[Pose]) -> None:
    """Add a wall across each gap. wall.0 is the one nearest to the point (9, 0), east of the main street's middle."""
    front = 3.0 + WALK
    for n, pose in enumerate(sorted(yards, key=lambda p: (abs(p.x - front) + abs(p.y), p.x, p.y))):
        site.add(f"wall.{n}", "wall", pose, (0.25, GAP, 2.6))


def close_streets(site: Site, streets: StreetGrid, manner: Manner) -> None:
    """Add a building behind each dead end, so that no street ends in the open."""
    (x0, x1), (y0, y1) = streets.bounds
    ends = [(f"y.{i}", x, y, yaw) for i, x in enumerate(streets.xs) for y, yaw in ((y0, 90), (y1, 270))]
    ends += [(f"x.{j}", x, y, yaw) for j, y in enumerate(streets.ys) for x, yaw in ((x0, 0), (x1, 180))]
    for name, x, y, yaw in ends:
        front = beside(Pose(x=x, y=y, yaw=yaw), -0.4, 0.0)
        _building(site, f"building.end.{name}.{yaw}", front, _END, manner, (True, True))


def shopfronts(site: Site, name: str, kerb: Pose, places: tuple[float, ...]) -> None:
    """Add café tables, boards and deliveries along the buildings of one side of a block.

    Args:
        site: The elements are added to it.
        name: The name of the side.
        kerb: The middle of its kerb, facing the street.
        places: Positions along the kerb, metres from its middle to the left.
    """
    for n, at in enumerate(places):
        draw, spot = site.stream("shopfront", name, str(n)).unit(), beside(kerb, 0.7 - WALK, at)
        if draw < 0.45:
            site.keyed(f"cafe.{name}.{n}", "cafe", spot, (1.3, 1.8, 2.4))
        elif draw < 0.55:
            site.keyed(f"board.{name}.{n}", "board", beside(spot, 0.2, 0.0, 90), (0.5, 0.62, 1.1))
        elif draw < 0.65:
            site.keyed(f"delivery.{name}.{n}", "delivery", beside(spot, -0.1, 0.0), (0.8, 1.2, 1.3))
