"""A town while it is being laid out. Draws are keyed by the name of what they shape, so no element shifts another."""

from __future__ import annotations

from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library.towns import palettes

Size = tuple[float, float, float]


@dataclass
class Site:
    """Elements and their colours, in the order in which they are added, and where cars may be parked."""

    name: str
    seed: int
    elements: list[Element] = field(default_factory=list)
    looks: dict[str, dict[str, str]] = field(default_factory=dict)
    parking: list[Pose] = field(default_factory=list)

    def stream(self, *names: str) -> Stream:
        """The random stream of that name."""
        return Stream(self.seed, "town", *names)

    def chance(self, share: float, *names: str) -> bool:
        """Whether something with that name is there, drawn for it alone."""
        return self.stream(*names).unit() < share

    def add(self, name: str, kind: str, pose: Pose, size: Size, **shape: float) -> None:
        """One more element, with colours drawn for its kind."""
        self.elements.append(Element(name=name, kind=kind, pose=pose, size=size, shape=shape))
        self.looks[name] = palettes.look(kind, self.stream(name, "look"))

    def tree(self, name: str, pose: Pose, tallest: float, species: tuple[int, ...] = (0,)) -> None:
        """A tree up to that tall, of one of the species."""
        stream = self.stream(name)
        height = stream.uniform(0.75, 1.0) * tallest
        kind = stream.choice(species)
        radius = height * stream.uniform(0.24, 0.3) * (1.0, 0.75, 0.55)[kind]
        turned = Pose(x=pose.x, y=pose.y, z=pose.z, yaw=stream.uniform(0, 360))
        size = (2 * radius, 2 * radius, height)
        self.add(name, "tree", turned, size, trunk=0.07 + 0.012 * height, key=stream.integer(0, 1 << 20), species=kind)

    def keyed(self, name: str, kind: str, pose: Pose, size: Size, **shape: float) -> None:
        """One more element whose mesh a key chooses."""
        self.add(name, kind, pose, size, **shape, key=self.stream(name, "key").integer(0, 63))

    def plan(self) -> TownPlan:
        """The layout, as it stands now."""
        return TownPlan(name=self.name, elements=tuple(self.elements))


def beside(pose: Pose, out: float, along: float, turn: float = 0.0) -> Pose:
    """The pose `out` metres before another and `along` metres to its left, turned by `turn` degrees."""
    s, c = exact.sin_cos_deg(pose.yaw)
    return Pose(x=pose.x + c * out - s * along, y=pose.y + s * out + c * along, z=pose.z, yaw=(pose.yaw + turn) % 360)


def ground(site: Site, middle: tuple[float, float]) -> None:
    """The plain that everything stands on."""
    site.add("ground", "ground", Pose(x=middle[0], y=middle[1]), (2400.0, 2400.0, 0.05))


def skyline(site: Site, middle: tuple[float, float], near: tuple[float, float], tallest: float = 52.0) -> None:
    """Tall plain buildings far out, so that no street ends in nothing: on a rectangle, at one of three depths."""
    for n in range(56):
        stream = site.stream(f"skyline.{n}")
        angle = (n + stream.uniform(0.2, 0.8)) * 360 / 56
        s, c = exact.sin_cos_deg(angle)
        size = (stream.uniform(16, 30), stream.uniform(20, 40), stream.uniform(14, tallest))
        reach = min(near[0] / max(abs(c), 1e-9), near[1] / max(abs(s), 1e-9)) + stream.choice((15, 60, 110))
        facing = 180 + 90 * int(angle / 90 + 0.5)
        pose = Pose(x=middle[0] + reach * c, y=middle[1] + reach * s, yaw=facing % 360)
        site.add(f"skyline.{n}", "tower", pose, size, key=stream.integer(0, 63))
