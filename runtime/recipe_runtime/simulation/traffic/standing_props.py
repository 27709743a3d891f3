"""Props as drivers see them: static bodies that may block the road."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from recipe_compiler.ir.ground.obstacles import Obstacle
from recipe_compiler.ir.plan import ActorPlan, PropPlan

from recipe_runtime.simulation.terrain import Ground

_KEPT = 20.0  # metres that a vehicle may drive before the props near it are searched again


@dataclass(frozen=True, slots=True)
class StandingProp:
    """A prop as a static body; its longer side is along its heading."""

    actor: ActorPlan
    x: float
    y: float
    heading: tuple[float, float]
    reach: float
    radius: float
    velocity: tuple[float, float] = (0.0, 0.0)
    speed: float = 0.0
    present: bool = True

    @classmethod
    def of(cls, prop: PropPlan, ground: float) -> StandingProp | None:
        """Return a prop as a body; None if vehicles can drive over or under it.

        Args:
            prop: The prop.
            ground: Height of the ground at its origin, metres.
        """
        box = Obstacle.of_prop(prop, ground)
        if box is None:
            return None
        plan = ActorPlan(
            name=prop.name,
            blueprint="prop",
            category="vehicle",
            tag=prop.tag,
            instance=1,
            shape={"body": -1.0},
            start=prop.pose,
            route=(),
            speed=0.0,
        )
        if box.depth >= box.width:
            return cls(plan, box.x, box.y, (box.cos, box.sin), box.depth, box.width)
        return cls(plan, box.x, box.y, (-box.sin, box.cos), box.width, box.depth)


def standing_props(props: Iterable[PropPlan], ground: Ground) -> Sequence[StandingProp]:
    """Return the props that can block vehicles, in the order of the plan."""
    found = (StandingProp.of(prop, ground.height(prop.pose.x, prop.pose.y)) for prop in props)
    return [body for body in found if body is not None]


class PropsNearby:
    """The props near one vehicle."""

    def __init__(self, props: Sequence[StandingProp]) -> None:
        self._all, self._near = props, props
        self._place: tuple[float, float] | None = None

    def near(self, x: float, y: float, distance: float) -> Sequence[StandingProp]:
        """Return the props within a distance of a position, and some farther ones."""
        if self._place is None or abs(x - self._place[0]) > _KEPT or abs(y - self._place[1]) > _KEPT:
            far = distance + _KEPT
            self._place = x, y
            self._near = [b for b in self._all if abs(b.x - x) < far + b.reach and abs(b.y - y) < far + b.reach]
        return self._near
