"""Stage times, for a benchmark to print. Nothing that reaches a byte reads them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Timings:
    """Seconds and calls by stage; `with timings("label"):` adds to them."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self.clock: Callable[[], float] = time.perf_counter

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time a stage."""
        start = self.clock()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + self.clock() - start
        self.calls[stage] = self.calls.get(stage, 0) + 1

    def clear(self) -> None:
        """Forget all times."""
        self.seconds.clear()
        self.calls.clear()
