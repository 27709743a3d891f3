"""Builder of a town's plan.

Every random draw is keyed by the name of the element that it shapes, so that adding an element changes no other.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns import palettes

Size = tuple[float, float, float]


@dataclass
class Site:
    """The elements of a town, in the order in which they are added, their colours, and the parking places."""

    name: str
    seed: int
    elements: list[Element] = field(default_factory=list)
    looks: dict[str, dict[str, str]] = field(default_factory=dict)  # element -> slot -> "#rrggbb"
    parking: list[Pose] = field(default_factory=list)  # each with the yaw of a car parked there

    def stream(self, *names: str) -> Stream:
        """Return the random stream with this name."""
        return Stream(self.seed, "town", *names)

    def chance(self, share: float, *names: str) -> bool:
        """Draw whether an element exists.

        Args:
            share: the probability.
            names: the key of the draw.
        """
        return self.stream(*names).unit() < share

    def add(self, name: str, kind: str, pose: Pose, size: Size, **shape: float) -> None:
        """Add an element, with colours drawn from the palette of its kind.

        Args:
            name: its unique name.
            kind: the mesh generator that builds it.
            pose: the position and orientation of its origin.
            size: its extents along x, y and z in its own frame, metres.
            shape: further parameters of the mesh generator.
        """
        self.elements.append(Element(name=name, kind=kind, pose=pose, size=size, shape=shape))
        self.looks[name] = palettes.look(kind, self.stream(name, "look"))

    def tree(self, name: str, pose: Pose, tallest: float, species: tuple[int, ...] = (0,)) -> None:
        """Add a tree, at most `tallest` metres tall.

        Args:
            name: its unique name.
            pose: its position; the yaw is drawn.
            tallest: the upper limit of its height, metres.
            species: the species to draw from; repeated entries have a higher probability.
        """
        stream = self.stream(name)
        height = stream.uniform(0.75, 1.0) * tallest
        kind = stream.choice(species)
        radius = height * stream.uniform(0.24, 0.3) * (1.0, 0.75, 0.55)[kind]
        turned = Pose(x=pose.x, y=pose.y, z=pose.z, yaw=stream.uniform(0, 360))
        size = (2 * radius, 2 * radius, height)
        self.add(name, "tree", turned, size, trunk=0.07 + 0.012 * height, key=stream.integer(0, 1 << 20), species=kind)

    def keyed(self, name: str, kind: str, pose: Pose, size: Size, **shape: float) -> None:
        """Add an element with a drawn parameter `key`, which selects a variation of its mesh."""
        self.add(name, kind, pose, size, **shape, key=self.stream(name, "key").integer(0, 63))

    def plan(self) -> TownPlan:
        """Return the plan of the elements added so far."""
        return TownPlan(name=self.name, elements=tuple(self.elements))


def beside(pose: Pose, out: float, along: float, turn: float = 0.0) -> Pose:
    """Return a pose relative to another.

    Args:
        pose: the reference.
        out: metres ahead of it.
        along: metres to its left.
        turn: degrees added to its yaw.
    """
    s, c = exact.sin_cos_deg(pose.yaw)
    return Pose(x=pose.x + c * out - s * along, y=pose.y + s * out + c * along, z=pose.z, yaw=(pose.yaw + turn) % 360)


def ground(site: Site, middle: tuple[float, float], gap: float = 0.0) -> None:
    """Add the ground plane and the hills around it, with a gap for a road along y, `gap` metres to either side."""
    site.add("ground", "ground", Pose(x=middle[0], y=middle[1]), (2400.0, 2400.0, 0.05), gap=gap)


def skyline(site: Site, middle: tuple[float, float], near: tuple[float, float], tallest: float = 52.0) -> None:
    """Add distant tower blocks around the town, so that every street has a background.

    Args:
        site: the elements are added to it.
        middle: the centre of the town.
        near: the half-extents of the rectangle that stays free, along x and y. Towers stand 15, 60 or 110 m beyond it.
        tallest: the upper limit of their heights, metres.
    """
    for n in range(56):
        stream = site.stream(f"skyline.{n}")
        angle = (n + stream.uniform(0.2, 0.8)) * 360 / 56
        s, c = exact.sin_cos_deg(angle)
        size = (stream.uniform(16, 30), stream.uniform(20, 40), stream.uniform(14, tallest))
        reach = min(near[0] / max(abs(c), 1e-9), near[1] / max(abs(s), 1e-9)) + stream.choice((15, 60, 110))
        facing = 180 + 90 * int(angle / 90 + 0.5)
        pose = Pose(x=middle[0] + reach * c, y=middle[1] + reach * s, yaw=facing % 360)
        site.add(f"skyline.{n}", "tower", pose, size, key=stream.integer(0, 63))
