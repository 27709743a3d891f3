"""What every test shares: a cache of its own, so that none depends on what a user's cache holds; the skip of GPU tests.

Under pytest-xdist each worker has a cache of its own too; workers share nothing but compiled kernels.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from recipe_runtime.cache.store import kernel_cache

gc.disable()  # until all tests are collected: imports and test items are kept, and Python's collector walks them all


def pytest_collection_finish() -> None:
    """From here on the collector passes over what was imported, a million objects that no test frees."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def private_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Traces are kept in a folder of this run. Compiled kernels stay where they are: they are keyed by their code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RECIPE_KERNEL_CACHE", str(kernel_cache()))
        patch.setenv("RECIPE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip tests marked `gpu` where there is no CUDA GPU, which is asked for when the first of them runs."""
    if item.get_closest_marker("gpu") is not None:
        from recipe_runtime.render.device.setup import cuda_devices

        if not cuda_devices():
            pytest.skip("there is no CUDA GPU here")
