"""The JSON Schema, the template and the language page agree with the compiler."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from recipe_compiler import compile as compiler
from recipe_compiler.schema import camera, json_schema, motion, recipe, scene, sweep, template
from recipe_compiler.schema import weather as weather_models
from recipe_compiler.schema.fields import Model
from recipe_compiler.source.yaml_reader import parse

ROOT = Path(__file__).parents[3]
TEMPLATE = Path(compiler.__file__).parent / "schema/template.yaml"
PAGE = ROOT / "docs/recipe-language.md"
ACCEPTED = [TEMPLATE, *sorted(ROOT.glob("recipes/**/*.yaml")), *sorted(ROOT.glob("tests/cases/good/*/recipe.yaml"))]
SCHEMA = json_schema()
FAILS_THE_SCHEMA = (
    "unknown_key",
    "wrong_types",
    "out_of_range",
    "capture_unknown",
    "delta_out_of_range",
    "seed_negative",
)


def parts(path: Path) -> Any:
    """Return a file's data as the compiler reads it, with keys as text."""
    value, _ = parse(path.read_bytes(), str(path))
    assert value is not None
    return value.plain


@pytest.mark.slow
def test_the_schema_is_a_valid_json_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA


@pytest.mark.parametrize("path", ACCEPTED, ids=lambda path: str(path.relative_to(ROOT)))
def test_schema_accepts_good_recipes(path: Path) -> None:
    jsonschema.Draft202012Validator(SCHEMA).validate(parts(path))


def test_good_recipes_include_those_that_extend_others() -> None:
    assert {path.stem for path in ACCEPTED if "extends" in parts(path)} >= {"background_ablation", "resolution"}


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"base": {"clock": {"frames": 12}, "actors": {"child": {"speed": 1}}, "patches": {"patch": None}}},
        {"base": {"sensors": {"street": {"mount": {"z": 2}}}, "traffic": None}, "seed": None},
        {"deltas": {"weather": None, "camera": {"still": None, "high": {"sensors": {"street": None}}}}},
        {"sweep": {"draw": {"count": 3}}, "output": {"depth": None}, "assets": {"crate": None}},
    ],
)
def test_a_recipe_that_extends_another_may_omit_and_remove_anything(change: dict[str, Any]) -> None:
    """Such a recipe is a merge patch. Without `extends`, the same text lacks required keys, or has null for a value."""
    validator = jsonschema.Draft202012Validator(SCHEMA)
    validator.validate({"recipe": "small", "extends": "wall.yaml", **change})
    assert list(validator.iter_errors({"recipe": "small", **change}))
    assert list(validator.iter_errors({"recipe": "small", "extends": None, **change}))


@pytest.mark.parametrize(
    "change",
    [
        {"recipe": None},
        {"base": {"clock": {"frames": "many"}}},
        {"base": {"clok": {}}},
        {"deltas": {"weather": {}}},
        {"deltas": {"weather": {"foggy": {"weather": {"fog_density": 200}}}}},
        {"sweep": {"draw": {"count": -1}}},
    ],
)
def test_a_recipe_that_extends_another_is_checked(change: dict[str, Any]) -> None:
    """Its values must have the types and limits of any recipe."""
    recipe = {"recipe": "small", "extends": "wall.yaml", **change}
    assert list(jsonschema.Draft202012Validator(SCHEMA).iter_errors(recipe))


@pytest.mark.parametrize("slug", FAILS_THE_SCHEMA)
def test_the_schema_refuses_recipes_that_the_compiler_refuses(slug: str) -> None:
    data = parts(ROOT / f"tests/cases/failing/{slug}/recipe.yaml")
    assert list(jsonschema.Draft202012Validator(SCHEMA).iter_errors(data))


def test_every_key_has_a_description() -> None:
    for model in _models():
        for name, field in model.model_fields.items():
            assert field.description, f"{model.__name__}.{name}"


@pytest.mark.slow
def test_the_template_compiles_without_a_warning() -> None:
    assert compiler.compile_recipe(TEMPLATE).warnings == ()


def test_the_page_names_every_key() -> None:
    text = " ".join(re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", PAGE.read_text(), flags=re.S)))
    words = set(re.findall(r"\w+", text))
    for model in _models():
        for name in model.model_fields:
            assert name in words, f"{model.__name__}.{name}"


def test_the_pages_examples_compile(tmp_path: Path) -> None:
    blocks = [block.split("```")[0] for block in PAGE.read_text().split("```yaml\n")[1:]]
    whole = [block for block in blocks if block.lstrip("# \n").startswith("recipe:") or "\nrecipe:" in block]
    assert whole
    for block in whole:
        path = tmp_path / "recipe.yaml"
        path.write_text(block)
        compiler.compile_recipe(path)


def _models() -> list[type[Model]]:
    return [
        m
        for module in (scene, weather_models, camera, motion, sweep, recipe)
        for m in vars(module).values()
        if isinstance(m, type) and issubclass(m, Model) and m is not Model and m.__module__ == module.__name__
    ]


def test_a_new_recipe_has_its_name_and_compiles(tmp_path: Path) -> None:
    path = tmp_path / "rain_bench.yaml"
    path.write_text(template("rain_bench"))
    assert compiler.compile_recipe(path).plan.recipe == "rain_bench"


def test_the_recipe_of_the_readme_is_the_template() -> None:
    """So the README's description also applies to the recipe that `recipe init` writes."""
    (block,) = re.findall(r"```yaml\n(recipe: rain_bench\n.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert yaml.safe_load(block) == yaml.safe_load(template("rain_bench"))
