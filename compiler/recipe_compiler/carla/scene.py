"""The scene of a configuration: names of its entries, attachments of sensors, and the shift of positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Draft, name_for
from recipe_compiler.carla.forms.specs import Number, Spec
from recipe_compiler.carla.handedness import WALKER_ORIGIN, Pose, normalize_angle
from recipe_compiler.carla.placement import XY, Point, Site
from recipe_compiler.carla.report import Path
from recipe_compiler.carla.settings import Settings
from recipe_compiler.ir.errors import Code
from recipe_compiler.ir.patches import MAX_PATCHES
from recipe_compiler.ir.plurals import count
from recipe_compiler.lowering.placement import BASE_NUMBERS
from recipe_compiler.source.yaml_reader import show

MAX_SENSORS = 200
MAX_GENERATORS = 100
ACTORS = ("walker", "vehicle")


@dataclass
class Scene:
    """The state that the parts of an import share while they write a scene.

    Attributes:
        reader: collects problems and the outcome of each key.
        draft: the recipe.
        settings: clock, seed and town.
        specs: the entries.
        references: the path of the value that each reference names, by the path of the reference.
        site: the town.
        vector: the shift of all world positions, x and y in metres.
        names: the name of each entry in the recipe, by `id`.
        parents: the entry to which each sensor is attached, by `id`.
    """

    reader: Reader
    draft: Draft
    settings: Settings
    specs: Sequence[Spec]
    references: Mapping[Path, Path]
    site: Site
    vector: XY = (0.0, 0.0)
    names: dict[int, str] = field(default_factory=dict)
    parents: dict[int, Spec] = field(default_factory=dict)

    def of_kind(self, *kinds: str) -> list[Spec]:
        """The entries of some kinds."""
        return [spec for spec in self.specs if spec.kind in kinds]

    def name(self, spec: Spec) -> str:
        """The name of an entry in the recipe."""
        return self.names[id(spec)]

    def parent(self, spec: Spec) -> Spec | None:
        """The entry to which a sensor is attached."""
        return self.parents.get(id(spec))

    def prepare(self) -> None:
        """Name the entries, resolve attachments and choose the shift; or report a problem if there are too many."""
        if self._has_too_many():
            return
        self._name_actors()
        self._attach()
        self.vector = self.site.shift(self._points())

    def world(self, pose: Pose) -> Pose:
        """A pose of the world frame, moved to its place in the town."""
        return Pose(pose.x + self.vector[0], pose.y + self.vector[1], pose.z, pose.yaw, pose.pitch, pose.roll)

    def mount(self, spec: Spec) -> Pose | None:
        """Return the pose of a sensor: in the frame of the actor that it is attached to, or in the world.

        Returns:
            None if it has neither a transform nor a parent.
        """
        own = spec.transform.pose if spec.transform is not None else Pose()
        parent = self.parent(spec)
        if self.follows_road(spec):
            return self._on_road(spec, own)
        if parent is None:
            return None if spec.transform is None else self.world(own)
        return self.pose_on(parent, own)

    def follows_road(self, spec: Spec) -> bool:
        """Return whether a sensor follows the lanes of the town."""
        return spec.route is not None and self.parent(spec) is None

    def _on_road(self, spec: Spec, own: Pose) -> Pose:
        """Return the start pose of a sensor that follows the road: on the nearest lane, with the route's angles."""
        assert spec.route is not None
        at, turn = self.world(own), spec.goal.pose if spec.goal is not None else Pose()
        lane = self.site.lane(at.x, at.y)
        height = self.reader.number(spec.route.get("elevation")) or at.z
        return Pose(lane.x, lane.y, height, normalize_angle(lane.yaw), turn.pitch, turn.roll)

    def pose_on(self, parent: Spec, own: Pose) -> Pose | None:
        """Return a pose, given in a parent's frame, in the frame of the actor that carries it or in the world."""
        if parent.kind == "walker":
            return Pose(own.x, own.y, own.z + WALKER_ORIGIN, own.yaw, own.pitch, own.roll)
        if parent.kind == "vehicle":
            return own
        base = self.mount(parent)
        return None if base is None else base.compose(own)

    def actor_of(self, spec: Spec) -> Spec | None:
        """Return the actor that a sensor is attached to, directly or through other sensors; None if there is none."""
        parent = self.parent(spec)
        while parent is not None and parent.kind not in ACTORS:
            parent = self.parent(parent)
        return parent

    def note_number(self, number: Number, to: str, value: float, why: str) -> None:
        """Record the outcome of a number of a transform; does nothing for a default."""
        if number.node is None:
            return
        if number.low == number.high == value and not isinstance(number.node.value.data, tuple):
            self.reader.ledger.kept(number.node, to)
            return
        for leaf in number.node.leaves():
            self.reader.ledger.mapped(leaf, to, round(value, 6), why)

    def draw(self, number: Number, path: str, low: float, high: float) -> None:
        """Write a draw for a number that is a range; `path` is below `base`."""
        if number.low == number.high or number.node is None:
            return
        span = [round(low, 6), round(high, 6)]
        self.draft.draws[path] = {"uniform": span}
        for leaf in number.node.leaves():
            self.reader.ledger.mapped(leaf, f"sweep.draw.values.{path}", span, "drawn uniformly from this range")

    def _name_actors(self) -> None:
        """Name walkers and vehicles after their role names, or else by kind and number."""
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
                why = "names are unique and consist of letters, digits, _ and -"
                self.reader.ledger.mapped(role, f"base.actors.{name}", name, why)

    def _has_too_many(self) -> bool:
        """Report the first entry beyond each limit; return whether there is one."""
        limits = (
            (ACTORS, BASE_NUMBERS[1], "actor", "actors", "write an ActorsGenerator for crowds"),
            (("sensor",), MAX_SENSORS, "sensor", "sensors", "split the configuration"),
            (("patch",), MAX_PATCHES, "patch", "patches", "split the configuration"),
            (("generator",), MAX_GENERATORS, "ActorsGenerator", "ActorsGenerators", "give one a larger count"),
        )
        over = False
        for kinds, most, what, plural, otherwise in limits:
            found = self.of_kind(*kinds)
            if len(found) > most:
                message = count(len(found), what, plural)
                self.reader.reject(found[most].node, message, f"keep at most {most}, or {otherwise}", Code.INPUT_LIMIT)
                over = True
        return over

    def _attach(self) -> None:
        """Find the parent of each sensor: the entry that contains it, or the one with the role name in `attach_to`."""
        roles: dict[str, Spec] = {}
        for spec in self.specs:
            role = spec.attributes.get("role_name")
            if role is not None:
                roles.setdefault(str(role.value.data), spec)
        for spec in self.specs:
            parent = spec.container
            if spec.role is not None and parent is not None:
                self.reader.ledger.ignored(spec.role, f"it is nested in {parent.node.key}, to which it is attached")
            elif spec.role is not None:
                parent = self._with_role(spec, roles)
            if spec.kind == "sensor" and parent is not None:
                self.parents[id(spec)] = parent
            elif parent is not None and spec.role is not None and spec.container is None:
                self.reader.ledger.ignored(spec.role, "only sensors can be attached to an actor")
        for spec in self.of_kind("sensor"):
            self._check_circle(spec)
        for spec in self.of_kind("sensor"):
            self._copy_motion_of_parent(spec)

    def _with_role(self, spec: Spec, roles: Mapping[str, Spec]) -> Spec | None:
        assert spec.role is not None
        role = self.reader.text(spec.role)
        found = roles.get(role or "")
        if role is not None and found is None:
            known = (
                f"write one of {', '.join(map(show, list(roles)[:20]))}" if roles else "give an actor this role_name"
            )
            message = f"no entry has the role_name {show(role)}; the collector would wait for it forever"
            self.reader.reject(spec.role, message.replace("; ", ": "), known, Code.UNKNOWN_NAME)
        return found

    def _check_circle(self, spec: Spec) -> None:
        seen: list[Spec] = [spec]
        while (parent := self.parent(seen[-1])) is not None:
            if any(parent is each for each in seen):
                del self.parents[id(spec)]
                self.reader.reject(spec.role or spec.node, "it is attached to itself", "attach it to an actor")
                return
            seen.append(parent)

    def _copy_motion_of_parent(self, spec: Spec) -> None:
        """Give a sensor that is attached to a moving sensor, without an offset, the same pose and motion."""
        parent = self.parent(spec)
        if parent is None or parent.kind != "sensor":
            return
        self._copy_motion_of_parent(parent)
        moves = parent.goal or parent.jitter or parent.route or parent.attachment
        if not moves:
            return
        own = spec.transform.pose if spec.transform is not None else Pose()
        if own != Pose() or spec.goal or spec.jitter or spec.route or spec.attachment:
            message = f"it is attached to {parent.node.key}, which moves, but has a different pose or motion"
            remedy = "attach it to an actor, or give it the pose and motion of that sensor"
            self.reader.reject(spec.node, message, remedy)
            return
        for leaf in spec.transform.node.leaves() if spec.transform is not None and spec.transform.node else ():
            self.reader.ledger.mapped(leaf, "", f"the pose of {parent.node.key}", "it is attached to that sensor")
        if spec.role is not None:
            self.reader.ledger.mapped(spec.role, "", f"the pose of {parent.node.key}", "it is attached to that sensor")
        spec.role, spec.transform, spec.goal, spec.speed = None, parent.transform, parent.goal, parent.speed
        spec.jitter, spec.route, spec.attachment = parent.jitter, parent.route, parent.attachment
        grandparent = self.parent(parent)
        if grandparent is None:
            del self.parents[id(spec)]
        else:
            self.parents[id(spec)] = grandparent

    def _points(self) -> list[Point]:
        """Return the world positions of the configuration before the shift."""
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
            elif spec.kind == "sensor" and self.parent(spec) is None:
                moves = spec.goal is not None and spec.route is None
                goal = (spec.goal.pose.x, spec.goal.pose.y) if spec.goal is not None and moves else None
                points.append(Point("sensor", pose.x, pose.y, pose.z, goal=goal))
        return points
