"""Estimates what building a plan takes, and the limits of it.

The estimate is computed from the plan alone, so it is the same for a recipe and for a dataset's own plan. It is right
within a factor of 2 for recipes that people build: `make bench-estimates` compares the estimates of ten recipes with
their builds, which the constants are fitted to. `ir.modalities` has those of pictures.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from recipe_compiler.ir import optics
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.modalities import KINDS, Form, form_of
from recipe_compiler.ir.patches import WITH_CHART
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plurals import count

FRAME_LIMIT = 100_000  # frames of all sensors in all variants
BYTE_LIMIT = 20 * 2**30  # bytes on disk
TIME_LIMIT = 120.0  # minutes of one core

# Measured by `make bench-estimates`. Seconds are of one core of an x86 processor of the 2020s.
_ACTOR = 12  # town elements that are as much work, memory and text as one actor
_START = 3.3  # seconds: start of a build's processes
_LOAD = 0.0016  # seconds: meshes of an element of a scene
_FILE = 1.2e-7  # seconds: a byte of a mesh or an image, for each scene and its sensors
_STEP = 0.00004  # seconds: a physics step
_ACTOR_STEP = 0.000005  # seconds: an actor in a physics step
_FRAME = 0.006  # seconds: the labels of a frame, or its picture in one appearance, of any size
_ACTOR_FRAME = 0.0003  # seconds: an actor in the same
_LABEL_SAMPLES = 0.04  # seconds: a million samples of the labels of a moving camera
_SAMPLES = 0.27  # seconds: a million samples of the picture of a moving camera
_STILL_SAMPLES = 0.04  # seconds: a million samples of the picture of a static camera
_PASS = 0.08  # seconds: a million samples once more: bloom, a mosaic, a moment of motion blur, a patch
_TEXT = 600  # bytes: an element of a variant's plan
_ROW = 400  # bytes: an actor in a frame of a variant, in tracks and annotations
_PROCESS = 360 << 20  # bytes of memory: a process
_MESH = 300_000  # bytes of memory: meshes of an element of a scene, in each worker
_DECODED = 16  # bytes of memory: a byte of a mesh or an image, in each worker
_SAMPLE = 300  # bytes of memory: a sample of a picture, kept while its camera is at rest
_RECORD = 1500  # bytes of memory: an actor in a frame of a variant, until the annotations are written

_BLOCK = 4096  # bytes: block of the file system
_PREVIEW = 1_200_000  # bytes: contact sheets, at most
_WHOLE_FRAMES = 2  # first frames of a static camera, which cost as much as those of a moving one
_MOTION = 0.5  # widths per second by which motion blur takes a picture to move
_MAX_MOMENTS = 96.0  # moments of an exposure that motion blur averages, at most


@dataclass(frozen=True)
class Cost:
    """The cost of building a plan. `frames` counts one sensor at one time once, `images` each of its modalities."""

    variants: int
    simulations: int
    observations: int
    appearances: int
    frames: int
    images: int
    bytes: int
    minutes: float  # of one core, the processor time of all processes
    minutes_alone: float  # of those, the part that is not parallel
    main_memory: int  # bytes that the build and its simulation take
    worker_memory: int  # bytes that each worker takes

    def __str__(self) -> str:
        return (
            f"{count(self.variants, 'variant')}: {count(self.simulations, 'simulation')}, "
            f"{count(self.observations, 'observation')}, {count(self.appearances, 'appearance')}"
        )

    def minutes_with(self, workers: int) -> float:
        """Minutes of a build with that many workers."""
        return self.minutes_alone + (self.minutes - self.minutes_alone) / workers

    def memory_with(self, workers: int) -> int:
        """Bytes of memory of a build with that many workers."""
        return self.main_memory + min(workers, self.frames) * self.worker_memory

    def over(self, free_disk: int | None = None, memory: Memory | None = None) -> list[str]:
        """The exceeded limits in words; empty if none is exceeded.

        Args:
            free_disk: bytes free where the dataset would be written, if known.
            memory: the memory of the host, if known.
        """
        reasons = []
        if self.frames > FRAME_LIMIT:
            reasons.append(f"{self.frames} frames are over {FRAME_LIMIT}")
        if self.minutes > TIME_LIMIT:
            reasons.append(f"about {self.minutes / 60:,.0f} hours of one core are over {TIME_LIMIT / 60:.0f}")
        if self.bytes > BYTE_LIMIT:
            reasons.append(f"about {size(self.bytes)} are over {size(BYTE_LIMIT)}")
        if free_disk is not None and self.bytes > free_disk // 2:
            over = f"about {size(self.bytes)} are over half the free disk, {size(free_disk / 2)}"
            reasons.append(over if free_disk else "the disk is full and cannot hold a dataset; free some space")
        return reasons + self._over_memory(memory)

    def _over_memory(self, memory: Memory | None) -> list[str]:
        """The exceeded memory limits of a host in words."""
        if memory is None:
            return []
        largest, needed = max(self.main_memory, self.worker_memory), self.memory_with(memory.workers)
        if memory.process is not None and largest > memory.process:
            return [f"about {size(largest)} of memory a process are over the {size(memory.process)} that it may have"]
        if memory.total is None or needed <= memory.total:
            return []
        workers = (memory.total - self.main_memory) // self.worker_memory
        remedy = f" ({count(workers, 'worker')} would fit)" if workers > 0 else ""
        return [
            f"about {size(needed)} of memory with {count(memory.workers, 'worker')} "
            f"are over the {size(memory.total)} of this host{remedy}"
        ]


@dataclass(frozen=True)
class Memory:
    """Memory of a host in bytes, None where unknown, and the number of workers that share it."""

    total: int | None = None
    process: int | None = None  # limit of a single process
    workers: int = 1


class TooLargeError(InputError):
    """A recipe exceeds the limits of size.

    Attributes:
        variants: the number of its variants.
        warnings: those of the recipe, as far as it was compiled.
    """

    def __init__(self, place: Place, reasons: Iterable[str], variants: int, warnings: tuple[Problem, ...] = ()) -> None:
        """`place` is that of the number that contributes most to the size, `reasons` the exceeded limits."""
        self.variants, self.warnings = variants, warnings
        super().__init__(Problem(", and ".join(reasons), place, "ask for fewer frames or variants", Code.SIZE_LIMIT))


def size(amount: float) -> str:
    """A number of bytes with a binary unit: 812 KiB, 37 MiB, 2.4 GiB."""
    for unit, bits in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if amount >= 1 << bits:
            units = amount / (1 << bits)
            return f"{units:.1f} {unit}" if bits == 30 else f"{units:.0f} {unit}"
    return count(round(amount), "byte")


def estimate(plan: DatasetPlan) -> Cost:
    """Return the cost of building a plan. Work that variants share counts once."""
    variants = plan.variants
    scenes = {v.scene.digest: v.scene for v in variants}
    observed = {(v.scene.digest, v.rig.digest): v for v in variants}
    looks = Counter(
        key[:2] for key in dict.fromkeys((v.scene.digest, v.rig.digest, v.appearance.digest) for v in variants)
    )
    frames = [_frames(v, sensor) for v in variants for sensor in v.rig.sensors]
    rows = sum(_frames(v, sensor) * len(v.scene.actors) for v in variants for sensor in v.rig.sensors)
    alone = _START + sum(map(_simulating, scenes.values()))
    shared = sum(_bodies(scene) * _LOAD for scene in scenes.values())
    shared += sum(_observing(v, sensor, plan.forms) for v in observed.values() for sensor in v.rig.sensors)
    shared += sum(_files(v) * _FILE for v in observed.values())
    shared += sum(_shading(v, sensor) for v in variants for sensor in v.rig.sensors if "rgb" in sensor.capture)
    return Cost(
        variants=len(variants),
        simulations=len(scenes),
        observations=len(observed),
        appearances=looks.total(),
        frames=sum(frames),
        images=sum(_frames(v, sensor) * len(sensor.capture) for v in variants for sensor in v.rig.sensors),
        bytes=_disk(plan, observed.values()) + rows * _ROW,
        minutes=round((alone + shared) / 60, 2),
        minutes_alone=round(alone / 60, 2),
        main_memory=_PROCESS + rows * _RECORD,
        worker_memory=max((_worker_memory(v, looks[key]) for key, v in observed.items()), default=_PROCESS),
    )


def _frames(variant: ScenarioPlan, sensor: SensorPlan) -> int:
    """The number of frames that a sensor takes."""
    return len(sensor.frames(variant.scene.clock.frames))


def _bodies(scene: ScenePlan) -> int:
    """The elements of a scene, actors counted as elements."""
    return len(scene.town.elements) + _ACTOR * len(scene.actors)


def _files(variant: ScenarioPlan) -> int:
    """The bytes of the meshes and images of a variant."""
    return sum(file.bytes for file in variant.files.values())


def _samples(variant: ScenarioPlan, sensor: SensorPlan) -> int:
    """The rendered samples of a frame: more than its pixels with lens distortion or supersampling."""
    width, height, _ = optics.undistorted_size(sensor.camera, variant.appearance.responses[sensor.name].supersample)
    return width * height


def _is_still(sensor: SensorPlan) -> bool:
    return len(sensor.poses) == 1 and sensor.on is None


def _whole(variant: ScenarioPlan, sensor: SensorPlan) -> int:
    """The number of frames that are rendered whole; of the others, most is known from the frame before."""
    frames = _frames(variant, sensor)
    return min(frames, _WHOLE_FRAMES) if _is_still(sensor) else frames


def _simulating(scene: ScenePlan) -> float:
    """Seconds to simulate a scene."""
    steps = scene.clock.warmup_steps + scene.clock.frames * scene.clock.steps_per_frame
    return steps * (_STEP + len(scene.actors) * _ACTOR_STEP)


def _observing(variant: ScenarioPlan, sensor: SensorPlan, forms: Mapping[str, str]) -> float:
    """Seconds of the work that all appearances of a sensor share."""
    frame = _FRAME + len(variant.scene.actors) * _ACTOR_FRAME
    frame += sum(form.seconds for form in _label_forms(sensor, forms)) * _pixels(sensor) / 1e6
    return _frames(variant, sensor) * frame + _whole(variant, sensor) * _samples(variant, sensor) / 1e6 * _LABEL_SAMPLES


def _shading(variant: ScenarioPlan, sensor: SensorPlan) -> float:
    """Seconds to render and write the pictures of one appearance."""
    mega = _samples(variant, sensor) / 1e6
    frame = _FRAME + len(variant.scene.actors) * _ACTOR_FRAME + form_of("rgb", {}).seconds * _pixels(sensor) / 1e6
    frame += mega * (_STILL_SAMPLES + _passes(variant, sensor) * _PASS)
    return _frames(variant, sensor) * frame + _whole(variant, sensor) * mega * (_SAMPLES - _STILL_SAMPLES)


def _passes(variant: ScenarioPlan, sensor: SensorPlan) -> float:
    """How often the samples of a finished picture are read once more."""
    response, patches = variant.appearance.responses[sensor.name], variant.appearance.patches
    charts = sum(patch.transfer in WITH_CHART for patch in patches)  # a picture of its own each
    passes = len(patches) + charts * _SAMPLES / _PASS + (response.bloom_intensity > 0.0) + (response.sensor is not None)
    if response.motion_blur_intensity == 0.0:
        return passes
    length = response.motion_blur_intensity / response.shutter_speed * _MOTION
    moments = min(length, response.motion_blur_max_distortion) * sensor.camera.width
    return passes + min(max(moments, 1.0), _MAX_MOMENTS)


def _label_forms(sensor: SensorPlan, forms: Mapping[str, str]) -> list[Form]:
    """The forms of the files that are written once for all appearances."""
    return [form_of(name, forms) for name in sensor.capture if KINDS[name].is_label]


def _file_bytes(sensor: SensorPlan, form: Form) -> int:
    """Bytes of a file. In the picture of a level static camera, each row of the ground has one depth."""
    pose = sensor.poses[0]
    is_level = _is_still(sensor) and pose.pitch == pose.roll == 0.0 and not optics.bends(sensor.camera)
    return int(_pixels(sensor) * (form.size if form.level_size is None or not is_level else form.level_size))


def _pixels(sensor: SensorPlan) -> int:
    return sensor.camera.width * sensor.camera.height


def _disk(plan: DatasetPlan, observed: Iterable[ScenarioPlan]) -> int:
    """Bytes on disk of pictures, plans and contact sheets."""
    sensors = [(v, sensor) for v in observed for sensor in v.rig.sensors]
    pictures = [(v, sensor, form) for v, sensor in sensors for form in _label_forms(sensor, plan.forms)]
    shown = [(v, sensor) for v in plan.variants for sensor in v.rig.sensors if "rgb" in sensor.capture]
    pictures += [(v, sensor, form_of("rgb", {})) for v, sensor in shown]
    files = [(v, sensor, _file_bytes(sensor, form)) for v, sensor, form in pictures]
    if "kwcoco" in plan.annotations:
        files += [(v, sensor, int(_pixels(sensor) * form.copy_size)) for v, sensor, form in pictures]
    blocks = sum(_frames(v, sensor) * -(-size // _BLOCK) for v, sensor, size in files)
    plans = sum(_bodies(v.scene) * _TEXT for v in plan.variants)
    return blocks * _BLOCK + plans + min(4 * sum(_pixels(sensor) for _, sensor in shown), _PREVIEW)


def _worker_memory(variant: ScenarioPlan, appearances: int) -> int:
    """Bytes of memory of a worker that renders the sensors of a variant in some appearances.

    A camera that is at rest, if only for some frames, keeps its samples, and their light for each appearance. One that
    moves needs nearly as much at its peak.
    """
    samples = 0.0
    for sensor in variant.rig.sensors:
        kept = 1.0 + (appearances - 1) / 8 if "rgb" in sensor.capture else 0.1
        samples += kept * _samples(variant, sensor)
    return _PROCESS + _bodies(variant.scene) * _MESH + _files(variant) * _DECODED + round(samples * _SAMPLE)
