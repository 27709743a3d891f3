"""The scene of a configuration: names of its entries, attachments of sensors, and the shift of positions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Draft, name_for
from recipe_compiler.carla.forms.specs import ANGLES, Number, Spec, Transform
from recipe_compiler.carla.handedness import MIRRORED, WALKER_ORIGIN, Pose, normalize_angle, normalize_range
from recipe_compiler.carla.options import Options
from recipe_compiler.carla.placement import XY, Point, Site
from recipe_compiler.carla.report import Node, Path
from recipe_compiler.carla.settings import Settings
from recipe_compiler.ir.errors import Code
from recipe_compiler.ir.plurals import count
from recipe_compiler.source.yaml_reader import show

_MAX_ENTRIES = 300
_MAX_CHAIN = 32  # sensors that are attached to one another
SIGN_CHANGED = "sign changed"
ACTORS = ("walker", "vehicle")


@dataclass
class Scene:
    """The state that the parts of an import share while they write a scene.

    Attributes:
        reader: collects problems and the outcome of each key.
        draft: the recipe.
        settings: clock, seed and town.
        specs: the entries, and the actors that another program spawns.
        references: the path of the value that each reference names, by the path of the reference.
        site: the town.
        options: what is chosen for the import.
        vector: the shift of all world positions, x and y in metres.
    """

    reader: Reader
    draft: Draft
    settings: Settings
    specs: list[Spec]
    references: Mapping[Path, Path]
    site: Site
    options: Options
    vector: XY = (0.0, 0.0)

    def of_kind(self, *kinds: str) -> list[Spec]:
        """The entries of some kinds."""
        return [spec for spec in self.specs if spec.kind in kinds]

    def prepare(self) -> None:
        """Name the entries, resolve attachments and choose the shift; or report a problem if there are too many."""
        if len(self.specs) > _MAX_ENTRIES:
            remedy = f"keep at most {_MAX_ENTRIES}, or write an ActorsGenerator for crowds"
            first = self.specs[_MAX_ENTRIES].node
            self.reader.reject(first, count(len(self.specs), "entry", "entries"), remedy, Code.INPUT_LIMIT)
            return
        roles = self._roles()
        self._name_actors()
        self._attach(roles)
        self.vector = self.site.shift(self._points())

    def notes(self) -> Iterator[str]:
        """Yield notes for the report on the actors that another program spawns."""
        heroes = [spec.name for spec in self.specs if spec.origin]
        if heroes:
            yield (
                f"{', '.join(heroes)}: an actor that another program spawns in CARLA, such as ScenarioRunner, manual"
                " control or generate_traffic.py; here it starts at a random spawn point and drives in traffic. Its"
                " blueprint, and the traffic around it, can be chosen in the command"
            )
        elif self.options.hero is not None:
            yield "the hero chosen in the command is not used: every sensor's attach_to names an entry"

    @property
    def shift(self) -> dict[str, float]:
        """The shift of world positions by axis."""
        return {"x": self.vector[0], "y": self.vector[1]}

    def world(self, pose: Pose) -> Pose:
        """A pose of the world frame, moved to its place in the town."""
        return replace(pose, x=pose.x + self.vector[0], y=pose.y + self.vector[1])

    def mount(self, spec: Spec) -> Pose | None:
        """Return the pose of a sensor: in the frame of the actor that it is attached to, or in the world.

        Returns:
            None if it has neither a transform nor a parent.
        """
        own = spec.transform.pose if spec.transform is not None else Pose()
        parent = spec.parent
        if self.follows_road(spec):
            return self._on_road(spec, own)
        if parent is None:
            return None if spec.transform is None else self.world(own)
        return self.pose_on(parent, own)

    def follows_road(self, spec: Spec) -> bool:
        """Return whether a sensor follows the lanes of the town."""
        return spec.route is not None and spec.parent is None

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
            return replace(own, z=own.z + WALKER_ORIGIN)
        if parent.kind == "vehicle":
            return own
        base = self.mount(parent)
        return None if base is None else base.compose(own)

    def actor_of(self, spec: Spec) -> Spec | None:
        """Return the actor that a sensor is attached to, directly or through other sensors; None if there is none."""
        parent = spec.parent
        while parent is not None and parent.kind not in ACTORS:
            parent = parent.parent
        return parent

    def note(self, transform: Transform, to: str, pose: Pose, axes: Sequence[str], moved: Mapping[str, float]) -> None:
        """Record the outcome of numbers of a transform, and write draws for those that are ranges.

        Args:
            transform: the transform.
            to: the path of the pose in the recipe.
            pose: the pose in the recipe.
            axes: the numbers.
            moved: what is added to numbers after the change of signs, metres.
        """
        for axis in axes:
            number, offset = transform.numbers[axis], moved.get(axis, 0.0)
            words = [SIGN_CHANGED] if axis in MIRRORED else []
            if axis == "z":
                words.append(f"from the feet, which are {offset:g} m below the origin of CARLA's walkers")
            elif axis == "roll":
                words.append("the same angle, from -180 to 180 degrees")
            elif axis in moved:
                words.append(f"moved by {offset:g}")
            low, high = number.low + offset, number.high + offset
            if axis in MIRRORED:
                low, high = offset - number.high, offset - number.low
            span = normalize_range(low, high) if axis in ANGLES else (low, high)
            self.note_number(number, f"{to}.{axis}", getattr(pose, axis), ", ".join(words), span)

    def note_number(self, number: Number, to: str, value: float, why: str, span: XY | None = None) -> None:
        """Record the outcome of a number; if it is a range, write a draw from `span`, the range in the recipe."""
        if number.node is None:
            return
        if number.low != number.high and span is not None:
            path, drawn = to.removeprefix("base."), [round(span[0], 6), round(span[1], 6)]
            self.draft.draws[path] = {"uniform": drawn}
            why = "drawn uniformly from this range"
            self.reader.ledger.mapped(number.node, f"sweep.draw.values.{path}", drawn, why)
        elif number.low == number.high == value and not isinstance(number.node.value.data, tuple):
            self.reader.ledger.kept(number.node, to)
        else:
            self.reader.ledger.mapped(number.node, to, value, why)

    def give_name(self, specs: Sequence[Spec], taken: list[str], fallback: str, to: str, why: str) -> str:
        """Return a free name for entries: the first role name, or else the first name, of them."""
        roles = [(role, self.reader.text(role)) for spec in specs if (role := spec.attributes.get("role_name"))]
        texts = [*(text for _, text in roles), *(spec.wanted_name for spec in specs)]
        name = name_for(next(filter(None, texts), fallback), taken, fallback)
        taken.append(name)
        for spec in specs:
            spec.name = name
        for role, text in roles:
            self.reader.ledger.record(role, f"{to}.{name}", name, "" if text == name else why)
        return name

    def _name_actors(self) -> None:
        """Name walkers and vehicles after their role names, or else by kind and number."""
        taken: list[str] = []
        numbers = dict.fromkeys(ACTORS, 0)
        for spec in self.of_kind(*ACTORS):
            numbers[spec.kind] += 1
            why = "names are unique and consist of letters, digits, _ and -"
            self.give_name([spec], taken, f"{spec.kind}{numbers[spec.kind]}", "base.actors", why)

    def _roles(self) -> dict[str, Spec]:
        """Return the entries by role name; those that another program spawns are added to the scene."""
        roles: dict[str, Spec] = {}
        for spec in self.specs:
            if (role := spec.attributes.get("role_name")) is not None:
                roles.setdefault(str(role.value.data), spec)
        for spec in self.of_kind("sensor"):
            if spec.role is None or spec.container is not None or (wanted := self.reader.text(spec.role)) is None:
                continue
            if wanted not in roles and (hero := self.options.hero_for(wanted)) is not None:
                why = (
                    f"no entry has the role_name {show(wanted)}, which another program gives to a {hero[1]}: {hero[0]}"
                )
                roles[wanted] = Spec(spec.role, hero[1], hero[0], wanted_name=wanted, origin=why)
                self.specs.append(roles[wanted])
        return roles

    def _attach(self, roles: Mapping[str, Spec]) -> None:
        """Find the parent of each sensor: the entry that contains it, or the one with the role name in `attach_to`."""
        ledger = self.reader.ledger
        for spec in self.specs:
            parent = spec.container
            if parent is not None:
                ledger.ignored(spec.role, f"it is nested in {parent.node.key}, to which it is attached")
            elif spec.kind != "sensor":
                ledger.ignored(spec.role, "only sensors can be attached to an actor")
            elif spec.role is not None:
                parent = self._with_role(spec.role, roles)
            if spec.kind == "sensor" and parent is not None:
                spec.parent = parent
        for spec in self.of_kind("sensor"):
            self._check_chain(spec)
        for spec in self.of_kind("sensor"):
            self._copy_motion_of_parent(spec)

    def _with_role(self, node: Node, roles: Mapping[str, Spec]) -> Spec | None:
        role = self.reader.text(node)
        found = roles.get(role or "")
        if role is not None and found is None:
            known = ", ".join([show(each) for each in roles][:20])
            other = "choose in the command the blueprint of an actor that another program spawns"
            remedy = f"write one of {known}, or {other}" if known else other
            message = f"no entry has the role_name {show(role)}"
            self.reader.reject(node, message, remedy, Code.UNKNOWN_NAME)
        return found

    def _check_chain(self, spec: Spec) -> None:
        """Report a sensor that is attached to itself, or through so many sensors that its pose takes too long."""
        last: Spec | None = spec
        for _ in range(_MAX_CHAIN):
            last = None if last is None else last.parent
        if last is not None:
            spec.parent = None
            message = f"it is attached to itself, or through more than {_MAX_CHAIN} sensors"
            self.reader.reject(spec.role or spec.node, message, "attach it to an actor")

    def _copy_motion_of_parent(self, spec: Spec) -> None:
        """Give a sensor that is attached to a moving sensor, without an offset, the same pose and motion."""
        parent = spec.parent
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
        leaves = [] if spec.transform is None else list(spec.transform.node.leaves())
        for leaf in [*leaves, spec.role]:
            self.reader.ledger.mapped(leaf, "", f"the pose of {parent.node.key}", "it is attached to that sensor")
        spec.role, spec.transform, spec.goal, spec.speed = None, parent.transform, parent.goal, parent.speed
        spec.jitter, spec.route, spec.attachment = parent.jitter, parent.route, parent.attachment
        spec.parent = parent.parent

    def _points(self) -> list[Point]:
        """Return the world positions of the configuration before the shift."""
        points = []
        for spec in self.specs:
            start = spec.transform or (spec.goal if spec.kind == "walker" else None)
            if start is None or spec.parent is not None or spec.kind not in ("walker", "vehicle", "sensor"):
                continue
            goal = spec.goal if spec.transform is not None and spec.kind != "vehicle" and spec.route is None else None
            to = None if goal is None else (goal.pose.x, goal.pose.y)
            points.append(Point(spec.kind, start.pose.x, start.pose.y, start.pose.z, start.pose.yaw, to))
        return points
