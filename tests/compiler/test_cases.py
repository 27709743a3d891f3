"""Recipes in folders: those in cases/failing are refused with the exact text of error.txt, those in cases/good pass."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.library import towns
from recipe_runtime.dataset.plan_checks import check_bounds

CASES = Path(__file__).parents[1] / "cases"
FAILING = sorted(path.parent for path in CASES.glob("failing/*/error.txt"))
GOOD = sorted(path.parent for path in CASES.glob("good/*/recipe.yaml"))
LOCKED = {path.stem for path in (CASES.parents[1] / "lockfiles").glob("*.lock")}  # test_lockfiles.py compiles these
RECIPES = [path for path in sorted((CASES.parents[1] / "recipes").rglob("*.yaml")) if path.stem not in LOCKED]


def test_there_are_at_least_forty_broken_recipes() -> None:
    assert len(FAILING) >= 40
    assert {path.name for path in FAILING} == {path.name for path in CASES.glob("failing/*")}


@pytest.mark.parametrize("folder", FAILING, ids=lambda path: path.name)
def test_broken_recipe_is_refused_with_its_exact_text(folder: Path) -> None:
    with pytest.raises(InputError) as caught:
        compile_recipe(folder / "recipe.yaml")
    text = str(caught.value).replace(f"{folder}/", "") + "\n"
    expected = (folder / "error.txt").read_text(encoding="utf-8")
    for names, listed in (("{towns}", towns.NAMES), ("{modalities}", MODALITIES)):
        expected = expected.replace(names, ", ".join(listed))
    assert text == expected
    assert text.replace("\n", "").isprintable()  # no control characters


@pytest.mark.slow
@pytest.mark.parametrize("path", [*(folder / "recipe.yaml" for folder in GOOD), *RECIPES], ids=str)
def test_good_recipe_compiles(path: Path) -> None:
    assert_consistent(compile_recipe(path))


def assert_consistent(compiled: Compiled) -> None:
    """Assert what every compiled recipe has: unique names and numbers, looks and responses, poses, and bounds."""
    names = [variant.variant for variant in compiled.plan.variants]
    assert names and len(set(names)) == len(names)
    assert compiled.cost.variants == len(names)
    for variant in compiled.plan.variants:
        looks = variant.appearance.looks.root
        assert {actor.name for actor in variant.scene.actors} <= set(looks)
        assert {element.name for element in variant.scene.town.elements} <= set(looks)
        assert set(variant.appearance.responses) == {sensor.name for sensor in variant.rig.sensors}
        numbers = [actor.instance for actor in variant.scene.actors]
        assert len(set(numbers)) == len(numbers)
        for sensor in variant.rig.sensors:
            assert len(sensor.poses) in {1, variant.scene.clock.frames}
    check_bounds(compiled.plan)  # (needed to read its dataset)


def test_the_deltas_of_the_good_case_are_merged() -> None:
    plan = compile_recipe(CASES / "good/deltas/recipe.yaml").plan
    weather = {v.variant.split(",")[1]: v.appearance.weather for v in plan.variants if v.variant.endswith("view=wide")}
    assert weather["weather=as_it_is"].fog_density == 20
    assert weather["weather=more_fog"].fog_density == 80
    assert (
        weather["weather=cleared"].fog_density == 2
    )  # a value of ClearNoon: a preset's name replaces the whole weather
    assert (weather["weather=wet"].fog_density, weather["weather=wet"].precipitation_deposits) == (20, 50)
    casts = {v.variant.split(",")[0]: [a.name for a in v.scene.actors] for v in plan.variants}
    assert casts == {"cast=one": ["hero"], "cast=none": [], "cast=two": ["hero", "guest"]}


def test_extended_files_are_read_and_hashed() -> None:
    compiled = compile_recipe(CASES / "good/extends/recipe.yaml")
    assert list(compiled.files) == ["common/street.yaml", "common/town.yaml", "recipe.yaml"]
    (variant,) = compiled.plan.variants
    assert variant.variant == "weather=rainy"
    assert (variant.appearance.seed, compiled.plan.description) == (3, "A camera on a street.")
    assert (variant.rig.sensors[0].camera.width, variant.rig.sensors[0].camera.fov) == (320, 60)


def test_warnings_name_both_axes_in_conflict() -> None:
    (warning,) = compile_recipe(CASES / "good/deltas/recipe.yaml").warnings
    assert warning.message == "axes weather and view both set weather.wetness"
    assert warning.help == "the later one, view, wins"
    assert warning.place is not None and warning.place.line == 24
