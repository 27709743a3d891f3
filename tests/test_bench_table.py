"""The table of `make bench` compares with the slowest weather, and states what was not measured."""

from __future__ import annotations

from typing import Any

from benchmarks.table import texture_goals, textures_table

FOUND: dict[str, Any] = {
    "plain": {"TinyRenderer": [900.0, 1000.0, 1100.0]},
    "weathers": {
        "clear": {"update": [10.0, 10.0, 10.0], "frame": 80.0, "forward and backward": 40.0},
        "rainy": {"update": [20.0, 25.0, 5.0], "frame": 110.0, "forward and backward": 41.6},
    },
}


def test_goals_apply_to_the_slower_weather() -> None:
    (_, ratio), (_, passes) = texture_goals(FOUND)
    assert (ratio, passes) == ("45", "42 ms")
    table = textures_table(FOUND)
    assert "| update | 10.0 | 20.0 |" in table
    assert "- times an update, rainy, in alternating runs: 45, 40, 220" in table


def test_the_table_states_that_pytorch_is_not_installed() -> None:
    without = {name: {k: v for k, v in row.items() if "forward" not in k} for name, row in FOUND["weathers"].items()}
    found = {**FOUND, "weathers": without}
    assert texture_goals(found)[-1][1] == "not measured: PyTorch is not installed"
    assert any("PyTorch is not installed" in line for line in textures_table(found))
