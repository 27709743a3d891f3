"""Stops compiling that takes more than the limits allow, by its estimate or in reality.

`limits.py` estimates the cost of compiling before any large object is created. No estimate covers every combination of
sections, so this module measures the real cost as well. No plan depends on it: a recipe compiles or ends with an error.
"""

from __future__ import annotations

import dataclasses
import resource
import time

from pydantic import ValidationError

from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.limits import COMPILE_LIMIT, MEMORY_LIMIT, Cost, TooLargeError, size, total
from recipe_compiler.load import Load
from recipe_compiler.source.yaml_reader import Value

SECONDS = 10 * COMPILE_LIMIT  # of processor time: an allowance for slow processors, and for planning of routes
BYTES = 2 * MEMORY_LIMIT


class CompileGuard:
    """Measures this thread's processor time and the growth of the process since it was made."""

    def __init__(self, *, unlimited: bool = False) -> None:
        """Begin to measure.

        Args:
            unlimited: report no excess.
        """
        self.unlimited, self._start, self._peak = unlimited, time.thread_time(), _peak_bytes()

    def excess(self, variants: int) -> str | None:
        """Return by what compiling exceeds the limits after some variants; None within them."""
        if self.unlimited:
            return None
        seconds, grown = time.thread_time() - self._start, _peak_bytes() - self._peak
        of = f"compiling {variants} of the variants has taken"
        if seconds > SECONDS:
            return f"{of} {seconds:.0f} s of processor time, over {SECONDS:.0f} s"
        if grown > BYTES:
            return f"{of} {size(grown)} of memory, over {size(BYTES)}"
        return None


def _peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def place_of_size(root: Value, cost: Cost) -> Place:
    """Return the place of the number that contributes most to the size of a recipe over the limits."""
    if cost.over_to_compile() or cost.variants * cost.variants > cost.frames:
        for path in (("sweep", "repeats"), ("sweep", "draw", "count"), ("deltas",), ("base", "traffic")):
            if root.get(*path):
                return root.place_of(*path)
    return root.place_of("base", "clock", "frames")


def compile_limit_error(root: Value, loads: list[Load], variants: int, excess: str | None) -> TooLargeError | None:
    """Return the error to raise if compiling the variants so far already exceeds the limits, or None.

    Args:
        root: the recipe.
        loads: the variants so far.
        variants: the number of all variants.
        excess: what `CompileGuard.excess` returns.
    """
    estimate = total(loads, "carla")  # the form of depth does not affect the cost of compiling
    reasons = [excess] if excess else estimate.over_to_compile()
    if reasons and not excess:
        reasons[0] = f"of the first {len(loads)} variants alone, {reasons[0]}"
    cost = dataclasses.replace(estimate, variants=variants)
    return TooLargeError(place_of_size(root, cost), cost, reasons) if reasons else None


def too_much_planning(root: Value, estimate: Cost) -> TooLargeError:
    """Return the error to raise if planning the routes of pedestrians takes more work than is allowed."""
    place = root.place_of("base", "actors") if root.get("base", "actors") else root.place_of("base", "traffic")
    return TooLargeError(place, estimate, ["planning the routes of its pedestrians takes too long"])


def beyond_plans(root: Value, variant: str, error: ValidationError) -> InputError:
    """Return the error to raise if a variant, though valid, has a value that plans cannot hold."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, (error.title, *first["loc"])))
    message = f"the variant {variant} exceeds a limit of plans: {where}: {first['msg'].lower()}"
    return InputError(
        [Problem(message, root.key_place("base"), "choose smaller values, or fewer of them", Code.INPUT_LIMIT)]
    )
