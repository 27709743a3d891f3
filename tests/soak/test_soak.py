"""Minutes of traffic without a deadlock, a crash, an entry on red, or driving that is not human."""

from __future__ import annotations

import pytest

from tests.soak import runs

pytestmark = pytest.mark.soak


@pytest.mark.parametrize("seed", runs.SEEDS)
@pytest.mark.parametrize("count", runs.COUNTS)
@pytest.mark.parametrize("town", runs.TOWNS)
def test_traffic_flows_without_violations(town: str, count: int, seed: int) -> None:
    assert not runs.run(town, count, count, seed).faults()
