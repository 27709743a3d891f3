"""Highway: a straight motorway along y with its median at x = 0, and a footpath on its east side.

Traffic towards +y drives at x > 0. From the median outwards, each carriageway has the median's guard rail, a narrow
strip, the lanes, a hard shoulder, a guard rail and a verge. Lengths are in metres. In this module, `heading` is the
direction of travel of a carriageway, 90 or 270 degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Point, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns.network import FACES
from recipe_compiler.library.towns.site import Site, beside, ground
from recipe_compiler.library.towns.streets import until
from recipe_compiler.library.towns.town import Span, SpawnPoint, Town, TownParameter

LANE = 3.6  # width
SHOULDER = 2.6  # width
STRIP = 0.8  # width
MEDIAN = 1.5  # half the median's width
LIMIT = 120  # speed limit, km/h
STRETCH = 48.0  # length of one element of carriageway and guard rail
BEYOND = 288.0  # length of the road beyond both ends of its middle part
PATH = 8.0  # from the edge of the asphalt to the middle of the footpath

SUMMARY = (
    "a motorway along y, with a median barrier at x = 0, gantries and a footpath beside it; faster "
    "traffic, no bicycles, no parking"
)
PARAMETERS: dict[str, TownParameter] = {
    "lanes": TownParameter(2, 5, 3, "lanes in each direction"),
    "length": TownParameter(2, 20, 6, "length of the section where traffic may start, in hundreds of metres"),
    "gantries": TownParameter(150, 900, 240, "distance between gantries, metres"),
}


@dataclass(frozen=True)
class Motorway:
    """Two carriageways along y, and a footpath next to them."""

    lanes: int  # per direction
    half: float  # half the length over which traffic may start, metres

    @property
    def edge(self) -> float:
        """Distance from the middle of the median to the outer edges of the asphalt."""
        return MEDIAN + STRIP + self.lanes * LANE + SHOULDER

    @property
    def path(self) -> float:
        """x of the footpath's middle."""
        return self.edge + PATH

    @property
    def bounds(self) -> tuple[Span, Span]:
        """The ranges of x and of y that the town covers."""
        return (-self.path - 10.0, self.path + 10.0), (-self.half - BEYOND, self.half + BEYOND)

    def lane(self, n: int) -> float:
        """Distance from the middle of the median to the middle of lane `n`; lane 0 is next to the median."""
        return MEDIAN + STRIP + LANE * (n + 0.5)

    def ground(self, x: float, y: float) -> float:
        """Height of the ground, 0 everywhere."""
        return 0.0

    def lane_yaw(self, x: float, y: float) -> float:
        """Direction of the traffic on the carriageway where a point is, degrees."""
        return 90.0 if x >= 0 else 270.0

    def drive(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Route straight ahead in the starting lane, to the end of the road."""
        way = 1.0 if exact.sin_deg(start.yaw) >= 0 else -1.0
        return until((start.x, start.y), [(start.x, way * (self.half + BEYOND))], length_m)

    def entry(self, start: Pose) -> Pose | None:
        """The beginning of the lane where a vehicle starts."""
        way = 1.0 if exact.sin_deg(start.yaw) >= 0 else -1.0
        return Pose(x=start.x, y=-way * (self.half + BEYOND), yaw=start.yaw)

    def walk(self, start: Pose, length_m: float, stream: Stream) -> tuple[Point, ...]:
        """Route along the footpath, turning back at its ends."""
        way = 1.0 if exact.sin_deg(start.yaw) >= 0 else -1.0
        x, points, left, y = self.path + stream.uniform(-0.7, 0.7), [], length_m, start.y
        points.append((x, start.y + way * 2.0))
        while left > 0 and len(points) < 1_000:
            points.append((x, way * self.half))
            left -= abs(way * self.half - y)
            y, way = way * self.half, -way
        return until((start.x, start.y), points, length_m)


def elements(*, lanes: int, length: int, gantries: int) -> int:
    """Estimate the number of elements of the town."""
    metres = 100.0 * length + 2 * BEYOND
    return 90 + int(metres / STRETCH * 5 + metres / 40 * 3 + metres / 7.0 + 2 * 100 * length / gantries)


def build(seed: int, *, lanes: int, length: int, gantries: int) -> Town:
    """Generate the town; `PARAMETERS` describes the arguments."""
    road, site = Motorway(lanes, 50.0 * length), Site("highway", seed)
    ground(site, (0.0, 0.0), road.path + 4.0)
    count = int((road.half + BEYOND) / STRETCH + 0.999)
    for n in range(-count, count):
        _stretch(site, road, n)
    for sign in (1, -1):
        heading = 90 if sign > 0 else 270
        for n in range(int(2 * road.half / gantries) + 1):
            _gantry(site, road, f"{heading}.{n}", heading, 60.0 - road.half + gantries * n, n)
        for n in range(int(road.half / 150) + 1):
            _limit(site, road, f"{heading}.{n}", heading, 20.0 - road.half + 300.0 * n)
    _beside(site, road)
    _distance(site, road)
    return Town(site.plan(), site.looks, tuple(_spawn_points(road)), road, barred=("vehicle.bicycle",))


def _heading(road: Motorway, yaw: int, along: float, x: float) -> Pose:
    """Return a pose on the carriageway whose traffic has heading `yaw`.

    Args:
        road: the motorway.
        yaw: the heading, 90 or 270 degrees.
        along: the coordinate along the direction of travel, metres from the origin.
        x: the distance from the middle of the median, metres.
    """
    sign = 1 if yaw == 90 else -1
    return Pose(x=sign * x, y=sign * along, yaw=yaw)


def _stretch(site: Site, road: Motorway, n: int) -> None:
    """Add asphalt, guard rails and footpath from y = 48 n to y = 48 (n + 1)."""
    y, wide = STRETCH * (n + 0.5), road.edge - MEDIAN
    for yaw, sign in ((90, 1), (270, -1)):
        middle = Pose(x=sign * (MEDIAN + wide / 2), y=y, yaw=yaw)
        site.keyed(f"carriageway.{yaw}.{n}", "carriageway", middle, (STRETCH, wide, 0.0), limit=LIMIT, lanes=road.lanes,
                   lane=LANE, shoulder=SHOULDER)  # fmt: skip
        rail = Pose(x=sign * (road.edge + 0.25), y=y, yaw=180 if sign > 0 else 0)
        site.add(f"guardrail.{yaw}.{n}", "guardrail", rail, (0.3, STRETCH, 0.75), double=0)
    site.add(f"guardrail.median.{n}", "guardrail", Pose(y=y), (0.5, STRETCH, 0.8), double=1)
    if -road.half - STRETCH < y < road.half + STRETCH:
        site.add(f"path.{n}", "path", Pose(x=road.path, y=y, yaw=90), (STRETCH, 2.6, 0.0), drive=0)


def _gantry(site: Site, road: Motorway, name: str, yaw: int, along: float, n: int) -> None:
    """Add a gantry over one carriageway, from the median to beyond the outer guard rail."""
    inner, outer = 0.75, road.edge + 0.75
    middle = (inner + outer) / 2
    pose = beside(_heading(road, yaw, along, middle), 0.0, 0.0, 180.0)
    site.keyed(
        f"gantry.{name}", "gantry", pose, (0.9, outer - inner, 7.4),
        lanes=road.lanes, lane=LANE, first=road.lane(0) - middle, exit=n % 2,
    )  # fmt: skip


def _limit(site: Site, road: Motorway, name: str, yaw: int, along: float) -> None:
    """Add a speed limit sign beyond the hard shoulder."""
    pose = beside(_heading(road, yaw, along, road.edge + 0.9), 0.0, 0.0, 180.0)
    site.add(f"sign.speed.{name}", "sign", pose, (0.1, 0.95, 3.0), face=FACES["speed"], value=LIMIT)


def _beside(site: Site, road: Motorway) -> None:
    """Add lamps on the verges, benches along the footpath, trees, bushes and billboards."""
    reach = road.half + 120.0
    for n in range(int(2 * reach / 40.0)):
        y = -reach + 40.0 * (n + 0.5)
        for sign, yaw in ((1, 180), (-1, 0)):
            lamp = Pose(x=sign * (road.edge + 0.8), y=y + 7.0 * sign, yaw=yaw)
            site.add(f"lamp.{yaw}.{n}", "lamp", lamp, (0.2, 0.2, 9.5), arm=2.2)
        if abs(y) < road.half and n % 3 == 1:
            bench = Pose(x=road.path + 2.0, y=y + 3.0, yaw=180)
            site.add(f"bench.path.{n}", "bench", bench, (0.5, 1.6, 0.85))
    for n in range(int(2 * (reach + 100.0) / 9.0)):
        for sign in (1, -1):
            _green(site, road, f"{sign}.{n}", sign, -reach - 100.0 + 9.0 * (n + 0.5))
    for n in range(int(road.half / 120.0)):
        board = Pose(x=-(road.edge + 9.0), y=-road.half + 90.0 + 240.0 * n, yaw=75)
        site.keyed(f"billboard.{n}", "billboard", board, (0.5, 6.0, 6.0))


def _green(site: Site, road: Motorway, name: str, sign: int, y: float) -> None:
    """Add a tree and a bush beyond the verge, each with some probability, on one side of the road."""
    stream = site.stream("verge", name)
    clear = road.path + 5.0 if sign > 0 else road.edge + 15.0
    if stream.unit() < 0.62:
        at = Pose(x=sign * (clear + stream.uniform(0.0, 14.0)), y=y + stream.uniform(-6.0, 6.0))
        site.tree(f"tree.{name}", at, stream.uniform(8.0, 14.0), (0, 0, 1, 2))
    if stream.unit() < 0.35:
        size = stream.uniform(1.0, 2.0)
        at = Pose(x=sign * (clear - 1.5 + stream.uniform(0.0, 2.0)), y=y + stream.uniform(-6.0, 6.0))
        site.keyed(f"bush.{name}", "bush", at, (size, size, 0.8 * size))


def _distance(site: Site, road: Motorway) -> None:
    """Add distant buildings on both sides and beyond the ends of the road."""
    for n in range(44):
        stream = site.stream(f"skyline.{n}")
        sign = 1 if n % 2 else -1
        end = n >= 32
        x = stream.uniform(30.0, 160.0) if end else stream.uniform(95.0, 260.0)
        far = road.half + BEYOND + stream.uniform(60.0, 160.0)
        y = (far if n % 4 < 2 else -far) if end else stream.uniform(-1.0, 1.0) * (road.half + BEYOND)
        size = (stream.uniform(16, 30), stream.uniform(20, 44), stream.uniform(9, 60 if end else 34))
        pose = Pose(x=sign * (road.edge + x), y=y, yaw=90 * stream.integer(0, 3))
        site.add(f"skyline.{n}", "tower", pose, size, key=stream.integer(0, 63))


def _spawn_points(road: Motorway) -> Iterator[SpawnPoint]:
    """Vehicles 30 metres apart in each lane of the whole road, staggered; pedestrians on the path."""
    reach = road.half + BEYOND
    for yaw in (90, 270):
        for n in range(road.lanes):
            for k in range(int((2 * reach - 40.0) / 30.0)):
                along = -reach + 20.0 + 30.0 * k + 10.0 * (n % 3)
                yield SpawnPoint("vehicle", _heading(road, yaw, along, road.lane(n)))
    for k in range(int((2 * road.half - 40.0) / 9.0)):
        yield SpawnPoint("pedestrian", Pose(x=road.path, y=-road.half + 20.0 + 9.0 * k, yaw=90 if k % 2 else 270))
