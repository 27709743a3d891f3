"""The library: its order, its globs, and that every blueprint has what its mesh needs."""

import re

import pytest
from recipe_compiler.blueprints import BUS, CAR, LIBRARY, PEDESTRIAN, TRUCK, match


def test_the_library_is_sorted_and_unique() -> None:
    ids = [blueprint.id for blueprint in LIBRARY]
    assert ids == sorted(set(ids))


@pytest.mark.parametrize(
    ("glob", "count"),
    [("walker.pedestrian.*", 12), ("vehicle.*", 9), ("vehicle.bus.*", 1), ("VEHICLE.*", 0), ("*", 21)],
)
def test_globs(glob: str, count: int) -> None:
    assert len(match(glob)) == count


def test_tags_are_carlas() -> None:
    assert (PEDESTRIAN, CAR, TRUCK, BUS) == (12, 14, 15, 16)
    for blueprint in LIBRARY:
        assert (blueprint.tag == PEDESTRIAN) == (blueprint.category == "pedestrian")


def test_palettes_are_colours() -> None:
    for blueprint in LIBRARY:
        for colours in blueprint.palette.values():
            assert all(re.fullmatch("#[0-9a-f]{6}", colour) for colour in colours)
