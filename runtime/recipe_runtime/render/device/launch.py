"""Start kernels."""

from __future__ import annotations

from typing import Any

from recipe_runtime.render.device import compiled
from recipe_runtime.render.device.setup import wp

_BLOCK_SIZE = 128  # threads that a GPU starts together: in larger blocks too many wait for one that has much to do
_loaded: set[tuple[Any, str]] = set()  # modules, with the devices they were loaded for


def launch(kernel: Any, dim: int | tuple[int, ...], inputs: list[Any], device: str) -> None:
    """Run a kernel over a grid; arrays among the inputs are read and written in place."""
    if (kernel.module, device) not in _loaded:
        compiled.load(wp, kernel.module, device, _BLOCK_SIZE)
        _loaded.add((kernel.module, device))
    wp.launch(kernel, dim=dim, inputs=inputs, device=device, block_dim=_BLOCK_SIZE)
