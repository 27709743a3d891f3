"""What a recipe costs, known before any of the work is done: frames, images, bytes, minutes; and what compiling it
costs, so that a small file cannot ask for hours.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

from recipe_compiler.errors import InputError, Place, Problem
from recipe_compiler.wording import count

FRAME_LIMIT = 100_000
BYTE_LIMIT = 20 * 2**30
COMPILE_LIMIT = 12.0  # seconds
MEMORY_LIMIT = 900 * 2**20  # bytes, while compiling

# From builds of recipes/weather_sweep.yaml on one core of a 2020s x86. Bytes a pixel, encoded:
_BYTES = {"rgb": 1.63, "depth": 0.68, "depth-npy": 4.0, "instance": 0.0064, "semantic": 0.0153}
# Seconds a megapixel, and a file whatever its size:
_OBSERVE, _FIRST_SHADE, _ENCODE, _FILE = 0.022, 0.085, 0.04, 0.001
_SHADE, _SHADE_STILL = 0.19, 0.095  # of a camera that stands still, only what something moving may change is renewed
_SIMULATE = 0.00024  # seconds a physics step and body, and as much a step
_START = 4.0  # seconds to load meshes and kernels

# Compiling, on the same core: seconds and bytes.
_PER_ELEMENT = (6.5e-5, 3400)  # of a town, for each town that differs
_PER_COLOURS = (3e-6, 70)  # of an element, for each scene that differs
_PER_ACTOR = (1.8e-4, 6000)  # for each scene that differs
_PER_POINT = (1.2e-5, 1100)  # of their ways
_PER_POSE = (1e-4, 1600)  # for each rig that differs
_PER_SENSOR = (7e-5, 6000)
_PER_VARIANT = (4e-4, 12_000)
_PER_CHANGE = (5e-5, 3600)  # laid over the base, for each variant


@dataclass(frozen=True)
class View:
    """One sensor of one variant: a clip of frames."""

    frames: int
    pixels: int
    samples: int  # that it is drawn with: more than pixels behind a lens or supersampled
    capture: tuple[str, ...]
    poses: int = 1
    still: bool = True  # neither moved nor mounted on anyone


@dataclass(frozen=True)
class Load:
    """One variant's work. Keys that are equal mean work that is shared."""

    scene: Hashable
    rig: Hashable
    appearance: Hashable
    steps: int  # physics steps
    actors: int
    views: tuple[View, ...]
    town: Hashable = None
    elements: int = 0  # of the town
    points: int = 0  # of all actors' ways
    changes: int = 0  # laid over the base: axes and draws


@dataclass(frozen=True)
class Cost:
    """What building a recipe takes. `frames` are pictures of one sensor at one time, `images` the files of them."""

    variants: int
    simulations: int
    observations: int
    appearances: int
    frames: int
    images: int
    bytes: int
    minutes: float  # of one core
    minutes_alone: float  # of those, what workers do not share
    compile_seconds: float
    compile_bytes: int

    def __str__(self) -> str:
        return (
            f"{count(self.variants, 'variant')}: {count(self.simulations, 'simulation')}, "
            f"{count(self.observations, 'observation')}, {count(self.appearances, 'appearance')}"
        )

    def minutes_with(self, workers: int) -> float:
        """How long a build takes that so many workers share."""
        return self.minutes_alone + (self.minutes - self.minutes_alone) / workers

    def over(self, free_disk: int | None = None) -> list[str]:
        """The limits that this is over, in words; none if it is small enough to build unasked."""
        reasons = []
        if self.frames > FRAME_LIMIT:
            reasons.append(f"{self.frames} frames are over {FRAME_LIMIT}")
        if self.bytes > BYTE_LIMIT:
            reasons.append(f"about {size(self.bytes)} are over {size(BYTE_LIMIT)}")
        if free_disk is not None and self.bytes > free_disk // 2:
            over = f"about {size(self.bytes)} are over half the free disk, {size(free_disk / 2)}"
            reasons.append(over if free_disk else "the disk is full and cannot hold a dataset; free some space")
        return reasons + self.over_to_compile()

    def over_to_compile(self) -> list[str]:
        """The limits that compiling it would be over: many towns, or many casts, each laid out apart."""
        reasons = []
        if self.compile_seconds > COMPILE_LIMIT:
            reasons.append(f"about {self.compile_seconds:.0f} s of compiling alone are over {COMPILE_LIMIT:.0f} s")
        if self.compile_bytes > MEMORY_LIMIT:
            reasons.append(f"compiling takes about {size(self.compile_bytes)} of memory, over {size(MEMORY_LIMIT)}")
        return reasons


class TooLargeError(InputError):
    """A recipe over the limits, which needs an explicit yes; `cost` says by how much."""

    def __init__(self, place: Place, cost: Cost, reasons: Iterable[str]) -> None:
        """`place` is that of the number that costs most."""
        self.cost = cost
        self.reasons = tuple(reasons)
        self.place = place
        super().__init__(
            Problem(f"{'; '.join(self.reasons)}; ask for fewer frames or variants, or give --allow-large", place)
        )


def size(amount: float) -> str:
    """A number of bytes as people read it: 812 KiB, 37 MiB, 2.4 GiB."""
    for unit, bits in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if amount >= 1 << bits:
            units = amount / (1 << bits)
            return f"{units:.1f} {unit}" if bits == 30 else f"{units:.0f} {unit}"
    return count(round(amount), "byte")


def total(loads: Iterable[Load], depth: str) -> Cost:
    """The cost of all variants, with shared work counted once."""
    loads = list(loads)
    scenes = {load.scene: load for load in loads}
    observed = {(load.scene, load.rig): load for load in loads}
    looks = {(load.scene, load.rig, load.appearance): load for load in loads}
    alone = _START + sum(load.steps * (1 + load.actors) * _SIMULATE for load in scenes.values())
    seconds = alone
    bytes_ = 0.0
    for load in observed.values():
        for view in load.views:
            labels = [m for m in view.capture if m != "rgb"]
            kinds = ["depth-npy" if (m, depth) == ("depth", "npy") else m for m in labels]
            bytes_ += view.frames * view.pixels * sum(_BYTES[kind] for kind in kinds)
            seconds += view.frames * view.samples / 1e6 * (_OBSERVE + ("rgb" in view.capture) * _FIRST_SHADE)
            seconds += view.frames * len(labels) * (_FILE + view.pixels / 1e6 * _ENCODE / 2)
    for load in loads:
        for view in load.views:
            if "rgb" in view.capture:
                bytes_ += view.frames * view.pixels * _BYTES["rgb"]
                shade = _SHADE_STILL if view.still else _SHADE
                seconds += view.frames * (_FILE + (view.samples * shade + view.pixels * _ENCODE) / 1e6)
    compile_seconds, compile_bytes = _compiling(loads, list(scenes.values()))
    return Cost(
        variants=len(loads),
        simulations=len(scenes),
        observations=len(observed),
        appearances=len(looks),
        frames=sum(view.frames for load in loads for view in load.views),
        images=sum(view.frames * len(view.capture) for load in loads for view in load.views),
        bytes=round(bytes_),
        minutes=round(seconds / 60, 2),
        minutes_alone=round(alone / 60, 2),
        compile_seconds=round(compile_seconds, 1),
        compile_bytes=round(compile_bytes),
    )


def _compiling(loads: Sequence[Load], scenes: Sequence[Load]) -> tuple[float, float]:
    """Seconds and bytes that compiling takes."""
    towns = {load.town: load.elements for load in scenes}
    rigs = {load.rig: load.views for load in loads}
    amounts = (
        (_PER_ELEMENT, sum(towns.values())),
        (_PER_COLOURS, sum(load.elements for load in scenes)),
        (_PER_ACTOR, sum(load.actors for load in scenes)),
        (_PER_POINT, sum(load.points for load in scenes)),
        (_PER_POSE, sum(view.poses for views in rigs.values() for view in views)),
        (_PER_SENSOR, sum(len(views) for views in rigs.values())),
        (_PER_VARIANT, len(loads)),
        (_PER_CHANGE, sum(load.changes for load in loads)),
    )
    return sum(each[0] * n for each, n in amounts), sum(each[1] * n for each, n in amounts)
