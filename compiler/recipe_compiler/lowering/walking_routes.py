"""Plans the routes of all pedestrians of a scene, and checks where actors start.

A start or a goal inside an obstacle is an error, reported with the nearest free position, and so is a goal that cannot
be reached. Routes of traffic end before a position that cannot be reached.

Routes of named pedestrians lead around buildings, furniture, props and stationary vehicles; stationary vehicles are the
only actors that affect another actor's plan. Routes of traffic ignore vehicles, which are avoided in the simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.ground.obstacles import Obstacle
from recipe_compiler.ir.ground.path_planner import XY, Planner, TooManyObstaclesError, TooMuchWorkError, Work
from recipe_compiler.ir.plan import ActorPlan, Pause, Point, PropPlan
from recipe_compiler.ir.plan_bounds import POSE, SITTING
from recipe_compiler.ir.plan_types import MAX_POINTS
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.enclosures import Yards
from recipe_compiler.schema.scene import Actor
from recipe_compiler.source.yaml_reader import Value

_WORK = 20_000_000  # obstacle tests for all named pedestrians together, about ten seconds
_REMEDIES = 4_000_000  # obstacle tests for the free points in remedies, about two seconds
_NEAREST = "the nearest free point is x: {:g}, y: {:g}"
_MOVE = "move it to a lane or a sidewalk, which a map of the town shows"
_IN_YARD = "it is in a yard enclosed by buildings and walls, which the actor cannot leave"

Path = tuple[str | int, ...]  # keys and indices of a value of the recipe


class RecipeWork:
    """The work allowed for planning the routes of all scenes of a recipe, and the yards that they share.

    Attributes:
        routes: for routes.
        remedies: for free points in error messages, which are omitted when this is used up.
    """

    MOST = 60_000_000  # obstacle tests, about half a minute

    def __init__(self, *, unlimited: bool = False) -> None:
        self.routes = Work() if unlimited else Work(self.MOST)
        self.remedies = Work(_REMEDIES)
        self._yards: dict[str, Yards] = {}  # by the digest of the town's plan

    def yards(self, town: Town) -> Yards:
        """The yards of a town."""
        digest = town.plan.digest
        if digest not in self._yards:
            self._yards[digest] = Yards(town)
        return self._yards[digest]


class WalkingRoutes:
    """The walking routes of one scene.

    Attributes:
        problems: Errors in starts and routes.
        warnings: Probable mistakes.
        solid: The town's obstacles and the props that block the way.
    """

    def __init__(
        self,
        base: Value,
        given: Mapping[str, Actor],
        town: Town,
        props: Sequence[PropPlan],
        actors: Sequence[ActorPlan],
        work: RecipeWork,
    ) -> None:
        """Prepare planning.

        Args:
            base: the recipe's base, for the places of its values.
            given: the actors of the recipe by name.
            town: the town.
            props: the props of the scene.
            actors: the actors; their routes are not planned yet.
            work: the work left for the recipe; `TooMuchWorkError` is raised when it is used up.
        """
        self._remedies = work.remedies
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self._base, self._given, self._actors = base, given, actors
        blocking = (Obstacle.of_prop(prop, town.ground(prop.pose.x, prop.pose.y)) for prop in props)
        static = town.obstacles.with_more(o for o in blocking if o is not None) if props else town.obstacles
        self.solid = static
        standing = [a for a in actors if a.category == "vehicle" and (not a.route or a.speed <= 0.0)]
        self._crowd = Planner(static, total=work.routes)
        vehicles = [Obstacle.of_vehicle(actor) for actor in standing]
        self._named = Planner(static.with_more(vehicles) if vehicles else static, _WORK, work.routes)
        self._yards = work.yards(town)

    def planned(self) -> tuple[ActorPlan, ...]:
        """Return the actors, those who walk with planned routes."""
        plans: dict[str, ActorPlan] = {}
        for actor in self._actors:
            if actor.name in self._given:
                plans[actor.name] = self._lower_named(actor, self._given[actor.name])
            elif actor.category != "pedestrian":
                plans[actor.name] = actor
            elif actor.companion is not None:
                plans[actor.name] = actor.model_copy(update={"route": plans[actor.companion].route})
            else:
                plans[actor.name] = self._walking(actor)
        return tuple(plans.values())

    def _lower_named(self, actor: ActorPlan, given: Actor) -> ActorPlan:
        """Check the start and the waypoints of an actor, and plan its route if it walks."""
        waypoints = [given.goal] if given.goal is not None else given.route or ()
        goals = [self._refuses(actor, (p.x, p.y), _path(given, n)) for n, p in enumerate(waypoints)]
        start = actor.start.x, actor.start.y
        if (given.start is not None and self._refuses(actor, start, ("start",))) or any(goals):
            return actor
        planned = actor.category == "pedestrian" and actor.route
        if given.start is not None and not (planned and waypoints):
            self._warn_of_yard(actor, routed=bool(waypoints))
        if not planned:
            return actor
        return self._routed(actor, given) if waypoints else self._walking(actor)

    def _refuses(self, actor: ActorPlan, at: XY, path: Path) -> bool:
        """Report a start or a waypoint inside something solid: for a vehicle, its middle.

        Args:
            actor: the actor.
            at: the start or the waypoint.
            path: where it is in the recipe.
        """
        if actor.shape.get(POSE) == SITTING:  # on a bench, for example
            return False
        solid = self._named.inside(*at) if actor.category == "pedestrian" else self._crowd.inside(*at, 0.0)
        if solid is None:
            return False
        try:
            free = self._named.nearest_free(*at, self._is_open, self._remedies)
        except TooMuchWorkError:
            free = None
        remedy = _MOVE if free is None else _NEAREST.format(*free)
        self._refuse((actor.name, *path), f"it is inside {solid.name}", remedy)
        return True

    def _is_open(self, x: float, y: float) -> bool:
        """Return whether a position is in no yard."""
        return not self._yards.around(x, y)

    def _warn_of_yard(self, actor: ActorPlan, *, routed: bool) -> None:
        """Warn of a start in a yard, unless a given route stays within it."""
        yard = self._yards.around(actor.start.x, actor.start.y)
        if yard and not (routed and all(self._yards.cell(p.x, p.y) in yard for p in actor.route)):
            place = self._base.place_of("actors", actor.name, "start")
            self.warnings.append(Problem(f"actors.{actor.name}.start: {_IN_YARD}", place, _MOVE, Code.PLACEMENT))

    def _routed(self, actor: ActorPlan, given: Actor) -> ActorPlan:
        """Plan the way of an actor through the waypoints of the recipe."""
        at: XY = (actor.start.x, actor.start.y)
        points: list[Point] = []
        for n, waypoint in enumerate(actor.route):
            target, path = (waypoint.x, waypoint.y), (actor.name, *_path(given, n))
            try:
                way = self._named.shortest_path(at, target)
            except TooManyObstaclesError:
                self._refuse(path, "the way there leads round too many obstacles", "give waypoints, as `route`")
                return actor
            if way is None:
                free = self._nearest_reachable(at, target)
                remedy = _MOVE if free is None else _NEAREST.format(*free)
                self._refuse(path, f"it cannot be reached from x: {at[0]:g}, y: {at[1]:g}", remedy)
                return actor
            points += [Point(x=x, y=y) for x, y in way]
            at = target
        if len(points) > MAX_POINTS:
            message = f"with the path around obstacles it has {len(points)} waypoints, which exceed the limit of"
            self._refuse((actor.name, "route"), f"{message} {MAX_POINTS}", "shorten it")
            return actor
        return actor.model_copy(update={"route": tuple(points)})

    def _walking(self, actor: ActorPlan) -> ActorPlan:
        """Plan the way of traffic along its waypoints, as far as they can be reached."""
        at: XY = (actor.start.x, actor.start.y)
        points: list[Point] = []
        pauses: list[Pause] = []
        seconds = {pause.waypoint: pause.seconds for pause in actor.pauses}
        for n, waypoint in enumerate(actor.route):
            wanted = (waypoint.x, waypoint.y)
            target = wanted if self._crowd.clear(*wanted) else self._crowd.nearest_free(*wanted)
            try:
                way = None if target is None else self._crowd.shortest_path(at, target)
            except TooManyObstaclesError:
                way = None
            if way is None or len(points) + len(way) > MAX_POINTS:
                break
            points += [Point(x=x, y=y) for x, y in way]
            at = way[-1]
            if n in seconds:
                pauses.append(Pause(waypoint=len(points) - 1, seconds=seconds[n]))
        return actor.model_copy(update={"route": tuple(points), "pauses": tuple(pauses)})

    def _nearest_reachable(self, start: XY, goal: XY) -> XY | None:
        """Return the free place nearest to a goal that is in a yard; None if the start is in one."""
        yard = self._yards.around(*goal)
        if self._yards.around(*start) or not yard:
            return None

        def is_apart(x: float, y: float) -> bool:
            i, j = self._yards.cell(x, y)
            return not any((i + u, j + v) in yard for u in (-1, 0, 1) for v in (-1, 0, 1))

        try:
            free = self._named.nearest_free(*goal, is_apart, self._remedies)
            return free if free is not None and self._named.shortest_path(start, free) is not None else None
        except (TooManyObstaclesError, TooMuchWorkError):
            return None

    def _refuse(self, path: Path, what: str, remedy: str) -> None:
        label = ".".join(map(str, path[:2])) + "".join(f"[{number}]" for number in path[2:])
        place = self._base.place_of("actors", *path)
        self.problems.append(Problem(f"actors.{label}: {what}", place, remedy, Code.PLACEMENT))


def _path(given: Actor, number: int) -> Path:
    """Return the path of an actor's waypoint below the actor."""
    return ("goal",) if given.goal is not None else ("route", number)
