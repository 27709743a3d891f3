"""Downtown: blocks of houses on a grid of two-lane streets.

The main street runs along y, centred on x = 0. Of the streets that cross it the nearest two are centred on
y = -36 and y = 36, so for |y| < 25 its sidewalks, 3 < |x| < 9, run without a break. Every draw is keyed by the name
of what it shapes, so no element shifts another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from recipe_compiler import exact
from recipe_compiler.plan import Element, Pose, TownPlan
from recipe_compiler.streams import Stream
from recipe_compiler.towns import palettes
from recipe_compiler.towns.streets import CORNER, FRONT, KERB, LANE, TURN, WALK, StreetGrid
from recipe_compiler.towns.town import Parameter, SpawnPoint, Town

PITCH = 72.0  # from street to street
DEPTH = 12.0  # of a building
OUTER = 24.0  # depth of the blocks beyond the outermost streets
GAP = 9.0  # width of the yard between two buildings

PARAMETERS: dict[str, Parameter] = {
    "blocks": Parameter(1, 9, 2, (3, 3), "blocks along x and along y"),
}


@dataclass
class _Site:
    """The town while it is being laid out."""

    seed: int
    elements: list[Element] = field(default_factory=list)
    looks: dict[str, dict[str, str]] = field(default_factory=dict)
    yards: list[Pose] = field(default_factory=list)  # where a wall closes a gap between two buildings

    def stream(self, *names: str) -> Stream:
        return Stream(self.seed, "town", *names)

    def add(self, name: str, kind: str, pose: Pose, size: tuple[float, float, float], **shape: float) -> None:
        """One more element, with colours drawn for its kind."""
        self.elements.append(Element(name=name, kind=kind, pose=pose, size=size, shape=shape))
        self.looks[name] = palettes.look(kind, self.stream(name, "look"))


@dataclass(frozen=True)
class _Block:
    """A rectangle between streets, and those of its sides (a yaw each) that face one."""

    name: str
    x: tuple[float, float]
    y: tuple[float, float]
    sides: tuple[int, ...]

    def side(self, yaw: int) -> tuple[float, float, float]:
        """Middle of a side's building front, and the length of that front."""
        s, c = exact.sin_cos_deg(yaw)
        half_x, half_y = (self.x[1] - self.x[0]) / 2, (self.y[1] - self.y[0]) / 2
        walk = FRONT - LANE
        x = (self.x[0] + self.x[1]) / 2 + c * (half_x - walk)
        y = (self.y[0] + self.y[1]) / 2 + s * (half_y - walk)
        return x, y, 2 * ((half_y if c else half_x) - walk)


def elements(*, blocks: tuple[int, int]) -> int:
    """About how many elements such a town has."""
    nx, ny = blocks
    return 70 + 16 * (nx + ny) + 50 * nx * ny


def build(seed: int, *, blocks: tuple[int, int]) -> Town:
    """The town with that many blocks along x and along y."""
    nx, ny = blocks
    xs = tuple(PITCH * (i - nx // 2) for i in range(nx + 1))
    ys = tuple(PITCH * (j - (ny + 1) // 2) + PITCH / 2 for j in range(ny + 1))
    streets = StreetGrid(xs, ys, LANE + OUTER)
    site = _Site(seed)
    _ground(site, streets)
    _carriageways(site, streets)
    for block in _blocks(streets):
        _block(site, block)
    _walls(site)
    _skyline(site, streets)
    plan = TownPlan(name="downtown", elements=tuple(site.elements))
    return Town(plan, site.looks, tuple(_spawn_points(streets)), streets)


def _ground(site: _Site, streets: StreetGrid) -> None:
    x, y = (streets.xs[0] + streets.xs[-1]) / 2, (streets.ys[0] + streets.ys[-1]) / 2
    site.add("ground", "ground", Pose(x=x, y=y), (2400.0, 2400.0, 0.05))


def _carriageways(site: _Site, streets: StreetGrid) -> None:
    for i, x in enumerate(streets.xs):
        for j, (a, b) in enumerate(pairwise(streets.ys)):
            pose = Pose(x=x, y=(a + b) / 2, yaw=90)
            site.add(f"road.y.{i}.{j}", "road", pose, (b - a - 2 * TURN, 2 * LANE, 0.0), stop=FRONT - TURN)
    for j, y in enumerate(streets.ys):
        for i, (a, b) in enumerate(pairwise(streets.xs)):
            pose = Pose(x=(a + b) / 2, y=y)
            site.add(f"road.x.{i}.{j}", "road", pose, (b - a - 2 * TURN, 2 * LANE, 0.0), stop=FRONT - TURN)
    for i, x in enumerate(streets.xs):
        for j, y in enumerate(streets.ys):
            zebra = {"zebra_from": WALK - 1.5, "zebra_to": WALK + 1.5, "lane": LANE}
            site.add(f"junction.{i}.{j}", "junction", Pose(x=x, y=y), (2 * TURN, 2 * TURN, 0.0), **zebra)


def _blocks(streets: StreetGrid) -> Iterator[_Block]:
    """All blocks: those between streets, and the shallow ones beyond the outermost."""

    def spans(lines: tuple[float, ...]) -> list[tuple[float, float]]:
        inner = [(a + LANE, b - LANE) for a, b in pairwise(lines)]
        return [(lines[0] - LANE - OUTER, lines[0] - LANE), *inner, (lines[-1] + LANE, lines[-1] + LANE + OUTER)]

    across, along = spans(streets.xs), spans(streets.ys)
    for i, x in enumerate(across):
        for j, y in enumerate(along):
            east, west = i < len(across) - 1, i > 0
            north, south = j < len(along) - 1, j > 0
            inner_x, inner_y = east and west, north and south
            sides = [
                yaw
                for yaw, there in ((0, east and inner_y), (180, west and inner_y), (90, north), (270, south))
                if there and (inner_x or yaw in (0, 180))
            ]
            yield _Block(f"{i - 1}.{j - 1}", x, y, tuple(sides))


def _block(site: _Site, block: _Block) -> None:
    pose = Pose(x=(block.x[0] + block.x[1]) / 2, y=(block.y[0] + block.y[1]) / 2)
    size = (block.x[1] - block.x[0], block.y[1] - block.y[0], KERB)
    site.add(f"sidewalk.{block.name}", "sidewalk", pose, size, radius=CORNER, walk=FRONT - LANE)
    for yaw in block.sides:
        _row(site, block, yaw)
        _furniture(site, block, yaw)


def _widths(stream: Stream, length: float) -> list[float]:
    """Widths of the buildings in a row, between 10 and 18 metres, on a grid of half metres."""
    count = max(1, int(length / 13.5 + 0.5))
    weights = [stream.uniform(0.8, 1.2) for _ in range(count)]
    total = sum(weights)
    cuts = [0.0]
    for weight in weights[:-1]:
        cuts.append(cuts[-1] + length * weight / total)
    cuts = [int(2 * cut + 0.5) / 2 for cut in cuts] + [length]
    return [b - a for a, b in pairwise(cuts)]


def _row(site: _Site, block: _Block, yaw: int) -> None:
    """The buildings along one side of a block. Sides along y reach the corners; those along x fit between."""
    name = f"{block.name}.{yaw}"
    x, y, length = block.side(yaw)
    s, c = exact.sin_cos_deg(yaw)
    corners = yaw in (0, 180)
    if not corners:
        length -= 2 * DEPTH * (len(block.sides) > 1)
    stream = site.stream("row", name)
    gap = GAP if corners and length > 40 else 0.0
    shift = stream.uniform(-3.0, 3.0)
    runs = [(-length / 2, shift - gap / 2), (shift + gap / 2, length / 2)] if gap else [(-length / 2, length / 2)]
    lots = []
    for k, (start, end) in enumerate(runs):
        for width in _widths(site.stream("row", name, str(k)), end - start):
            lots.append((start + width / 2, width))
            start += width
    for n, (at, width) in enumerate(lots):
        ends = (n == 0, n == len(lots) - 1)
        pose = Pose(x=x - s * at, y=y + c * at, z=KERB, yaw=yaw)
        _building(site, f"building.{name}.{n}", pose, width, corners and ends[1], corners and ends[0])
    if gap:
        _yard(site, name, Pose(x=x - s * shift, y=y + c * shift, z=KERB, yaw=yaw))


def _building(site: _Site, name: str, pose: Pose, width: float, left: bool, right: bool) -> None:
    stream = site.stream(name)
    floors = stream.choice((3, 3, 4, 4, 5, 5, 6, 7, 8, 9))
    style = stream.integer(0, 3)  # brick, plaster, concrete, plaster with balconies
    storey, ground = stream.uniform(2.9, 3.3), stream.uniform(3.7, 4.3)
    shop = 1 if stream.unit() < 0.65 else 0
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
        awning=1 if shop and stream.unit() < 0.6 else 0,
        left=int(left),
        right=int(right),
        key=stream.integer(0, 63),
    )


def _yard(site: _Site, name: str, pose: Pose) -> None:
    """A gap between two buildings, with a tree; a wall will close it."""
    site.yards.append(pose)
    aside = site.stream("yard", name).uniform(-2.5, 2.5)
    s, c = exact.sin_cos_deg(pose.yaw)
    x, y = pose.x - c * 4.0 - s * aside, pose.y - s * 4.0 + c * aside
    _tree(site, f"tree.{name}.yard", Pose(x=x, y=y, z=KERB), 8.0)


def _walls(site: _Site) -> None:
    """Walls, counted outwards from wall.0, which closes the gap east of the middle of the main street."""
    for n, pose in enumerate(sorted(site.yards, key=lambda p: (abs(p.x - FRONT) + abs(p.y), p.x, p.y))):
        site.add(f"wall.{n}", "wall", pose, (0.25, GAP, 2.6))


def _tree(site: _Site, name: str, pose: Pose, tallest: float) -> None:
    stream = site.stream(name)
    height = stream.uniform(0.75, 1.0) * tallest
    radius = height * stream.uniform(0.24, 0.3)
    site.add(
        name,
        "tree",
        Pose(x=pose.x, y=pose.y, z=pose.z, yaw=stream.uniform(0, 360)),
        (2 * radius, 2 * radius, height),
        trunk=0.07 + 0.012 * height,
        key=stream.integer(0, 1 << 20),
    )


# Along a sidewalk, measured from the middle of the block's side: what stands there. The middle is left free.
_LAMPS = (-15.5, 15.5)
_TREES = (-22.0, -11.5, 11.5, 20.0)
_BENCHES = (-17.5, 18.0)
_BINS = (-13.5, 14.0)


def _furniture(site: _Site, block: _Block, yaw: int) -> None:
    """Lamps, trees, benches and bins along one side of a block, all within a metre of the kerb."""
    name = f"{block.name}.{yaw}"
    x, y, _ = block.side(yaw)
    s, c = exact.sin_cos_deg(yaw)

    def place(at: float, from_kerb: float, turn: float) -> Pose:
        out = FRONT - LANE - from_kerb
        return Pose(x=x + c * out - s * at, y=y + s * out + c * at, z=KERB, yaw=(yaw + turn) % 360)

    for n, at in enumerate(_LAMPS):
        site.add(f"lamp.{name}.{n}", "lamp", place(at, 0.45, 0), (0.16, 0.16, 6.5), arm=1.6)
    for n, at in enumerate(_TREES):
        if (yaw in (0, 180) and len(block.sides) > 1) or n == 1:
            _tree(site, f"tree.{name}.{n}", place(at, 0.7, 0), 7.0)
    for n, at in enumerate(_BENCHES):
        if site.stream("bench", name, str(n)).unit() < 0.6:
            site.add(f"bench.{name}.{n}", "bench", place(at, 0.9, 180), (0.5, 1.6, 0.85))
    for n, at in enumerate(_BINS):
        if site.stream("bin", name, str(n)).unit() < 0.6:
            site.add(f"bin.{name}.{n}", "bin", place(at, 0.6, 0), (0.42, 0.42, 0.95))


def _skyline(site: _Site, streets: StreetGrid) -> None:
    """Tall plain buildings far out, so that no street ends in nothing."""
    x, y = (streets.xs[0] + streets.xs[-1]) / 2, (streets.ys[0] + streets.ys[-1]) / 2
    near_x = (streets.xs[-1] - streets.xs[0]) / 2 + OUTER + 45
    near_y = (streets.ys[-1] - streets.ys[0]) / 2 + OUTER + 45
    for n in range(56):
        stream = site.stream(f"skyline.{n}")
        angle = (n + stream.uniform(0.2, 0.8)) * 360 / 56
        s, c = exact.sin_cos_deg(angle)
        size = (stream.uniform(16, 30), stream.uniform(20, 40), stream.uniform(14, 52))
        # on a rectangle around the town, at one of three depths
        reach = min(near_x / max(abs(c), 1e-9), near_y / max(abs(s), 1e-9)) + stream.choice((15, 60, 110))
        facing = 180 + 90 * int(angle / 90 + 0.5)
        pose = Pose(x=x + reach * c, y=y + reach * s, yaw=facing % 360)
        site.add(f"skyline.{n}", "tower", pose, size, key=stream.integer(0, 63))


def _spawn_points(streets: StreetGrid) -> Iterator[SpawnPoint]:
    """Vehicles in mid-lane, pedestrians in mid-sidewalk, along every stretch between two junctions."""
    cars, walkers = (-20.0, -8.0, 4.0, 16.0), (-21.0, -14.0, -7.0, 0.0, 7.0, 14.0, 21.0)

    def along(lines: tuple[float, ...], middles: list[float], is_y: bool) -> Iterator[SpawnPoint]:
        for line in lines:
            for middle in middles:
                for sign in (1, -1):  # +1 goes towards greater coordinates, on the right
                    yaw = (90 if sign > 0 else 270) if is_y else (0 if sign > 0 else 180)
                    aside = sign if is_y else -sign
                    for at in cars:
                        u, v = line + aside * LANE / 2, middle + sign * at
                        yield SpawnPoint("vehicle", Pose(x=u, y=v, yaw=yaw) if is_y else Pose(x=v, y=u, yaw=yaw))
                    for n, at in enumerate(walkers):
                        u, v, turned = line + aside * WALK, middle + at, (yaw + 180 * (n % 2)) % 360
                        pose = Pose(x=u, y=v, z=KERB, yaw=turned) if is_y else Pose(x=v, y=u, z=KERB, yaw=turned)
                        yield SpawnPoint("pedestrian", pose)

    yield from along(streets.xs, _middles(streets.ys), True)
    yield from along(streets.ys, _middles(streets.xs), False)


def _middles(lines: tuple[float, ...]) -> list[float]:
    return [(a + b) / 2 for a, b in pairwise(lines)]
