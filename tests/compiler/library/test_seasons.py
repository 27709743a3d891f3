"""Seasons change the colours of plants, and nothing else."""

from __future__ import annotations

import pytest
from recipe_compiler.library import towns
from recipe_compiler.library.seasons import NAMES, in_season

TOWN = towns.build("suburb", 0, {})
GREEN = {"leaves", "flowers", "yard", "verge", "ground"}


@pytest.mark.parametrize("season", NAMES)
def test_a_season_changes_plants_and_grass_only(season: str) -> None:
    found = in_season(TOWN.looks, TOWN.plan.elements, season)  # type: ignore[arg-type]
    changed = {(name, slot) for name, look in TOWN.looks.items() for slot in look if found[name][slot] != look[slot]}
    assert {name: sorted(look) for name, look in found.items()} == {n: sorted(look) for n, look in TOWN.looks.items()}
    assert {slot for _, slot in changed} <= GREEN
    assert bool(changed) == (season != "summer")


def test_evergreen_plants_keep_their_colours() -> None:
    found = in_season(TOWN.looks, TOWN.plan.elements, "autumn")
    evergreen = [e.name for e in TOWN.plan.elements if e.kind == "hedge" or e.shape.get("species") in (1, 4)]
    assert evergreen
    assert all(found[name]["leaves"] == TOWN.looks[name]["leaves"] for name in evergreen)


def test_all_lawns_of_a_town_have_one_colour_in_a_season() -> None:
    """Otherwise they would end at invisible lines."""
    found = in_season(TOWN.looks, TOWN.plan.elements, "winter")
    assert len({look[slot] for look in found.values() for slot in ("yard", "verge", "ground") if slot in look}) == 1
