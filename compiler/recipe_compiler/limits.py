"""What a recipe costs, known before any of the work is done: frames, images, bytes, minutes."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass

from recipe_compiler.errors import InputError

FRAME_LIMIT = 100_000
BYTE_LIMIT = 20 * 2**30

# Bytes a pixel, encoded, and seconds a megapixel of one core: rough, from 800x600 street scenes on a 2020s x86 core.
_BYTES = {"rgb": 1.6, "depth": 0.9, "depth-npy": 4.0, "instance": 0.02, "semantic": 0.02}
_OBSERVE, _SHADE = 0.06, 0.12
_SIMULATE = 0.0004  # seconds a physics step and actor
_START = 2.0  # seconds to load meshes and compile kernels


@dataclass(frozen=True)
class View:
    """One sensor of one variant: a clip of frames."""

    frames: int
    pixels: int
    capture: tuple[str, ...]


@dataclass(frozen=True)
class Load:
    """One variant's work. Keys that are equal mean work that is shared."""

    scene: Hashable
    rig: Hashable
    appearance: Hashable
    steps: int  # physics steps
    actors: int
    views: tuple[View, ...]


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
    minutes: float

    def __str__(self) -> str:
        return (
            f"{_count(self.variants, 'variant')}: {_count(self.simulations, 'simulation')}, "
            f"{_count(self.observations, 'observation')}, {_count(self.appearances, 'appearance')}"
        )

    def over(self, free_disk: int | None = None) -> list[str]:
        """The limits that this is over, in words; none if it is small enough to build unasked."""
        reasons = []
        if self.frames > FRAME_LIMIT:
            reasons.append(f"{self.frames} frames are over {FRAME_LIMIT}")
        if self.bytes > BYTE_LIMIT:
            reasons.append(f"about {self.bytes / 2**30:.1f} GiB are over {BYTE_LIMIT >> 30} GiB")
        if free_disk is not None and self.bytes > free_disk // 2:
            reasons.append(
                f"about {self.bytes / 2**30:.1f} GiB are over half the free disk, {free_disk / 2**31:.1f} GiB"
            )
        return reasons


class TooLargeError(InputError):
    """A recipe over the limits, which needs an explicit yes; `cost` says by how much."""

    def __init__(self, file: str, cost: Cost, reasons: Iterable[str]) -> None:
        self.cost = cost
        super().__init__(f"{file}: {'; '.join(reasons)}; allow it with --allow-large")


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def total(loads: Iterable[Load], depth: str) -> Cost:
    """The cost of all variants, with shared work counted once."""
    loads = list(loads)
    scenes = {load.scene: load for load in loads}
    observed = {(load.scene, load.rig): load for load in loads}
    seconds = _START + sum(load.steps * (1 + load.actors) * _SIMULATE for load in scenes.values())
    size = 0.0
    for load in observed.values():
        for view in load.views:
            labels = [m for m in view.capture if m != "rgb"]
            size += (
                view.frames
                * view.pixels
                * sum(_BYTES["depth-npy" if (m, depth) == ("depth", "npy") else m] for m in labels)
            )
            seconds += view.frames * view.pixels / 1e6 * _OBSERVE
    for load in loads:
        for view in load.views:
            if "rgb" in view.capture:
                size += view.frames * view.pixels * _BYTES["rgb"]
                seconds += view.frames * view.pixels / 1e6 * _SHADE
    return Cost(
        variants=len(loads),
        simulations=len(scenes),
        observations=len(observed),
        appearances=len({(load.scene, load.rig, load.appearance) for load in loads}),
        frames=sum(view.frames for load in loads for view in load.views),
        images=sum(view.frames * len(view.capture) for load in loads for view in load.views),
        bytes=round(size),
        minutes=round(seconds / 60, 2),
    )
