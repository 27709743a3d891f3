"""Cost model and size limits.

Estimates frames, images, bytes on disk, minutes and memory of a build before it starts, and the time and memory of
compiling the recipe. The constants are measured: `make bench-estimates` compares the estimates of ten recipes with
their builds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.plurals import count
from recipe_compiler.load import Clip, Load

FRAME_LIMIT = 100_000
BYTE_LIMIT = 20 * 2**30
COMPILE_LIMIT = 12.0  # seconds
MEMORY_LIMIT = 900 * 2**20  # bytes, while compiling
TIME_LIMIT = 120.0  # minutes of one core

# Bytes on disk.
_BYTES = {"rgb": 1.52, "depth": 0.15, "depth-npy": 4.9, "instance": 0.006, "semantic": 0.016}  # per pixel, encoded
_DEPTH_PITCHED, _DEPTH_ROLLED = 0.5, 0.9  # per pixel of depth, if the camera moves or is pitched; if it is rolled
_FILE_HEAD, _BLOCK = 150, 4096  # header of a file; block size of the file system
_PLAN_BYTES = (540, 900)  # of a variant's plan: per element of its town, per actor
_TRACK_BYTES = 260  # per actor and frame
_LABEL_BYTES = 900  # per labelled object, in the labels and in each annotation file
_PREVIEW = (4.0, 900_000, 1_200_000)  # contact sheets: per pixel of a view; limit per view; limit in all
_TRUTH_BYTES = (800, 1000)  # of a frame's truth of patches: per file, per patch
_EVENT_BYTES = 0.08  # of a variant's events: per element of its town and frame
_SEEN, _SEEN_AT_MOST, _SEEN_NAMED = 0.1, 0.7, 0.6  # share of the actors that a frame shows; of those with a name
_SEEN_SMALL, _SEEN_HEIGHT = 75, 0.004  # that share in a small town, times its elements; more per metre of height

_SHARD_FRAMES = 5  # of the runtime's schedule

# Seconds on one core of an x86 processor of the 2020s. A megasample is a million rendered samples.
_START_BUILD, _START_WORKER, _START_SIMULATION = 1.7, 2.2, 0.6  # per process
_LOAD_ELEMENT, _LOAD_ACTOR = 0.0022, 0.018  # meshes: per element and per actor of a scene
_LOAD_TRIANGLE, _DECODE_TRIANGLE, _DRAW_TRIANGLE = 2e-6, 5e-6, 9e-8  # of props; their meshes; moving camera: per frame
_LOAD_PART, _DECODE_PART, _DECODE_BYTE = 7e-5, 1.9e-4, 3e-7  # of props' meshes; distinct ones; those that are text
_WRITE_ELEMENT, _WRITE_ACTOR = 4e-5, 7e-5  # plans of variants: per element and per actor
_WRITE_FRAME, _WRITE_LABEL = 0.0008, 1e-4  # per frame of a variant, labelled object in an annotation file
_WRITE_EVENT = 1e-8  # events: per element of a town and frame of a clip
_SIMULATE_ACTOR, _POSE_ACTOR = 0.012, 0.000075  # per actor; per actor and frame
_STEP, _STEP_ACTOR, _ROUTE_METRE = 0.00005, 0.0000055, 0.0000011  # per step; per actor and step; of vehicles' routes
_LOOK = 9e-7  # per look of an agent at a prop
_LABEL, _LABEL_ACTOR = 0.0035, 0.0004  # per frame; per actor and frame
_OBSERVE, _OBSERVE_MOVING = 0.05, 0.005  # moving camera: per megasample; per frame
_OBSERVE_STILL = 0.005  # static camera: per megasample
_ARM_BOX, _ARM_FRAME = 0.0000011, 0.0000019  # per box that shortens an arm, per earlier frame that counts; per frame
_SHADE = (0.010, 0.37)  # moving camera: per frame, per megasample
_SHADE_STILL = (0.007, 0.055)  # static camera: per frame, per megasample
_WHOLE_FRAMES = 2  # first frames of a static camera, which cost as much as those of a moving one
_SHADE_ACTOR = 0.0004  # per actor and frame
_SHADE_FIRST = 0.2  # per view
_TEXEL, _TEXEL_AGAIN = 6e-8, 8e-9  # mip levels: per texel of an image; per frame if a patch's image changes
_SHADE_PATCH = 0.02  # per patch and megasample
_TRUTH, _TRUTH_PATCH = 0.05, 0.02  # truth of patches, per megapixel; per patch and megapixel
_AMODAL, _INSERT = 0.055, 0.1  # per megapixel: per rectangle, again if it or the camera moved; inserted textures
_BLOOM, _BLUR, _BLUR_STILL = 0.12, 0.12, 0.024  # per megapixel; megasample and moment: moving camera, static camera
_ENCODE = {"rgb": 0.02, "depth": 0.025, "depth-npy": 0.01, "instance": 0.004, "semantic": 0.004}  # per megapixel
_FILE = 0.0007  # per file, whatever its size

# Bytes of memory. A camera that is at rest, if only for some frames, keeps its samples, and their light for each
# appearance; one that moves needs nearly as much at its peak.
_MAIN, _WORKER, _SIMULATION = 150 << 20, 205 << 20, 195 << 20  # per process
_SHADERS = 165 << 20  # kernels and tables, per process that renders pictures
_MEMORY_ELEMENT, _MEMORY_ACTOR, _MEMORY_TRIANGLE = 130_000, 1_600_000, 520  # meshes: per element, actor, prop triangle
_MEMORY_LABELS = 30  # per sample of a view without rgb
_MEMORY_SHADE, _MEMORY_FURTHER = 300, 40  # per sample of a view with rgb; for each further appearance
_MEMORY_TEXEL, _MEMORY_METRE = 24, 8  # mip levels: an atlas is made, another kept; of vehicles' routes, simulated
_MEMORY_RECORD, _MEMORY_ROW = 8500, 4200  # in the build's own process: per labelled object; again in each variant

# Compiling: seconds on the same core, and bytes of memory.
_PER_ELEMENT = (6.5e-5, 3400)  # per element of each distinct town
_PER_COLOURS = (3e-6, 70)  # per element of each distinct scene
_PER_ACTOR = (1.8e-4, 6000)  # per actor of each distinct scene
_PER_POINT = (1.2e-5, 1100)  # per point of these actors' routes
_PER_PROP = (1.6e-4, 5000)  # per prop of each distinct scene
_PER_PATCH = (1.7e-4, 6000)  # per patch of each distinct scene and map of patches
_PER_PATCH_AGAIN, _PER_IMAGE = (3e-5, 100), (6e-6, 0)  # per patch, and image of its sequence, of each variant
_PER_POSE = (1e-4, 1600)  # per pose of each distinct rig
_PER_SENSOR = (7e-5, 6000)  # per sensor of each distinct rig
_PER_BOX = (1.3e-5, 600)  # per building or wall that shortens an arm of each distinct rig
_PER_VARIANT = (4e-4, 12_000)
_PER_CHANGE = (5e-5, 3600)  # per variant and delta merged into its base


@dataclass(frozen=True)
class Cost:
    """The cost of building a recipe. `frames` counts one sensor at one time once, `images` each of its modalities."""

    variants: int
    simulations: int
    observations: int
    appearances: int
    frames: int
    images: int
    bytes: int
    minutes: float  # of one core, the processor time of all processes
    minutes_alone: float  # of those, the part that is not parallel
    minutes_to_load: float  # of those, loading each scene once
    minutes_to_load_shards: float  # loading the scene of each shard, the most that any number of workers takes
    compile_seconds: float
    compile_bytes: int
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

    def minutes_of_further_workers(self, workers: int) -> float:
        """Minutes of one core that workers after the first add at most: each starts, and loads its shards' scenes."""
        further = max(min(workers, self.frames) - 1, 0)
        return further * _START_WORKER / 60 + min(further * self.minutes_to_load, self.minutes_to_load_shards)

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
        return reasons + self.over_memory(memory) + self.over_to_compile()

    def over_memory(self, memory: Memory | None) -> list[str]:
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

    def over_to_compile(self) -> list[str]:
        """The exceeded limits of compiling in words."""
        reasons = []
        if self.compile_seconds > COMPILE_LIMIT:
            reasons.append(f"about {self.compile_seconds:.0f} s of compiling alone are over {COMPILE_LIMIT:.0f} s")
        if self.compile_bytes > MEMORY_LIMIT:
            reasons.append(f"compiling takes about {size(self.compile_bytes)} of memory, over {size(MEMORY_LIMIT)}")
        return reasons


@dataclass(frozen=True)
class Memory:
    """Memory of a host in bytes, None where unknown, and the number of workers that share it."""

    total: int | None = None
    process: int | None = None  # limit of a single process
    workers: int = 1


class TooLargeError(InputError):
    """A recipe exceeds the size limits; `cost` has the estimate, `reasons` the exceeded limits."""

    def __init__(self, place: Place, cost: Cost, reasons: Iterable[str]) -> None:
        """`place` is that of the number that contributes most to the cost."""
        self.cost = cost
        self.reasons = tuple(reasons)
        self.place = place
        super().__init__(
            Problem(", and ".join(self.reasons), place, "ask for fewer frames or variants", Code.SIZE_LIMIT)
        )


def size(amount: float) -> str:
    """A number of bytes with a binary unit: 812 KiB, 37 MiB, 2.4 GiB."""
    for unit, bits in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if amount >= 1 << bits:
            units = amount / (1 << bits)
            return f"{units:.1f} {unit}" if bits == 30 else f"{units:.0f} {unit}"
    return count(round(amount), "byte")


def total(loads: Iterable[Load], depth: str) -> Cost:
    """The cost of all variants. Work that variants share counts once.

    Args:
        loads: the work of each variant.
        depth: how depth is stored, `carla` or `npy`.
    """
    loads = list(loads)
    scenes = {load.scene: load for load in loads}
    observed = {(load.scene, load.rig): load for load in loads}
    looks = {(load.scene, load.rig, load.appearance): load for load in loads}
    alone = _START_BUILD + sum(map(_simulating, scenes.values()))
    alone += sum(load.elements * _WRITE_ELEMENT + load.actors * _WRITE_ACTOR for load in loads)
    alone += _rows(loads) * _WRITE_LABEL + sum(view.frames for load in loads for view in load.views) * _WRITE_FRAME
    alone += sum(load.elements * _clip(load) * _WRITE_EVENT for load in observed.values())
    shared = _START_WORKER + sum(map(_loading, scenes.values()))
    shared += sum(_observing(load, view, depth) for load in observed.values() for view in load.views)
    shared += sum(_shading(load, view) for load in loads for view in load.views if "rgb" in view.capture)
    shared += sum(_truth(load, view) for load in loads for view in load.views)
    compile_seconds, compile_bytes = _compiling(loads, list(scenes.values()))
    main, worker = _memory(observed, looks, sum(_labelled(load, view) for load in loads for view in load.views))
    return Cost(
        variants=len(loads),
        simulations=len(scenes),
        observations=len(observed),
        appearances=len(looks),
        frames=sum(view.frames for load in loads for view in load.views),
        images=sum(view.frames * len(view.capture) for load in loads for view in load.views),
        bytes=_disk(loads, scenes.values(), list(observed.values()), depth),
        minutes=round((alone + shared) / 60, 2),
        minutes_alone=round(alone / 60, 2),
        minutes_to_load=round(sum(map(_loading, scenes.values())) / 60, 2),
        minutes_to_load_shards=round(sum(_loading(load) * _shards(load) for load in observed.values()) / 60, 2),
        compile_seconds=round(compile_seconds, 1),
        compile_bytes=round(compile_bytes),
        main_memory=main + round(compile_bytes),
        worker_memory=worker,
    )


def _kinds(view: Clip, depth: str) -> list[str]:
    """The kinds of files that are written once for all appearances."""
    return ["depth-npy" if (m, depth) == ("depth", "npy") else m for m in view.capture if m != "rgb"]


def _clip(load: Load) -> int:
    """The number of frames of a clip, as near as its sensors tell it."""
    return max((view.frames * view.interval for view in load.views), default=0)


def _shards(load: Load) -> int:
    """The number of shards of an observation."""
    return sum(-(-view.frames // _SHARD_FRAMES) for view in load.views)


def _labelled(load: Load, view: Clip) -> float:
    """The number of labelled objects in the frames of a view."""
    share = max(_SEEN, _SEEN_SMALL / max(load.elements, 1)) + _SEEN_HEIGHT * max(view.height, 0.0)
    crowd = min(share, _SEEN_AT_MOST) * (load.actors - load.named)
    return view.frames * (crowd + _SEEN_NAMED * load.named)


def _rows(loads: Iterable[Load]) -> float:
    """The rows of the annotation files: each labelled object of each variant, again in the file of rgb pictures."""
    return sum(_labelled(load, v) * (1 + ("rgb" in v.capture)) for load in loads for v in load.views)


def _loading(load: Load) -> float:
    """Seconds to load the meshes of a scene."""
    town, actors = load.elements * _LOAD_ELEMENT, load.actors * _LOAD_ACTOR
    meshes = load.mesh_triangles * _DECODE_TRIANGLE + load.mesh_parts * _DECODE_PART + load.mesh_text * _DECODE_BYTE
    return town + actors + load.triangles * _LOAD_TRIANGLE + load.parts * _LOAD_PART + meshes


def _simulating(load: Load) -> float:
    """Seconds to simulate a scene."""
    frames = _clip(load)
    steps = load.steps * (_STEP + load.actors * _STEP_ACTOR) + load.metres * _ROUTE_METRE + load.looks * _LOOK
    return _START_SIMULATION + load.actors * (_SIMULATE_ACTOR + frames * _POSE_ACTOR) + steps


def _observing(load: Load, view: Clip, depth: str) -> float:
    """Seconds of the work that all appearances of a view share."""
    frame = _LABEL + load.actors * _LABEL_ACTOR
    frame += sum(_FILE + view.pixels / 1e6 * _ENCODE[kind] for kind in _kinds(view, depth))
    whole, least = view.frames, _OBSERVE_STILL * view.samples / 1e6
    if view.still:
        whole = min(view.frames, _WHOLE_FRAMES)
    moved = _OBSERVE_MOVING + _OBSERVE * view.samples / 1e6 + view.boxes * _ARM_BOX + load.triangles * _DRAW_TRIANGLE
    moved += min(view.history, view.frames * view.interval // 2) * _ARM_FRAME
    return view.frames * frame + whole * moved + (view.frames - whole) * least


def _shading(load: Load, view: Clip) -> float:
    """Seconds to render and write one appearance."""
    mega = view.samples / 1e6
    moved, still = (each + mega * rate for each, rate in (_SHADE, _SHADE_STILL))
    moved += load.patches * mega * _SHADE_PATCH
    whole = min(view.frames, _WHOLE_FRAMES) if view.still else view.frames
    finish = view.bloom * _BLOOM * view.pixels / 1e6 + view.moments * mega * (_BLUR_STILL if view.still else _BLUR)
    frame = _FILE + view.pixels / 1e6 * _ENCODE["rgb"] + load.actors * _SHADE_ACTOR + finish
    frame += load.sequences * load.texels * _TEXEL_AGAIN + load.charts * moved
    frame += (load.inserted_patches > 0) * _INSERT * view.pixels / 1e6
    return _SHADE_FIRST + load.texels * _TEXEL + view.frames * frame + whole * moved + (view.frames - whole) * still


def _truth(load: Load, view: Clip) -> float:
    """Seconds to compute and write the truth of the patches of one appearance."""
    if not load.patches:
        return 0.0
    fixed, amodal = load.patches - load.moving_patches, view.pixels / 1e6 * _AMODAL
    frame = _FILE + view.pixels / 1e6 * (_TRUTH + load.patches * _TRUTH_PATCH) + load.moving_patches * amodal
    return view.frames * frame + (1 if view.still else view.frames) * fixed * amodal


def _blocks(amount: float) -> int:
    """Bytes on disk of a file of `amount` bytes."""
    return -(-round(amount) // _BLOCK) * _BLOCK


def _rate(view: Clip, kind: str) -> float:
    """Encoded bytes per pixel. In the picture of a level camera, each row of the ground has one depth."""
    if kind == "depth" and (view.rolled or (view.bends and view.pitched)):
        return _DEPTH_ROLLED
    return _DEPTH_PITCHED if kind == "depth" and (view.bends or view.pitched or not view.still) else _BYTES[kind]


def _disk(loads: Sequence[Load], scenes: Iterable[Load], observed: Sequence[Load], depth: str) -> int:
    """Bytes on disk of a dataset."""
    pictures = [(v, kind) for o in observed for v in o.views for kind in _kinds(v, depth)]
    pictures += [(v, "rgb") for load in loads for v in load.views if "rgb" in v.capture]
    frames = sum(v.frames * _blocks(_FILE_HEAD + v.pixels * _rate(v, kind)) for v, kind in pictures)
    labelled = sum(_labelled(o, view) for o in observed for view in o.views) + _rows(loads)
    head, patch = _TRUTH_BYTES
    truth = sum(v.frames * _blocks(head + o.patches * patch) for o in loads if o.patches for v in o.views)
    element, actor = _PLAN_BYTES
    plans = sum(_blocks(load.elements * element + load.actors * actor) for load in loads)
    tracks = sum(_blocks(_clip(s) * s.actors * _TRACK_BYTES) for s in scenes)
    tracks += sum(_blocks(o.elements * _clip(o) * _EVENT_BYTES) for o in observed)
    rate, most, most_of_all = _PREVIEW
    seen = [min(rate * v.pixels, most) for load in loads for v in load.views if "rgb" in v.capture]
    return frames + truth + plans + tracks + _blocks(labelled * _LABEL_BYTES) + _blocks(min(sum(seen), most_of_all))


def _memory(
    observed: Mapping[tuple[Hashable, Hashable], Load],
    looks: Iterable[tuple[Hashable, Hashable, Hashable]],
    rows: float,
) -> tuple[int, int]:
    """Bytes of memory of the main process with its simulation, and of one worker; `rows` of annotations."""
    worker, records, metres = 0, 0.0, 0.0
    appearances = Counter((scene, rig) for scene, rig, _ in looks)
    for key, load in observed.items():
        process = _WORKER + load.elements * _MEMORY_ELEMENT + load.actors * _MEMORY_ACTOR
        process += load.triangles * _MEMORY_TRIANGLE
        process += (_SHADERS + load.texels * _MEMORY_TEXEL) * any("rgb" in view.capture for view in load.views)
        process += sum(view.samples * _sample_bytes(view, appearances[key] - 1) for view in load.views)
        worker, metres = max(worker, process), max(metres, load.metres)
        records += sum(_labelled(load, view) for view in load.views)
    labels = records * _MEMORY_RECORD + rows * _MEMORY_ROW
    return _MAIN + _SIMULATION + round(labels + metres * _MEMORY_METRE), worker


def _sample_bytes(view: Clip, further: int) -> int:
    """Bytes of a worker's memory per sample of a view; `further` appearances after the first."""
    return _MEMORY_SHADE + further * _MEMORY_FURTHER if "rgb" in view.capture else _MEMORY_LABELS


def _compiling(loads: Sequence[Load], scenes: Sequence[Load]) -> tuple[float, float]:
    """Seconds and bytes of memory for compiling."""
    towns = {load.town: load.elements for load in scenes}
    rigs = {load.rig: load.views for load in loads}
    patches = {(load.scene, load.patch_section): load.patches for load in loads}
    amounts = (
        (_PER_ELEMENT, sum(towns.values())),
        (_PER_COLOURS, sum(load.elements for load in scenes)),
        (_PER_ACTOR, sum(load.actors for load in scenes)),
        (_PER_POINT, sum(load.points for load in scenes)),
        (_PER_PROP, sum(load.props for load in scenes)),
        (_PER_PATCH, sum(patches.values())),
        (_PER_PATCH_AGAIN, sum(load.patches for load in loads)),
        (_PER_IMAGE, sum(load.patch_images for load in loads)),
        (_PER_POSE, sum(view.poses for views in rigs.values() for view in views)),
        (_PER_SENSOR, sum(len(views) for views in rigs.values())),
        (_PER_BOX, sum(view.boxes for views in rigs.values() for view in views)),
        (_PER_VARIANT, len(loads)),
        (_PER_CHANGE, sum(load.changes for load in loads)),
    )
    return sum(each[0] * n for each, n in amounts), sum(each[1] * n for each, n in amounts)
