"""Computes the workload of a variant, the input of the cost model in `limits`, before or after lowering."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, Protocol

from recipe_compiler import limits
from recipe_compiler.expand import Variant
from recipe_compiler.ir import exact, optics, plan_bounds
from recipe_compiler.ir.patches import INSERTED, STATIC, WITH_CHART
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_compiler.ir.rig.arm import history
from recipe_compiler.ir.semantic_tags import Category
from recipe_compiler.library import towns
from recipe_compiler.load import Clip, Load
from recipe_compiler.lowering import props_nearby, traffic
from recipe_compiler.lowering.actors import MAX_ROUTE
from recipe_compiler.lowering.asset_files import ALL_PIXELS, ALL_TRIANGLES, AssetFile, Corner
from recipe_compiler.lowering.patches import lower as patch_lowering
from recipe_compiler.lowering.props import BOARD_TRIANGLES
from recipe_compiler.lowering.sensors import arms
from recipe_compiler.schema.camera import Sensor
from recipe_compiler.schema.motion import Motion
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Actor
from recipe_compiler.schema.tick import interval_of

_BOXES = 0.45  # share of the elements of a town that shorten arms, at most
_MOTION, _MAX_MOMENTS = 0.5, 96.0  # of a picture, widths per second; of motion blur
_METRES_A_SECOND, _METRES_A_POINT = 5.0, 25.0  # of generated routes: mean speed, mean distance between waypoints


class MeshSize(NamedTuple):
    """The size of a mesh."""

    triangles: int = 0
    parts: int = 0
    text: int = 0  # bytes of an OBJ file, each of which takes time, also in empty lines


@dataclass(frozen=True)
class AssetSizes:
    """The sizes of a recipe's assets, which plans do not have.

    Attributes:
        texels: of all images.
        meshes: the size of each mesh, by its name in the recipe.
        files: the size of each mesh, by the SHA-256 of its file.
        boxes: the minimum and maximum corner of each mesh, in the unit of its file, by its name.
    """

    texels: int = 0
    meshes: Mapping[str, MeshSize] = field(default_factory=dict)
    files: Mapping[str, MeshSize] = field(default_factory=dict)
    boxes: Mapping[str, tuple[Corner, Corner]] = field(default_factory=dict)


def sizes_of(assets: Mapping[str, AssetFile]) -> AssetSizes:
    """Return the sizes of a recipe's assets."""
    meshes = {name: asset for name, asset in assets.items() if asset.triangles}
    return AssetSizes(
        texels=sum(asset.pixels[0] * asset.pixels[1] for asset in assets.values()),
        meshes={name: _mesh_size(asset) for name, asset in meshes.items()},
        files={asset.file.sha256: _mesh_size(asset) for asset in meshes.values()},
        boxes={name: (asset.low, asset.high) for name, asset in meshes.items()},
    )


def _mesh_size(asset: AssetFile) -> MeshSize:
    return MeshSize(asset.triangles, asset.parts, asset.file.bytes if asset.file.kind == "obj" else 0)


def _prop_sizes(sizes: Mapping[str, MeshSize], meshes: Iterable[str | None]) -> dict[str, int]:
    """Return the sizes of all props and of their distinct meshes, as arguments of `Load`.

    Args:
        sizes: the size of each mesh.
        meshes: the mesh of each prop; None for a board.
    """
    used = Counter(meshes)
    distinct = {mesh: sizes.get(mesh, MeshSize()) for mesh in used if mesh is not None}
    return {
        "props": used.total(),
        "triangles": sum(
            n * (BOARD_TRIANGLES if mesh is None else distinct[mesh].triangles) for mesh, n in used.items()
        ),
        "parts": sum(n * distinct[mesh].parts for mesh, n in used.items() if mesh is not None),
        "mesh_triangles": sum(mesh.triangles for mesh in distinct.values()),
        "mesh_parts": sum(mesh.parts for mesh in distinct.values()),
        "mesh_text": sum(mesh.text for mesh in distinct.values()),
    }


_NO_ASSETS = AssetSizes()


def estimated(variant: Variant, base: Base, changes: int, assets: AssetSizes) -> Load:
    """Estimate the workload of a variant before lowering, from its checked models.

    Args:
        variant: the variant.
        base: its checked base. Sections that are the same object in several variants count as shared.
        changes: the number of axes and draws merged over the base.
        assets: the sizes of the recipe's assets.
    """
    parts = base.clock, base.town, base.actors, base.traffic, base.props
    scene = (*map(id, parts), patch_lowering.board_key(base.patches), variant.seed)
    rig = (id(base.sensors), variant.seed)
    parameters = base.town.model_extra or {}
    elements = towns.elements(base.town.name, parameters)
    clock = base.clock
    crowds = traffic.counts(base)
    crowd = sum(crowds.values())
    seconds = clock.frames / clock.fps + traffic.warmup(base)
    wandering = crowd + sum(actor.route is None and actor.goal is None for actor in base.actors.values())
    points = wandering * min(seconds * _METRES_A_SECOND, MAX_ROUTE) / _METRES_A_POINT
    return Load(
        scene=scene,
        rig=rig,
        appearance=variant.name,
        steps=math.ceil(seconds * clock.physics),
        actors=len(base.actors) + crowd + base.traffic.parked,
        views=_views(base, elements),
        named=len(base.actors),
        town=(base.town.name, base.town.seed, json.dumps(parameters, sort_keys=True)),
        elements=elements,
        points=round(points) + sum(len(actor.route or ()) for actor in base.actors.values()),
        metres=sum(map(_given_metres, base.actors.values())),
        changes=changes,
        texels=assets.texels,
        sequences=any(p.texture is not None and p.texture.frames is not None for p in base.patches.values()),
        patches=len(base.patches),
        moving_patches=sum(patch.on.actor is not None for patch in base.patches.values()),
        inserted_patches=sum(patch.mode in INSERTED for patch in base.patches.values()),
        charts=sum(p.mode == "color_transfer" and p.color_transfer.method in WITH_CHART for p in base.patches.values()),
        patch_section=id(base.patches),
        patch_images=clock.frames
        * sum(p.texture is not None and p.texture.frames is not None for p in base.patches.values()),
        looks=_looks(base, assets, crowds, seconds),
        **_prop_sizes(assets.meshes, (prop.asset for prop in base.props.values())),
    )


def _views(base: Base, elements: int) -> tuple[Clip, ...]:
    """Estimate the clips of all sensors in a town with that many elements."""
    return tuple(
        Clip(
            len(range(0, base.clock.frames, interval_of(s.tick, base.clock.fps))),
            s.camera.width * s.camera.height,
            _samples(s.camera, s.camera.supersample),
            s.capture,
            base.clock.frames if s.motion != Motion() else 1,
            s.motion == Motion() and s.mount.on is None,
            s.camera.bloom_intensity > 0.0,
            _moments(s.camera, s.camera.width),
            min(interval_of(s.tick, base.clock.fps), base.clock.frames),
            round(elements * _BOXES) if arms.is_shortened(s) else 0,
            arms.earlier_frames(s, base.clock.fps),
            _height(s),
            optics.bends(s.camera),
            s.mount.pitch != 0.0,
            s.mount.roll != 0.0 or bool(s.motion.rotation and s.motion.rotation.roll),
        )
        for s in base.sensors.values()
    )


def _looks(base: Base, assets: AssetSizes, crowds: Mapping[Category, int], seconds: float) -> float:
    """Return how often agents look at props, as an argument of `Load`."""
    props = []
    for prop in base.props.values():
        at, box = prop.at, assets.boxes.get(prop.asset or "", ((0.0,) * 3, (0.0,) * 3))
        if prop.size is not None:
            box = (0.0, 0.0, 0.0), (0.0, prop.size.width / 2, prop.size.height)
        size = props_nearby.radius(*box, upright=at.pitch == at.roll == 0.0) * prop.scale
        props.append((at.x, at.y, size))
    moving = [actor.blueprint for actor in base.actors.values() if actor.speed != 0.0]
    vehicles = sum(blueprint.startswith("vehicle.") for blueprint in moving)
    pedestrians = len(moving) - vehicles + crowds["pedestrian"]
    return props_nearby.looks(props, pedestrians, vehicles + crowds["vehicle"], seconds)


def _given_metres(actor: Actor) -> float:
    """The length of the way that the recipe gives a vehicle, in metres."""
    points = [p for p in (actor.start, *(actor.route or ()), actor.goal) if p is not None]
    if not actor.blueprint.startswith("vehicle."):
        return 0.0
    return sum(exact.distance(a.x, a.y, b.x, b.y) for a, b in pairwise(points))


def _height(sensor: Sensor) -> float:
    """The height of the highest point that a sensor may reach, in metres."""
    at, motion = sensor.mount, sensor.motion
    points = [] if motion.route is None else motion.route.waypoints((at.x, at.y, at.z))
    heights = [at.z, *(z for _, _, z in points)]
    if motion.linear is not None and motion.linear.to.z is not None:
        heights.append(motion.linear.to.z)
    if motion.follow is not None:
        heights.append(motion.follow.height)
    return max(heights)


class _Shutter(Protocol):
    """The settings of motion blur."""

    @property
    def motion_blur_intensity(self) -> float: ...
    @property
    def motion_blur_max_distortion(self) -> float: ...
    @property
    def shutter_speed(self) -> float: ...


def _moments(camera: _Shutter, width: int) -> float:
    """Return how many moments of the exposure motion blur averages for a sample, if the picture moves by `_MOTION`."""
    if camera.motion_blur_intensity == 0.0:
        return 0.0
    length = min(camera.motion_blur_intensity / camera.shutter_speed * _MOTION, camera.motion_blur_max_distortion)
    return min(max(length * width, 1.0), _MAX_MOMENTS)


def _samples(camera: optics.Lens, supersample: int) -> int:
    width, height, _ = optics.undistorted_size(camera, supersample)
    return width * height


def measured(plan: ScenarioPlan, assets: AssetSizes = _NO_ASSETS) -> Load:
    """Compute the workload of a variant from its plan. Plans with the same digest count as shared.

    Args:
        plan: the plan.
        assets: the sizes of the recipe's assets.
    """
    clock = plan.scene.clock
    responses, patches = plan.appearance.responses, plan.appearance.patches
    views = tuple(
        Clip(
            len(s.frames(clock.frames)),
            s.camera.width * s.camera.height,
            _samples(s.camera, responses[s.name].supersample),
            s.capture,
            len(s.poses),
            len(s.poses) == 1 and s.on is None,
            responses[s.name].bloom_intensity > 0.0,
            _moments(responses[s.name], s.camera.width),
            min(s.interval, clock.frames),
            0 if s.arm is None else len(s.arm.obstacles),
            0 if s.arm is None else history(s.arm.decay),
            max(pose.z for pose in s.poses),
            optics.bends(s.camera),
            any(pose.pitch for pose in s.poses),
            any(pose.roll for pose in s.poses),
        )
        for s in plan.rig.sensors
    )
    return Load(
        scene=plan.scene.digest,
        rig=plan.rig.digest,
        appearance=plan.appearance.digest,
        steps=clock.warmup_steps + clock.frames * clock.steps_per_frame,
        actors=len(plan.scene.actors),
        views=views,
        named=sum("." not in actor.name for actor in plan.scene.actors),
        elements=len(plan.scene.town.elements),
        metres=plan_bounds.route_metres(plan.scene.actors),
        texels=assets.texels,
        sequences=any(patch.changes for patch in patches),
        patches=len(patches),
        moving_patches=sum(not patch.whole and patch.faces[0].part != STATIC for patch in patches),
        inserted_patches=sum(patch.inserted for patch in patches),
        charts=sum(patch.transfer in WITH_CHART for patch in patches),
        looks=_looks_of(plan),
        **_prop_sizes(assets.files, (p.mesh.sha256 if p.mesh else None for p in plan.scene.props)),
    )


def _looks_of(plan: ScenarioPlan) -> float:
    """Return how often agents look at props, from a plan."""
    props = [
        (p.pose.x, p.pose.y, props_nearby.radius(p.low, p.high, upright=p.pose.pitch == p.pose.roll == 0.0))
        for p in plan.scene.props
    ]
    moving = Counter(actor.category for actor in plan.scene.actors if actor.route and actor.speed > 0.0)
    clock = plan.scene.clock
    seconds = clock.warmup_steps / clock.physics + clock.frames / clock.fps
    return props_nearby.looks(props, moving["pedestrian"], moving["vehicle"], seconds)


def plan_cost(plan: DatasetPlan, *, largest_files: bool = False) -> limits.Cost:
    """Return the cost of building an existing plan, such as one from a dataset's folder, without compiling it.

    Plans do not have the sizes of their meshes and images. These count as nothing or, with `largest_files`, as much as
    those of a recipe may have.
    """
    loads: Iterable[Load] = map(measured, plan.variants)
    if largest_files:
        loads = map(_with_largest_files, loads, plan.variants)
    cost = limits.total(loads, plan.depth)
    memory = cost.main_memory - cost.compile_bytes
    return dataclasses.replace(cost, compile_seconds=0.0, compile_bytes=0, main_memory=memory)


def _with_largest_files(load: Load, plan: ScenarioPlan) -> Load:
    if any(prop.mesh for prop in plan.scene.props):
        load = dataclasses.replace(load, triangles=plan_bounds.MAX_PROP_TRIANGLES, mesh_triangles=ALL_TRIANGLES)
    return dataclasses.replace(load, texels=ALL_PIXELS) if plan.files else load
