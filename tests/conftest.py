"""What every test shares: a cache of its own, so that none depends on what a user's cache holds."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from recipe_runtime.cache.store import kernel_cache


@pytest.fixture(scope="session", autouse=True)
def private_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Traces are kept in a folder of this run. Compiled kernels stay where they are: they are keyed by their code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RECIPE_KERNEL_CACHE", str(kernel_cache()))
        patch.setenv("RECIPE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
