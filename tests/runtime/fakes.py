"""Fake engines: boxes that slide past a camera, rendered by integer arithmetic only."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan import (
    ActorPlan,
    AppearancePlan,
    CameraPlan,
    CameraResponse,
    Clock,
    DatasetPlan,
    Pose,
    RigPlan,
    ScenarioPlan,
    ScenePlan,
    SensorPlan,
    Sun,
    TownPlan,
    Weather,
)
from recipe_compiler.library.blueprints import match
from recipe_runtime.annotate.calibration import calibration
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.core.trace import METRE, UNIT, ContactEvent, Trace
from recipe_runtime.core.transforms import Array
from recipe_runtime.frames.engines import Engines
from recipe_runtime.meshes.mesh import Body, Mesh

ACTORS = (("hero1", "pedestrian", 12, 1), ("hero2", "pedestrian", 12, 2), ("van", "vehicle", 15, 1))

BLUEPRINTS = {"pedestrian": match("walker.pedestrian.0001")[0], "vehicle": match("vehicle.truck.box")[0]}


def scene_plan(frames: int = 12, speed: float = 1.0) -> ScenePlan:
    actors = tuple(
        ActorPlan(
            name=name,
            blueprint=BLUEPRINTS[category].id,
            category=category,
            tag=tag,
            instance=number,
            shape=BLUEPRINTS[category].shape,
            start=Pose(x=4.0 + n, y=-2.0 + n),
            route=(),
            speed=speed,
        )
        for n, (name, category, tag, number) in enumerate(ACTORS)
    )
    return ScenePlan(
        clock=Clock(fps=10, frames=frames, physics=240), town=TownPlan(name="plain", elements=()), actors=actors
    )


def sensor_plan(
    name: str = "street", shake: float = 0.0, frames: int = 12, capture: Sequence[str] | None = None
) -> SensorPlan:
    poses = tuple(Pose(z=1.0, y=shake * (k % 3 - 1)) for k in range(frames if shake else 1))
    camera = CameraPlan(width=64, height=48, fov=90)
    capture = capture or MODALITIES
    return SensorPlan(name=name, camera=camera, capture=tuple(capture), poses=poses)


def appearance_plan(clouds: float = 0.0) -> AppearancePlan:
    names = [n for n in Weather.model_fields if n != "cloudiness"]
    weather = Weather(cloudiness=clouds, **dict.fromkeys(names, 0.0))
    responses = {"street": CameraResponse(), "side": CameraResponse()}
    return AppearancePlan(seed=1, weather=weather, sun=Sun(azimuth=0, altitude=45), looks={}, responses=responses)


def dataset_plan(frames: int = 12, weathers: int = 2, **outputs: object) -> DatasetPlan:
    """Return a plan of two rigs by so many weathers; the second sensor does not move in either rig."""
    scene = scene_plan(frames)
    variants = []
    for w in range(weathers):
        for jitter, shake in (("still", 0.0), ("shaky", 0.1)):
            sensors = (sensor_plan("street", shake, frames), sensor_plan("side", capture=("rgb", "instance")))
            rig = RigPlan(sensors=sensors)
            name = f"weather=w{w},jitter={jitter}"
            appearance = appearance_plan(10.0 * w)
            variants.append(ScenarioPlan(variant=name, scene=scene, rig=rig, appearance=appearance))
    fields: dict[str, object] = {
        "recipe": "tiny",
        "description": "Boxes slide past.",
        "annotations": ("kwcoco", "coco", "mots_txt", "mots_png"),
    }
    return DatasetPlan.model_validate({**fields, "variants": tuple(variants), **outputs})


def simulate(scene: ScenePlan) -> Trace:
    f, a = scene.clock.frames, len(scene.actors)
    positions = np.zeros((f, a, 3), np.int64)
    for n, actor in enumerate(scene.actors):
        positions[:, n, 0] = int(actor.start.x * METRE)
        positions[:, n, 1] = int(actor.start.y * METRE) + np.arange(f) * (METRE // 8) * (1 if n % 2 else -1)
        positions[:, n, 2] = METRE
    rotations = np.zeros((f, a, 4), np.int32)
    rotations[..., 3] = UNIT
    linear = np.zeros((f, a, 3), np.int64)
    linear[..., 1] = METRE
    names = tuple(actor.name for actor in scene.actors)
    parts = tuple(f"{name}/base" for name in names)
    contacts = (ContactEvent("hero1", "van", 50, 60, 12.5),)
    return Trace(names, parts, positions, rotations, linear, np.zeros_like(linear), contacts=contacts)


def actor_bodies(scene: ScenePlan) -> list[Body]:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-1, 1)], np.float32)
    none = np.zeros((0, 3), np.int32)
    mesh = Mesh(corners, corners, corners[:, :2], none, none[:, 0], ())
    return [Body(a.name, a.tag * 1000 + a.instance, (("base", mesh),)) for a in scene.actors]


@dataclass(frozen=True)
class View:
    instance: int
    amodal: int
    amodal_box: tuple[int, int, int, int]
    projected: tuple[float, float, float, float]


@dataclass(frozen=True)
class Seen:
    depth: NDArray[np.float32]
    instance: NDArray[np.uint16]
    semantic: NDArray[np.uint8]
    objects: list[View]

    def drawn(self, label_pass: LabelPass) -> NDArray[np.generic]:
        """Return values from 0 to 1, or integers from 0 to 250, where there is an actor; all else is 0."""
        height, width = self.instance.shape
        steps = np.arange(height * width * label_pass.channels).reshape(height, width, -1) * 7919 % 251
        spread = steps / 250 if np.dtype(label_pass.dtype).kind == "f" else steps
        array = np.where(self.instance[..., None] > 0, spread, 0).astype(label_pass.dtype)
        return array.reshape(label_pass.shape(width, height))


NO_LABELS: LabelledFrame = {
    "frame": 0,
    "time": 0.0,
    "calibration": calibration(CameraPlan(width=64, height=48, fov=90), np.eye(3, 4)),
    "objects": [],
}


class Renderer:
    """Render actors as upright rectangles, the nearest on top."""

    def __init__(self, scene: ScenePlan) -> None:
        self._instances = [a.tag * 1000 + a.instance for a in scene.actors]

    def observe(
        self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
    ) -> Seen:
        h, w = camera.height, camera.width
        depth, instance = np.full((h, w), camera.far, np.float32), np.zeros((h, w), np.uint16)
        views = []
        for n in reversed(range(len(parts))):  # the first is the nearest
            x, y = (float(parts[n][i, 3] - world_from_sensor[i, 3]) for i in (0, 1))
            left, top = int(w / 2 - w / 2 * (y + 0.5) / x), int(h / 2 - w / 2 / x)
            whole = left, top, left + int(w / 2 / x), top + int(w / x)
            x0, y0, x1, y1 = box = max(left, 0), max(top, 0), min(whole[2], w), min(whole[3], h)
            if x1 > x0 and y1 > y0:
                views.append(View(self._instances[n], (x1 - x0) * (y1 - y0), box, whole))
                instance[y0:y1, x0:x1], depth[y0:y1, x0:x1] = self._instances[n], x
        semantic = np.where(instance > 0, instance // 1000, 11).astype(np.uint8)
        return Seen(depth, instance, semantic, views)

    def shade(
        self,
        obs: Seen,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: object = None,
    ) -> NDArray[np.uint8]:
        return self.picture(obs, appearance, frame)

    def unrounded(
        self,
        obs: Seen,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: object = None,
    ) -> NDArray[np.float64]:
        return self.picture(obs, appearance, frame) / 255

    def frame_stream(
        self,
        camera: CameraPlan,
        sensor_name: str,
        appearances: Sequence[AppearancePlan],
        in_flight: int,
        patched: Sequence[AppearancePlan],
        label_passes: Sequence[LabelPass],
    ) -> NoReturn:
        raise AssertionError("a CPU renders its frames one by one")

    def patch_map(self, obs: Seen, appearance: AppearancePlan, frame: int) -> NoReturn:
        raise AssertionError("it has no patches")

    def patched_frame(
        self, obs: Seen, appearance: AppearancePlan, sensor_name: str, frame: int, time: float, *, neighbour: Any = None
    ) -> NoReturn:
        raise AssertionError("it has no patches")

    def picture(self, obs: Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        grey = (obs.depth.astype(np.int64) + int(appearance.weather.cloudiness) + frame) % 256
        return np.stack([grey, obs.semantic, obs.instance % 251], axis=-1).astype(np.uint8)


class SlowRenderer(Renderer):
    """Slow enough for a build to be interrupted."""

    def observe(
        self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
    ) -> Seen:
        time.sleep(0.05)
        return super().observe(camera, world_from_sensor, parts)


class BrokenRenderer(Renderer):
    """Fail at frame 7 as an engine could."""

    def picture(self, obs: Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        if frame == 7:
            raise ArithmeticError("the lamp went out")
        return super().picture(obs, appearance, frame)


class DyingRenderer(Renderer):
    """Kill the process at frame 7."""

    def picture(self, obs: Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        if frame == 7:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().picture(obs, appearance, frame)


def _noted(scene: ScenePlan, device: str) -> Renderer:
    note("renderer")
    return Renderer(scene)


def _noted_simulation(scene: ScenePlan) -> Trace:
    """Simulate after a worker has loaded the scene; if none does in time, record that."""
    note("simulation begins")
    for _ in range(400):
        if "renderer" in Path(os.environ["NOTES"]).read_text().split("\n"):
            break
        time.sleep(0.05)
    note("simulation ends")
    return simulate(scene)


def note(what: str) -> None:
    """Add a line to the file that the variable NOTES names."""
    with Path(os.environ["NOTES"]).open("a") as file:
        file.write(what + "\n")


def _unloadable(scene: ScenePlan, device: str) -> Renderer:
    raise ArithmeticError("the scene has no ground")


def _fast(scene: ScenePlan, device: str) -> Renderer:
    return Renderer(scene)


def _slow(scene: ScenePlan, device: str) -> Renderer:
    return SlowRenderer(scene)


def _broken(scene: ScenePlan, device: str) -> Renderer:
    return BrokenRenderer(scene)


def _dying(scene: ScenePlan, device: str) -> Renderer:
    return DyingRenderer(scene)


ENGINES = Engines(simulate, actor_bodies, _fast)
SLOW = Engines(simulate, actor_bodies, _slow)
BROKEN = Engines(simulate, actor_bodies, _broken)
DYING = Engines(simulate, actor_bodies, _dying)
NOTED = Engines(_noted_simulation, actor_bodies, _noted)
UNLOADABLE = Engines(simulate, actor_bodies, _unloadable)


def tree(root: Path) -> dict[str, bytes]:
    """Return the content of every file below a folder, by its path."""
    return {p.relative_to(root).as_posix(): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def quiet(stage: str, done: int, total: int) -> None:
    """Report no progress."""
