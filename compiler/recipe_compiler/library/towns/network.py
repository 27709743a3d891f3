"""Elements of a street grid: roads, junctions, blocks, signals, signs, parking bays and spawn points.

Lengths are in metres, yaws in degrees. Traffic keeps to the right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose
from recipe_compiler.library.towns.site import Site, beside
from recipe_compiler.library.towns.streets import BAY, CORNER, KERB, LANE, SIDE, STOP, Cell, StreetGrid
from recipe_compiler.library.towns.town import SpawnPoint

WALK = 6.0  # from the kerb to the building fronts
BAY_LENGTH = 6.2
# Road sign -> the value of the `face` parameter of an element of kind "sign".
FACES = {"stop": 0, "speed": 1, "crossing": 2, "give_way": 3, "parking": 4, "ahead": 5, "dead_end": 6}
_SPACING = 5.0  # metres between two spawn points of a lane; longer vehicles take several
_FROM_KERB = 0.18  # from the kerb to parking bays on a sidewalk: the width of the kerb stones
_STRIP = 2.1  # width of parking bays on a sidewalk; pedestrians walk beyond them
_STAND = BAY - 0.15 - 1.0  # from the edge of the lane to the middle of a parked car


@dataclass(frozen=True)
class Block:
    """The rectangle between the kerbs of neighbouring streets."""

    name: str
    x: tuple[float, float]
    y: tuple[float, float]
    sides: tuple[int, ...]  # outward yaw of each side that faces a street section between two junctions

    @property
    def middle(self) -> Pose:
        """The middle of the block, at the height of its sidewalk."""
        return Pose(x=(self.x[0] + self.x[1]) / 2, y=(self.y[0] + self.y[1]) / 2, z=KERB)

    def side(self, yaw: int, inset: float = WALK) -> tuple[Pose, float]:
        """Return a line parallel to one side, inside the block.

        Args:
            yaw: the outward direction of the side: 0, 90, 180 or 270.
            inset: the distance of the line from the kerb.

        Returns:
            The pose of the line's middle, facing the street, and the line's length.
        """
        s, c = exact.sin_cos_deg(yaw)
        half_x, half_y = (self.x[1] - self.x[0]) / 2, (self.y[1] - self.y[0]) / 2
        x, y = self.middle.x + c * (half_x - inset), self.middle.y + s * (half_y - inset)
        return Pose(x=x, y=y, z=KERB, yaw=yaw), 2 * ((half_y if c else half_x) - inset)


def blocks(streets: StreetGrid) -> Iterator[Block]:
    """Yield all blocks: those between streets, and the shallow ones beyond the outermost streets."""

    def spans(lines: tuple[float, ...], bays: tuple[float, ...]) -> list[tuple[float, float]]:
        kerbs = [LANE + bay for bay in bays]
        inner = [(a + p, b - q) for (a, b), (p, q) in zip(pairwise(lines), pairwise(kerbs), strict=True)]
        first, last = (lines[0] - streets.edge, lines[0] - kerbs[0]), (lines[-1] + kerbs[-1], lines[-1] + streets.edge)
        return [first, *inner, last]

    across, along = spans(streets.xs, streets.bays_x), spans(streets.ys, streets.bays_y)
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
            yield Block(f"{i - 1}.{j - 1}", x, y, tuple(sides))


def roads(site: Site, streets: StreetGrid, limit: int) -> None:
    """Add the road sections between junctions, the dead ends beyond the outermost junctions, and the junctions.

    Args:
        site: the elements are added to it.
        streets: the street grid.
        limit: the speed limit, km/h.
    """
    for i in range(len(streets.xs)):
        _street(site, streets, i, True, limit)
    for j in range(len(streets.ys)):
        _street(site, streets, j, False, limit)
    for i, x in enumerate(streets.xs):
        for j, y in enumerate(streets.ys):
            (rx, ry), name = streets.reach((i, j)), f"junction.{i}.{j}"
            site.keyed(
                name, "junction", Pose(x=x, y=y), (2 * rx, 2 * ry, 0.0),
                over_x=streets.kerb_x(i) + SIDE, wide_x=streets.kerb_y(j),
                over_y=streets.kerb_y(j) + SIDE, wide_y=streets.kerb_x(i),
            )  # fmt: skip


def sidewalk(site: Site, block: Block, walk: float = WALK, verge: float = 0.0, *, paved: bool = False) -> None:
    """Add the raised ground of a block: its sidewalks and what they surround.

    Args:
        site: the element is added to it.
        block: the block.
        walk: width of the sidewalks, metres.
        verge: width of the grass between kerb and pavement, metres.
        paved: whether what they surround is paved.
    """
    size = (block.x[1] - block.x[0], block.y[1] - block.y[0], KERB)
    flat = Pose(x=block.middle.x, y=block.middle.y)
    shape = {"radius": CORNER, "walk": walk, "verge": verge, "paved": int(paved)}
    site.add(f"sidewalk.{block.name}", "sidewalk", flat, size, **shape)


def _street(site: Site, streets: StreetGrid, n: int, along_y: bool, limit: int) -> None:
    """Add all sections of one street with parking signs, and a guard rail across each of its two dead ends."""
    lines, across = (streets.ys, streets.xs[n]) if along_y else (streets.xs, streets.ys[n])
    bays = (streets.bays_x if along_y else streets.bays_y)[n]
    kerb = streets.kerb_y if along_y else streets.kerb_x
    axis = "y" if along_y else "x"
    spans = [(a + kerb(k) + CORNER, b - kerb(k + 1) - CORNER, STOP - CORNER, STOP - CORNER, str(k))
             for k, (a, b) in enumerate(pairwise(lines))]  # fmt: skip
    last = len(lines) - 1
    spans.append((lines[0] - streets.edge, lines[0] - kerb(0) - CORNER, 0.0, STOP - CORNER, "start"))
    spans.append((lines[last] + kerb(last) + CORNER, lines[last] + streets.edge, STOP - CORNER, 0.0, "end"))
    for a, b, stop_a, stop_b, part in spans:
        at, name = (a + b) / 2, f"road.{axis}.{n}.{part}"
        pose = Pose(x=across, y=at, yaw=90) if along_y else Pose(x=at, y=across)
        first, count = _bays(b - a, stop_a, stop_b) if bays and part not in ("start", "end") else (0.0, 0)
        site.keyed(
            name, "road", pose, (b - a, 2 * (LANE + bays), 0.0),
            limit=limit, stop_a=stop_a, stop_b=stop_b, bay=bays, bay_from=first, bays=count, bay_length=BAY_LENGTH,
        )  # fmt: skip
        for k in range(count):
            for sign in (1, -1):  # -1 is the right-hand side, looking along the street's own x axis
                u = first + BAY_LENGTH * (k + 0.5)
                site.parking.append(beside(pose, u, sign * (LANE + _STAND), 180.0 if sign > 0 else 0.0))
        if count:
            for n_sign, sign in enumerate((1, -1)):
                post = beside(pose, -sign * (first + 0.4), sign * (LANE + bays + 0.4), 0.0 if sign > 0 else 180.0)
                _post(site, f"sign.parking.{axis}.{n}.{part}.{n_sign}", post, "parking")
        if part in ("start", "end"):
            end = (b - a) / 2 * (1 if part == "end" else -1)
            rail = beside(pose, end - (0.4 if end > 0 else -0.4), 0.0, 180.0 if end > 0 else 0.0)
            site.add(f"guardrail.{axis}.{n}.{part}", "guardrail", rail, (0.3, 2 * (LANE + bays) - 0.2, 0.75), double=0)


def _bays(length: float, stop_a: float, stop_b: float) -> tuple[float, int]:
    """Return the start of a road section's parking bays along its x axis, and their number.

    The bays keep a distance of 5 m from stop lines, where lane arrows are painted.
    """
    start, end = -length / 2 + stop_a + 5.0, length / 2 - stop_b - 5.0
    count = max(0, int((end - start) / BAY_LENGTH))
    return (start + end) / 2 - count * BAY_LENGTH / 2, count


def kerbside_parking(site: Site, name: str, kerb: Pose, at: float, bays: int) -> None:
    """Add parking bays on a sidewalk, level with it, along its kerb.

    Args:
        site: the element is added to it.
        name: the name of the sidewalk's side.
        kerb: a pose on the kerb, facing the street.
        at: the middle of the bays, metres from `kerb` to the left.
        bays: their number.
    """
    size = (BAY_LENGTH * bays, _STRIP, 0.006)
    site.add(f"parking.{name}", "parking", beside(kerb, -_FROM_KERB - _STRIP / 2, at, -90.0), size, bays=bays)
    for k in range(bays):
        along = at + BAY_LENGTH * (k + 0.5 - bays / 2)
        site.parking.append(beside(kerb, -_FROM_KERB - _STRIP / 2, along, -90.0))


def _post(site: Site, name: str, pose: Pose, face: str, value: int = 0) -> None:
    """Add a road sign on the sidewalk that faces along the pose's yaw."""
    raised = Pose(x=pose.x, y=pose.y, z=KERB, yaw=pose.yaw)
    across, height = (0.75, 2.75) if face == "stop" else (0.6, 2.6)
    site.add(name, "sign", raised, (0.1, across, height), face=FACES[face], value=value)


CYCLE = 44.0  # seconds; green and amber leave a part of each half, which is red for all
GREEN = 18.0  # seconds
AMBER = 3.0  # seconds


def _times(site: Site, junction: str, along_y: bool) -> dict[str, float]:
    """The times of a traffic light; the two streets of a junction are green in turn. See `ir.signals`."""
    begin = float(site.stream("signals", junction).integer(0, int(CYCLE) - 1))
    half = 0.0 if along_y else CYCLE / 2
    return {"cycle": CYCLE, "green_from": (begin + half) % CYCLE, "green": GREEN, "amber": AMBER}


def signals(site: Site, streets: StreetGrid, main: int | None, speed: int) -> None:
    """Add traffic lights and road signs at the junctions.

    Junctions of the main street have traffic lights. At other junctions with three arms or more, streets along x have
    stop signs. Some of the approaches along y have crossing signs, and some exits have a speed limit sign.

    Args:
        site: the elements are added to it.
        streets: the street grid.
        main: index of the main street in `streets.xs`, or None if the town has no main street.
        speed: the speed limit shown, km/h.
    """
    for i, x in enumerate(streets.xs):
        for j, y in enumerate(streets.ys):
            for yaw in (0, 90, 180, 270):  # direction of the approaching traffic
                along_y = yaw in (90, 270)
                ahead, aside = (streets.kerb_y(j), streets.kerb_x(i)) if along_y else (
                    streets.kerb_x(i), streets.kerb_y(j))  # fmt: skip
                step = {0: (-1, 0), 180: (1, 0), 90: (0, -1), 270: (0, 1)}[yaw]
                if not streets.exists((i + step[0], j + step[1])):
                    continue  # a dead end has no approaching traffic
                heading, name = Pose(x=x, y=y, z=KERB, yaw=yaw), f"{i}.{j}.{yaw}"
                corner = beside(heading, -(ahead + SIDE + 2.0), -(aside + 0.45), 180.0)
                if i == main:
                    times = _times(site, f"{i}.{j}", along_y)
                    arm = aside - LANE / 2 + 0.45
                    site.add(f"traffic_light.{name}", "traffic_light", corner, (0.26, 0.26, 5.6), arm=arm, **times)
                elif not along_y and _arms(streets, (i, j)) > 2:
                    _post(site, f"sign.stop.{name}", corner, "stop")
                elif site.chance(0.5, "sign", name):
                    _post(site, f"sign.crossing.{name}", beside(corner, 1.6, 0.0), "crossing")
                past = beside(heading, -(ahead + SIDE + 6.4), aside + 0.4)
                if site.chance(0.45, "limit", name):
                    _post(site, f"sign.speed.{name}", past, "speed", speed)


def _arms(streets: StreetGrid, junction: Cell) -> int:
    """Return the number of streets that lead from a junction to another one."""
    i, j = junction
    return sum(streets.exists(cell) for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)))


def spawn_points(streets: StreetGrid) -> Iterator[SpawnPoint]:
    """Yield spawn points for vehicles (mid-lane) and pedestrians (mid-sidewalk) on each section between junctions."""
    for lines, others, bays, is_y in (
        (streets.xs, streets.ys, streets.bays_x, True),
        (streets.ys, streets.xs, streets.bays_y, False),
    ):
        for line, bay in zip(lines, bays, strict=True):
            for a, b in pairwise(others):
                for sign in (1, -1):  # +1: the lane towards increasing coordinates
                    yaw = (90 if sign > 0 else 270) if is_y else (0 if sign > 0 else 180)
                    middle = Pose(x=line, y=(a + b) / 2, yaw=yaw) if is_y else Pose(x=(a + b) / 2, y=line, yaw=yaw)
                    yield from _along(middle, b - a, LANE + bay + SIDE)


def _along(middle: Pose, pitch: float, aside: float) -> Iterator[SpawnPoint]:
    """Yield the spawn points of one direction of one section: of its lane and of the sidewalk on its right."""
    for k in range(int((pitch - 32.0) / _SPACING) + 1):
        yield SpawnPoint("vehicle", beside(middle, -(pitch - 32.0) / 2 + _SPACING * k, -LANE / 2))
    count = 2 * int((pitch / 2 - 15.0) / 7.0) + 1
    for n in range(count):
        walker = beside(middle, 7.0 * (n - count // 2), -aside, 180.0 * (n % 2))
        yield SpawnPoint("pedestrian", Pose(x=walker.x, y=walker.y, z=KERB, yaw=walker.yaw))
