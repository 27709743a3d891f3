"""The town's bodies: one for each element of its plan, with vertices already in the world frame."""

from __future__ import annotations

from collections.abc import Callable

from recipe_compiler.plan import Element, TownPlan

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.buildings import building
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.props import bench, bin_, lamp, tower, tree, wall
from recipe_runtime.meshes.roads import ground, junction, road, sidewalk
from recipe_runtime.transforms import from_pose

_KINDS: dict[str, Callable[[Builder, Element], None]] = {
    "bench": bench,
    "bin": bin_,
    "building": building,
    "ground": ground,
    "junction": junction,
    "lamp": lamp,
    "road": road,
    "sidewalk": sidewalk,
    "tower": tower,
    "tree": tree,
    "wall": wall,
}


def town_bodies(town: TownPlan) -> tuple[Body, ...]:
    """A static body an element, in plan order: one part, `static`, in world coordinates; instance 0."""
    return tuple(_body(element) for element in town.elements)


def _body(element: Element) -> Body:
    builder = Builder()
    _KINDS[element.kind](builder, element)
    return Body(element.name, 0, (("static", builder.mesh(from_pose(element.pose))),))
