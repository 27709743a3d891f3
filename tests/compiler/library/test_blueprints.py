"""The library: its order, its globs, and the tags and colours of every blueprint."""

import re

import pytest
from recipe_compiler.ir.semantic_tags import Tag
from recipe_compiler.library.blueprints import LIBRARY, match


def test_the_library_is_sorted_and_unique() -> None:
    ids = [blueprint.id for blueprint in LIBRARY]
    assert ids == sorted(set(ids))


@pytest.mark.parametrize("family", ["walker.pedestrian.", "vehicle.", "vehicle.bus.", ""])
def test_a_glob_matches_a_family(family: str) -> None:
    assert match(f"{family}*") == tuple(b for b in LIBRARY if b.id.startswith(family)) != ()
    assert match("VEHICLE.*") == ()


def test_tags_are_carlas() -> None:
    assert (Tag.PEDESTRIAN, Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.MOTORCYCLE, Tag.BICYCLE) == (12, 14, 15, 16, 18, 19)
    for blueprint in LIBRARY:
        assert (blueprint.tag == Tag.PEDESTRIAN) == (blueprint.category == "pedestrian")


def test_palettes_are_colours() -> None:
    for blueprint in LIBRARY:
        for colours in blueprint.palette.values():
            assert all(re.fullmatch("#[0-9a-f]{6}", colour) for colour in colours)


def test_generations_and_wheels_are_reported() -> None:
    children = [b for b in LIBRARY if b.attributes.get("generation") == "child"]
    assert len(children) >= 4
    assert all(b.shape["height"] < 1.55 and b.shape["head"] > 1.0 for b in children)
    for blueprint in LIBRARY:
        wheels = blueprint.attributes.get("number_of_wheels")
        assert wheels == (None if blueprint.tag == Tag.PEDESTRIAN else "2" if blueprint.tag in (18, 19) else "4")
