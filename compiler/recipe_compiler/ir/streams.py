"""Named random streams, the only source of randomness.

A stream is keyed by the recipe's seed and by names (an actor, a sensor, a purpose), never by order, so adding
an actor, a sensor, an axis value or a worker changes no other draw. Draws are SHA-256 in counter mode over that
key: the same on every platform, and independent for different keys.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from typing import TypeVar

from recipe_compiler.ir import exact

T = TypeVar("T")

# Wichura's AS 241 (PPND16), Applied Statistics 37 (1988): the normal quantile to 1e-16.
_CENTRE = (
    (3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    (1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
     2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
)  # fmt: skip
_NEAR_TAIL = (
    (1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0,
     1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    (1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1,
     1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
)  # fmt: skip
_FAR_TAIL = (
    (6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    (1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
     7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
)  # fmt: skip


class Stream:
    """A sequence of draws that depends on its key alone."""

    def __init__(self, seed: int, *names: str) -> None:
        # A list of text and one integer: what `json` writes is its canonical form, and many times quicker to write.
        key = json.dumps([seed, *names], ensure_ascii=False, separators=(",", ":")).encode()
        self._prefix = b"recipe/stream/1\n" + key + b"\n"
        self._counter = 0

    def bits(self) -> int:
        """The next 64 random bits."""
        block = hashlib.sha256(self._prefix + str(self._counter).encode()).digest()
        self._counter += 1
        return int.from_bytes(block[:8], "little")

    def unit(self) -> float:
        """Uniform in the open interval (0, 1), on a grid of 2^-52."""
        return ((self.bits() >> 12) + 0.5) * 2.0**-52

    def uniform(self, low: float, high: float) -> float:
        """Uniform in (low, high)."""
        return low + (high - low) * self.unit()

    def normal(self, mean: float, deviation: float) -> float:
        """Normally distributed."""
        return mean + deviation * normal_quantile(self.unit())

    def integer(self, low: int, high: int) -> int:
        """Uniform over the whole numbers low..high, both included."""
        return low + (self.bits() * (high - low + 1) >> 64)

    def choice(self, options: Sequence[T]) -> T:
        """One of the options, each as likely; their order is part of the draw."""
        return options[self.integer(0, len(options) - 1)]


def _horner(coefficients: Sequence[float], x: float) -> float:
    total = 0.0
    for c in reversed(coefficients):
        total = total * x + c
    return total


def normal_quantile(p: float) -> float:
    """The x at which the standard normal distribution reaches p, 0 < p < 1."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _horner(_CENTRE[0], r) / _horner(_CENTRE[1], r)
    r = math.sqrt(-exact.log(p if q < 0 else 1.0 - p))
    table, r = (_NEAR_TAIL, r - 1.6) if r <= 5.0 else (_FAR_TAIL, r - 5.0)
    value = _horner(table[0], r) / _horner(table[1], r)
    return -value if q < 0 else value
