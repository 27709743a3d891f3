"""Switches of temporal reuse. No setting changes a byte, only the time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TemporalReuse:
    """The levels of temporal reuse for static cameras, each with a switch, for tests and benchmarks.

    Light is cached by sample, so it needs `samples`; reflections and pixels follow from light, so they need `light`. A
    level whose base is off has no effect.
    """

    visibility: bool = True  # visibility and labels of the static scene
    samples: bool = True  # samples of the static scene, with geometry and patterns
    light: bool = True  # the radiance of those samples, by appearance
    reflections: bool = True  # reflected rays on wet ground, and their hits
    pixels: bool = True  # the levels of unchanged pixels before the noise


ALL_REUSE = TemporalReuse()
NO_REUSE = TemporalReuse(visibility=False, samples=False, light=False, reflections=False, pixels=False)
