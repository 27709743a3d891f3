"""Plans of single actors for tests."""

from __future__ import annotations

from typing import Any

from recipe_compiler.ir.plan import ActorPlan, Point, Pose
from recipe_compiler.library import blueprints
from recipe_compiler.library.blueprints import Blueprint


def actor(
    name: str,
    blueprint: str | Blueprint = "vehicle.sedan.a",
    start: Pose | None = None,
    *route: tuple[float, float] | Point,
    speed: float | None = None,
    **more: Any,
) -> ActorPlan:
    """Return the plan of an actor of a blueprint, or of the first that matches a glob; `more` are other fields."""
    found = blueprints.match(blueprint)[0] if isinstance(blueprint, str) else blueprint
    fields = {
        "name": name,
        "blueprint": found.id,
        "category": found.category,
        "tag": found.tag,
        "instance": 1,
        "shape": dict(found.shape),
        "start": start or Pose(),
        "route": tuple(p if isinstance(p, Point) else Point(x=p[0], y=p[1]) for p in route),
        "speed": found.default_speed if speed is None else speed,
    }
    return ActorPlan.model_validate(fields | more)
