"""Launches kernels with their arguments by name."""

from __future__ import annotations

from typing import Any

from recipe_runtime.render.device import compiled
from recipe_runtime.render.device.setup import BLOCK_SIZE, wp

_loaded: set[tuple[object, str]] = set()  # modules, with the devices they were loaded for
_parameters: dict[wp.Kernel, tuple[str, ...]] = {}  # by kernel, in the order of its declaration


def launch(kernel: wp.Kernel, threads: int, device: str, /, **arguments: object) -> None:
    """Run a kernel with a number of threads; arrays among its arguments are read and written in place.

    Args:
        kernel: The kernel.
        threads: The number of threads; a kernel reads its own index from `wp.tid()`.
        device: `cpu` or `cuda:N`.
        **arguments: Every argument of the kernel, by the kernel's own names.

    Raises:
        TypeError: An argument is missing, or the kernel does not have it.
    """
    names = _parameters.get(kernel)
    if names is None:
        names = _parameters[kernel] = tuple(argument.label for argument in kernel.adj.args)
    if len(arguments) != len(names) or not arguments.keys() <= set(names):
        missing, extra = sorted(set(names) - set(arguments)), sorted(set(arguments) - set(names))
        raise TypeError(f"kernel {kernel.key}: missing arguments {missing}, unknown arguments {extra}")
    if (kernel.module, device) not in _loaded:
        compiled.load(wp, kernel.module, device, BLOCK_SIZE)
        _loaded.add((kernel.module, device))
    inputs = [arguments[name] for name in names]
    wp.launch(kernel, dim=threads, inputs=inputs, device=device, block_dim=BLOCK_SIZE)


def fields_of(record: object, *names: str, prefix: str = "") -> dict[str, Any]:
    """Return fields of a record, by name, as arguments of a kernel; `prefix` is `out_` for those that it writes."""
    return {prefix + name: getattr(record, name) for name in names}
