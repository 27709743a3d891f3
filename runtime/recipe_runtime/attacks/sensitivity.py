"""The derivative of a picture with respect to a parameter of weather, sun or camera, by finite differences.

Both pictures have the same random numbers, since these are keyed by the plan's seed: noise, drops of rain, clouds and
lit windows differ only as far as the parameter changes them. Where it switches something (a drop more, a lamp on), the
difference contains the whole switch, divided by the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse, SensorPlan
from recipe_compiler.ir.plan_types import Plan

from recipe_runtime.core.interfaces import Observed
from recipe_runtime.frames.source import SceneSource

_OF_VALUE, _OF_RANGE = 0.01, 0.001  # the step, relative to a parameter's value, or to its range if the value is 0
_SUN_STEP = 0.5  # degrees


@dataclass(frozen=True)
class Parameter:
    """A number of an appearance, and its limits."""

    group: str  # weather, sun or camera
    name: str
    value: float
    low: float
    high: float

    def values(self, step: float | None) -> tuple[float, float]:
        """Return the two values between which the difference is taken."""
        if step is None:
            step = _OF_VALUE * abs(self.value) or _OF_RANGE * (self.high - self.low)
            step = _SUN_STEP if self.group == "sun" else step
        return max(self.low, self.value - step), min(self.high, self.value + step)


def sensitivity(
    source: SceneSource,
    seen: Observed,
    appearance: AppearancePlan,
    sensor: SensorPlan,
    frame: int,
    parameter: str,
    step: float | None,
) -> NDArray[np.float64]:
    """Return the derivative, float64 [H, W, 3], per unit of the parameter; see `Scenario.sensitivity`."""
    if any(patch.inserted for patch in appearance.patches):
        raise InputError(
            "the derivative is that of the rendered picture, and a texture is inserted into this one",
            help="choose a variant whose patches have the mode rendered or green",
            code=Code.CONFLICT,
        )
    if step is not None and not (math.isfinite(step) and step > 0):
        raise InputError(f"the step is {step!r}; give a number above 0")
    known = {f"{found.group}.{found.name}": found for found in parameters(appearance, sensor.name)}
    if parameter not in known:
        raise InputError(
            f"there is no parameter {parameter!r}", help=f"write one of {', '.join(known)}", code=Code.UNKNOWN_NAME
        )
    low, high = known[parameter].values(None if step is None else float(step))
    if not low < high:
        raise InputError(f"the step is {step!r}, which does not change the value {high:g}; give a larger number")
    below, above = (
        source.unrounded(seen, changed(appearance, sensor.name, known[parameter], value), sensor, frame)
        for value in (low, high)
    )
    derivative: NDArray[np.float64] = (above - below) / (high - low)
    return derivative


def parameters(appearance: AppearancePlan, sensor: str) -> Iterator[Parameter]:
    """Yield the parameters of an appearance as a sensor sees it: those that are numbers."""
    for group, plan in _groups(appearance, sensor).items():
        for name, field in type(plan).model_fields.items():
            value = getattr(plan, name)
            if isinstance(value, float):
                low, high = -math.inf, math.inf
                for rule in field.metadata:
                    low = getattr(rule, "low", getattr(rule, "ge", low))
                    high = getattr(rule, "high", getattr(rule, "le", high))
                yield Parameter(group, name, value, low, high)


def changed(appearance: AppearancePlan, sensor: str, parameter: Parameter, value: float) -> AppearancePlan:
    """Return an appearance with another value of a parameter."""
    plan = _groups(appearance, sensor)[parameter.group].model_copy(update={parameter.name: value})
    update = (
        {"responses": {**appearance.responses, sensor: plan}}
        if parameter.group == "camera"
        else {parameter.group: plan}
    )
    return appearance.model_copy(update=update)


def _groups(appearance: AppearancePlan, sensor: str) -> dict[str, Plan]:
    camera = appearance.responses.get(sensor) or CameraResponse()
    return {"weather": appearance.weather, "sun": appearance.sun, "camera": camera}
