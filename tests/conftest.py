"""Fixtures of all tests: a private cache, and the skip of GPU tests.

With pytest-xdist each worker has its own cache; workers share only compiled kernels.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from hypothesis import settings
from recipe_runtime.cache.store import kernel_cache

# No deadline: the duration of an example is meaningless where processes share cores.
settings.register_profile("any load", deadline=None)
settings.load_profile("any load")
# Until all tests are collected: imports and test items stay in memory, and the garbage collector would scan them.
gc.disable()


def pytest_collection_finish() -> None:
    """Exclude imported objects, about a million that no test frees, from garbage collection."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def private_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep Traces in a folder of this run; compiled kernels, keyed by their code, stay in the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RECIPE_KERNEL_CACHE", str(kernel_cache()))
        patch.setenv("RECIPE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip tests marked `gpu` where there is no CUDA GPU; CUDA is probed when the first of them runs."""
    if item.get_closest_marker("gpu") is not None:
        from recipe_runtime.render.device.setup import cuda_devices

        if not cuda_devices():
            pytest.skip("there is no CUDA GPU here")
