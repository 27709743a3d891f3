"""Bodies of a town: one per element of its plan, with vertices in the world frame."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from recipe_compiler.ir.plan import Element, Pose, TownPlan

from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.buildings import building
from recipe_runtime.meshes.fences import fence, wall
from recipe_runtime.meshes.furniture import bench, billboard, bin_, bollard, bus_stop, hydrant, kiosk, lamp
from recipe_runtime.meshes.houses import house
from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.monuments import fountain, statue
from recipe_runtime.meshes.plants import bush, hedge, planter
from recipe_runtime.meshes.roads import carriageway, ground, junction, parking, path, road, sidewalk
from recipe_runtime.meshes.signs import gantry, guardrail, sign, signal_lamps, traffic_light
from recipe_runtime.meshes.street_life import bicycles, board, cafe, delivery, letter_box
from recipe_runtime.meshes.towers import tower
from recipe_runtime.meshes.trees import tree

_KEPT_ELEMENTS = 1000  # 20 KB of vertices and triangles each
_kept: dict[str, tuple[Body, ...]] = {}  # of the last town, by its digest

_KINDS: dict[str, Callable[[Builder, Element], None]] = {
    "bench": bench,
    "bicycles": bicycles,
    "billboard": billboard,
    "bin": bin_,
    "board": board,
    "bollard": bollard,
    "building": building,
    "bus_stop": bus_stop,
    "bush": bush,
    "cafe": cafe,
    "carriageway": carriageway,
    "delivery": delivery,
    "fence": fence,
    "fountain": fountain,
    "gantry": gantry,
    "ground": ground,
    "guardrail": guardrail,
    "hedge": hedge,
    "house": house,
    "hydrant": hydrant,
    "junction": junction,
    "kiosk": kiosk,
    "lamp": lamp,
    "letter_box": letter_box,
    "parking": parking,
    "path": path,
    "planter": planter,
    "road": road,
    "sidewalk": sidewalk,
    "sign": sign,
    "statue": statue,
    "tower": tower,
    "traffic_light": traffic_light,
    "tree": tree,
    "wall": wall,
}


def town_bodies(town: TownPlan) -> tuple[Body, ...]:
    """Return a body per element, in plan order: one part `static` in world coordinates, with instance 0.

    The last town that is not large is kept: the scenes of a sweep differ in casts and props, and share their town.
    """
    if len(town.elements) > _KEPT_ELEMENTS:
        return tuple(_body(element) for element in town.elements)
    bodies = _kept.get(town.digest)
    if bodies is None:
        bodies = tuple(_body(element) for element in town.elements)
        _kept.clear()
        _kept[town.digest] = bodies
    return bodies


def signal_bodies(town: TownPlan) -> tuple[Body, ...]:
    """Return a body per traffic light, in plan order: its lit lenses, a part each, in the element's frame."""
    return tuple(
        Body(element.name, 0, _lamps(element.size, tuple(sorted(element.shape.items()))), is_signal=True)
        for element in town.elements
        if element.kind == "traffic_light"
    )


@lru_cache(maxsize=64)
def _lamps(size: tuple[float, float, float], shape: tuple[tuple[str, float], ...]) -> tuple[tuple[str, Mesh], ...]:
    element = Element(name="traffic_light", kind="traffic_light", pose=Pose(), size=size, shape=dict(shape))
    return signal_lamps(element)


def _body(element: Element) -> Body:
    builder = _local(element.kind, element.size, tuple(sorted(element.shape.items())))
    return Body(element.name, 0, (("static", builder.mesh(from_pose(element.pose))),))


@lru_cache(maxsize=64)
def _local(kind: str, size: tuple[float, float, float], shape: tuple[tuple[str, float], ...]) -> Builder:
    """Return an element in its own frame; equal elements, such as lamps, share the result."""
    builder = Builder()
    _KINDS[kind](builder, Element(name=kind, kind=kind, pose=Pose(), size=size, shape=dict(shape)))
    return builder
