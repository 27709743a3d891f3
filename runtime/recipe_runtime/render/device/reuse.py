"""Which results of earlier frames a renderer may use again. No setting changes a byte; it changes only the time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TemporalReuse:
    """The levels of temporal reuse of a camera at rest, each with a switch. For tests and benchmarks.

    Light is kept by sample, so it needs `samples`; reflections and pixels follow from light, so they need `light`. A
    level whose base is off has no effect.
    """

    visibility: bool = True  # what each pixel sees of the static scene, and its labels
    samples: bool = True  # the sample points on the static scene, with their geometry and patterns
    light: bool = True  # the radiance of those samples, by appearance
    reflections: bool = True  # the rays that wet ground mirrors, and what they meet
    pixels: bool = True  # the levels of unchanged pixels before the noise


ALL_REUSE = TemporalReuse()
NO_REUSE = TemporalReuse(visibility=False, samples=False, light=False, reflections=False, pixels=False)
