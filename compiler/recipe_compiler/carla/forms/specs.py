"""The entries that a configuration spawns, in a common form for both forms of configurations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.handedness import Pose
from recipe_compiler.carla.report import Node

Kind = Literal["walker", "vehicle", "sensor", "patch", "generator"]
POSITION, ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
AXES = (*POSITION, "yaw", "pitch", "roll")  # of a pose in a recipe
LIMIT = 1e5  # metres, degrees


@dataclass(frozen=True)
class Number:
    """A number of a transform, or the range from which it is drawn; `node` is None if it is not given."""

    low: float = 0.0
    high: float = 0.0
    node: Node | None = None

    @property
    def middle(self) -> float:
        """The number, or the middle of the range."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class Transform:
    """A transform of CARLA: metres and degrees, left-handed."""

    node: Node
    numbers: dict[str, Number]

    @property
    def pose(self) -> Pose:
        """The pose in the right-handed frame, with the middles of ranges."""
        return Pose(**{axis: number.middle for axis, number in self.numbers.items()}).to_right_handed()


@dataclass
class Spec:
    """One entry that is spawned.

    Args:
        node: its map in the configuration.
        kind: its kind.
        blueprint: its blueprint or glob, with the kind, such as `walker.pedestrian.*`.
        name_node: the value that names the blueprint; None if it follows from the class.
        attributes: attributes of the blueprint by name.
        wanted_name: the name in the recipe, if it is valid and free.
        transform: its transform; None: a random spawn point, or the pose of its container.
        goal: its destination; None: a random one, or none.
        speed: its speed: m/s of walkers, metres per frame of the collector's sensors.
        jitter: a map of the maximum offsets along x, y and z, metres.
        role: the value of `attach_to`, a role name.
        container: the entry that contains it.
        attachment: how it is attached: `rigid` or `spring_arm`.
        modalities: of a sensor, its modalities, each with the value that names it.
        stands: whether it does not move.
        route: of a sensor, the map with the parameters of its route along the road.
        origin: why it is there, if no entry of the configuration spawns it.
        name: its name in the recipe, once it is chosen.
        parent: of a sensor, the entry that it is attached to, once it is known.
    """

    node: Node
    kind: Kind
    blueprint: str
    name_node: Node | None = None
    attributes: dict[str, Node] = field(default_factory=dict)
    wanted_name: str = ""
    transform: Transform | None = None
    goal: Transform | None = None
    speed: Node | None = None
    jitter: Node | None = None
    role: Node | None = None
    container: Spec | None = None
    attachment: Node | None = None
    modalities: tuple[tuple[str, Node], ...] = ()
    stands: bool = False
    route: Node | None = None
    origin: str = ""
    name: str = ""
    parent: Spec | None = None


def read_transform(reader: Reader, node: Node | None, *, ranges: bool) -> Transform | None:
    """Read a transform: maps `location` and `rotation`, each with any of its three numbers.

    Args:
        reader: collects problems.
        node: the map; None if it is absent.
        ranges: whether a number may be a list `[min, max]`, from which it is drawn.
    """
    node = reader.map(node)
    if node is None:
        return None
    numbers: dict[str, Number] = {}
    for part, axes in (("location", POSITION), ("rotation", ANGLES)):
        inner = reader.map(node.get(part))
        for axis in axes:
            numbers[axis] = _number(reader, None if inner is None else inner.get(axis), ranges=ranges)
        ignore_others(reader, inner, (*axes, "_target_"), f"a {part} has no such number")
    ignore_others(reader, node, ("location", "rotation", "_target_"), "a transform has a location and a rotation only")
    return Transform(node, numbers)


def _number(reader: Reader, node: Node | None, *, ranges: bool) -> Number:
    ends = [node]
    if node is not None and ranges and isinstance(node.value.data, tuple) and node.value.data:
        ends = list(node.children())
    given = [reader.number(end, -LIMIT, LIMIT) or 0.0 for end in ends]
    return Number(min(given[0], given[-1]), max(given[0], given[-1]), node)


def ignore_others(reader: Reader, node: Node | None, known: Sequence[str], why: str) -> None:
    """Record that the keys of a map other than those that are known are ignored."""
    for child in node.children() if node is not None else ():
        if child.path[-1] not in known:
            reader.ledger.ignored(child, why)


def unread_classes(node: Node) -> Iterator[Node]:
    """Yield the class names `_target_` and Hydra's keys such as `_recursive_` below a value."""
    for leaf in node.leaves():
        step = leaf.path[-1] if leaf.path else ""
        if isinstance(step, str) and step.startswith("_") and step.endswith("_") and step != "_actor_":
            yield leaf
