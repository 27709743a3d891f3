"""Traffic in whole towns: no deadlock, no contact, no entry on red. tests/soak has longer runs with physics."""

from __future__ import annotations

import subprocess
import sys

import pytest
from recipe_compiler.library import towns

from tests.runtime.simulation.traffic.kinematic_world import KinematicWorld, town_traffic

WARM_UP = 20.0


def _check(name: str, count: int, seconds: float, seed: int) -> None:
    town, plans = town_traffic(name, count, count, seconds + WARM_UP, seed)
    world = KinematicWorld(town.plan, plans, start=-WARM_UP)
    world.run(WARM_UP)
    means: list[float] = []
    hard = 0
    while world.seconds < seconds:
        world.step()
        means.append(world.mean_speed())
        hard += sum(body.acceleration < -5.0 for body in world.cars)
        if world.tick % 5 == 0:
            world.find_overlaps()
    part = len(means) // 5
    assert sum(means[-part:]) > 0.5 * sum(means[:part])
    assert max(body.longest for body in world.cars) < 90.0
    assert not world.on_red
    assert not world.overlaps
    assert hard < 0.002 * len(means) * count


@pytest.mark.slow
@pytest.mark.parametrize("name", towns.NAMES)
def test_traffic_flows(name: str) -> None:
    _check(name, 12, 40.0, 1)


_RUN = """
from tests.runtime.simulation.traffic.kinematic_world import KinematicWorld, town_traffic
town, plans = town_traffic("downtown", 15, 10, 30.0)
world = KinematicWorld(town.plan, plans)
world.run(15.0)
print([(b.x.hex(), b.y.hex(), b.speed.hex()) for b in world.bodies])
"""


@pytest.mark.slow
def test_a_run_does_not_depend_on_the_hash_seed() -> None:
    runs = [
        subprocess.run(
            [sys.executable, "-c", _RUN], env={"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
        ).stdout
        for seed in ("1", "2")
    ]
    assert runs[0] == runs[1] != ""
