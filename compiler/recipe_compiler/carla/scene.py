"""The scene of a configuration: names of its entries, who carries whom, and where everything is put."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Draft, name_for
from recipe_compiler.carla.forms.specs import Number, Spec
from recipe_compiler.carla.handedness import WALKER_ORIGIN, Pose, turned
from recipe_compiler.carla.placement import XY, Point, Site
from recipe_compiler.carla.report import Path
from recipe_compiler.carla.settings import Settings
from recipe_compiler.ir.errors import Code
from recipe_compiler.ir.patches import MAX_PATCHES
from recipe_compiler.ir.plurals import count
from recipe_compiler.lowering.placement import BASE_NUMBERS
from recipe_compiler.source.yaml_reader import show

MOST_SENSORS, MOST_GENERATORS = 200, 100
ACTORS = ("walker", "vehicle")


@dataclass
class Scene:
    """What the parts of an import share while they write a scene.

    Attributes:
        reader: collects problems and what became of each key.
        draft: the recipe.
        settings: clock, seed and town.
        specs: the entries.
        references: for each reference in the file, what it refers to.
        site: the town.
        vector: the shift of all world positions.
        names: the name of each entry in the recipe, by `id`.
        carriers: the entry to which each sensor is attached, by `id`.
    """

    reader: Reader
    draft: Draft
    settings: Settings
    specs: Sequence[Spec]
    references: Mapping[Path, Path]
    site: Site
    vector: XY = (0.0, 0.0)
    names: dict[int, str] = field(default_factory=dict)
    carriers: dict[int, Spec] = field(default_factory=dict)

    def of_kind(self, *kinds: str) -> list[Spec]:
        """The entries of some kinds."""
        return [spec for spec in self.specs if spec.kind in kinds]

    def name(self, spec: Spec) -> str:
        """The name of an entry in the recipe."""
        return self.names[id(spec)]

    def carrier(self, spec: Spec) -> Spec | None:
        """The entry to which a sensor is attached."""
        return self.carriers.get(id(spec))

    def prepare(self) -> None:
        """Name the entries, resolve attachments and choose the shift; only problems if there are too many entries."""
        if self._has_too_many():
            return
        self._name_actors()
        self._attach()
        self.vector = self.site.shift(self._points())

    def world(self, pose: Pose) -> Pose:
        """A pose of the world frame, moved to its place in the town."""
        return Pose(pose.x + self.vector[0], pose.y + self.vector[1], pose.z, pose.yaw, pose.pitch, pose.roll)

    def mount(self, spec: Spec) -> Pose | None:
        """The pose of a sensor: in the frame of the actor that carries it, else in the world.

        Returns:
            None if it has neither a transform nor anything that carries it.
        """
        own = spec.transform.pose if spec.transform is not None else Pose()
        carrier = self.carrier(spec)
        if self.follows_road(spec):
            return self._on_road(spec, own)
        if carrier is None:
            return None if spec.transform is None else self.world(own)
        return self.carried(carrier, own)

    def follows_road(self, spec: Spec) -> bool:
        """Whether a sensor travels along the lanes of the town."""
        return spec.route is not None and self.carrier(spec) is None

    def _on_road(self, spec: Spec, own: Pose) -> Pose:
        """The start of a sensor that follows the road: the nearest lane, in its direction, with the route's angles."""
        assert spec.route is not None
        at, turn = self.world(own), spec.goal.pose if spec.goal is not None else Pose()
        lane = self.site.lane(at.x, at.y)
        height = self.reader.number(spec.route.get("elevation")) or at.z
        return Pose(lane.x, lane.y, height, turned(lane.yaw), turn.pitch, turn.roll)

    def carried(self, carrier: Spec, own: Pose) -> Pose | None:
        """A pose in the frame of an entry: in the frame of the actor that carries that, else in the world."""
        if carrier.kind == "walker":
            return Pose(own.x, own.y, own.z + WALKER_ORIGIN, own.yaw, own.pitch, own.roll)
        if carrier.kind == "vehicle":
            return own
        base = self.mount(carrier)
        return None if base is None else base.of(own)

    def actor_of(self, spec: Spec) -> Spec | None:
        """The actor that carries a sensor, itself or through other sensors; None if none does."""
        carrier = self.carrier(spec)
        while carrier is not None and carrier.kind not in ACTORS:
            carrier = self.carrier(carrier)
        return carrier

    def note_number(self, number: Number, to: str, value: float, why: str) -> None:
        """Note where a number of a transform went; does nothing for a default."""
        if number.node is None:
            return
        if number.low == number.high == value and not isinstance(number.node.value.data, tuple):
            self.reader.ledger.kept(number.node, to)
            return
        for leaf in number.node.leaves():
            self.reader.ledger.mapped(leaf, to, round(value, 6), why)

    def draw(self, number: Number, path: str, low: float, high: float) -> None:
        """Draw a number from its range, if it has one; `path` is below `base`."""
        if number.low == number.high or number.node is None:
            return
        span = [round(low, 6), round(high, 6)]
        self.draft.draws[path] = {"uniform": span}
        for leaf in number.node.leaves():
            self.reader.ledger.mapped(leaf, f"sweep.draw.values.{path}", span, "drawn uniformly from this range")

    def _name_actors(self) -> None:
        """Name walkers and vehicles by their role names, else by kind and number."""
        taken: list[str] = []
        numbers = dict.fromkeys(ACTORS, 0)
        for spec in self.of_kind(*ACTORS):
            numbers[spec.kind] += 1
            role = spec.attributes.get("role_name")
            text = self.reader.text(role)
            wanted = text or spec.wanted_name or f"{spec.kind}{numbers[spec.kind]}"
            name = name_for(wanted, taken, f"{spec.kind}{numbers[spec.kind]}")
            taken.append(name)
            self.names[id(spec)] = name
            if role is not None and name == text:
                self.reader.ledger.kept(role, f"base.actors.{name}")
            elif role is not None:
                why = "names here are unique: letters, digits, _ and -"
                self.reader.ledger.mapped(role, f"base.actors.{name}", name, why)

    def _has_too_many(self) -> bool:
        """Report the first entry beyond each limit; return whether there is one."""
        limits = (
            (ACTORS, BASE_NUMBERS[1], "actor", "actors", "write an ActorsGenerator for crowds"),
            (("sensor",), MOST_SENSORS, "sensor", "sensors", "split the configuration"),
            (("patch",), MAX_PATCHES, "patch", "patches", "split the configuration"),
            (("generator",), MOST_GENERATORS, "ActorsGenerator", "ActorsGenerators", "give one a larger count"),
        )
        over = False
        for kinds, most, what, plural, otherwise in limits:
            found = self.of_kind(*kinds)
            if len(found) > most:
                message = count(len(found), what, plural)
                self.reader.refuse(found[most].node, message, f"keep at most {most}, or {otherwise}", Code.INPUT_LIMIT)
                over = True
        return over

    def _attach(self) -> None:
        """Find what carries each sensor: the entry that contains it, or the one with the role name of `attach_to`."""
        roles: dict[str, Spec] = {}
        for spec in self.specs:
            role = spec.attributes.get("role_name")
            if role is not None:
                roles.setdefault(str(role.value.data), spec)
        for spec in self.specs:
            carrier = spec.parent
            if spec.role is not None and carrier is not None:
                self.reader.ledger.ignored(spec.role, f"it is an entry of {carrier.node.key}, which carries it")
            elif spec.role is not None:
                carrier = self._with_role(spec, roles)
            if spec.kind == "sensor" and carrier is not None:
                self.carriers[id(spec)] = carrier
            elif carrier is not None and spec.role is not None and spec.parent is None:
                self.reader.ledger.ignored(spec.role, "actors here move by themselves: only sensors are carried")
        for spec in self.of_kind("sensor"):
            self._check_circle(spec)
        for spec in self.of_kind("sensor"):
            self._join_moving_carrier(spec)

    def _with_role(self, spec: Spec, roles: Mapping[str, Spec]) -> Spec | None:
        assert spec.role is not None
        role = self.reader.text(spec.role)
        found = roles.get(role or "")
        if role is not None and found is None:
            known = (
                f"write one of {', '.join(map(show, list(roles)[:20]))}" if roles else "give an actor this role_name"
            )
            message = f"no entry has the role_name {show(role)}; the collector would wait for it forever"
            self.reader.refuse(spec.role, message.replace("; ", ": "), known, Code.UNKNOWN_NAME)
        return found

    def _check_circle(self, spec: Spec) -> None:
        seen: list[Spec] = [spec]
        while (carrier := self.carrier(seen[-1])) is not None:
            if any(carrier is each for each in seen):
                del self.carriers[id(spec)]
                self.reader.refuse(spec.role or spec.node, "it is attached to itself", "attach it to an actor")
                return
            seen.append(carrier)

    def _join_moving_carrier(self, spec: Spec) -> None:
        """Give a sensor at the pose of a sensor that moves, to which it is attached, the same pose and motion."""
        carrier = self.carrier(spec)
        if carrier is None or carrier.kind != "sensor":
            return
        self._join_moving_carrier(carrier)
        moves = carrier.goal or carrier.jitter or carrier.route or carrier.attachment
        if not moves:
            return
        own = spec.transform.pose if spec.transform is not None else Pose()
        if own != Pose() or spec.goal or spec.jitter or spec.route or spec.attachment:
            message = f"{carrier.node.key}, to which it is attached, moves: it has another pose or motion"
            remedy = "attach it to an actor, or give it the pose and motion of that sensor"
            self.reader.refuse(spec.node, message, remedy)
            return
        for leaf in spec.transform.node.leaves() if spec.transform is not None and spec.transform.node else ():
            self.reader.ledger.mapped(leaf, "", f"the pose of {carrier.node.key}", "that sensor carries it")
        if spec.role is not None:
            self.reader.ledger.mapped(spec.role, "", f"the pose of {carrier.node.key}", "that sensor carries it")
        spec.role, spec.transform, spec.goal, spec.speed = None, carrier.transform, carrier.goal, carrier.speed
        spec.jitter, spec.route, spec.attachment = carrier.jitter, carrier.route, carrier.attachment
        above = self.carrier(carrier)
        if above is None:
            del self.carriers[id(spec)]
        else:
            self.carriers[id(spec)] = above

    def _points(self) -> list[Point]:
        """The world positions of the configuration, before they are moved."""
        points = []
        for spec in self.specs:
            if spec.kind == "walker" and spec.transform is None and spec.goal is not None:
                points.append(Point("walker", spec.goal.pose.x, spec.goal.pose.y))
            if spec.transform is None or spec.kind == "generator":
                continue
            pose = spec.transform.pose
            if spec.kind == "walker":
                goal = None if spec.goal is None else (spec.goal.pose.x, spec.goal.pose.y)
                points.append(Point("walker", pose.x, pose.y, goal=goal))
            elif spec.kind == "vehicle":
                points.append(Point("vehicle", pose.x, pose.y, yaw=pose.yaw))
            elif spec.kind == "sensor" and self.carrier(spec) is None:
                moves = spec.goal is not None and spec.route is None
                goal = (spec.goal.pose.x, spec.goal.pose.y) if spec.goal is not None and moves else None
                points.append(Point("sensor", pose.x, pose.y, pose.z, goal=goal))
        return points
