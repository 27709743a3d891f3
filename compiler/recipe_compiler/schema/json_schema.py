"""The recipe language as a JSON Schema, for completion and validation in editors."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

from recipe_compiler.library import towns, weather
from recipe_compiler.schema.fields import NAME
from recipe_compiler.schema.recipe import Base, Recipe
from recipe_compiler.source.yaml_reader import parse

_SHORTHANDS = {"Town": "name", "Weather": "preset"}
_DELTAS = "Axes by name. An axis has named values, each with its changes to the base; null removes."


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a recipe file.

    A delta may contain any part of a base, and null to remove it. A recipe with `extends` may contain any part of a
    recipe, since the rest is in the recipe that it extends; null removes there as well.
    """
    schema = Recipe.model_json_schema(ref_template="#/$defs/{model}")
    base = Base.model_json_schema(ref_template="#/$defs/{model}")
    definitions = {**schema.pop("$defs", {}), **base.pop("$defs", {}), "Base": base}
    definitions["Weather"]["properties"]["preset"]["enum"] = list(weather.PRESETS)
    definitions |= {f"Partial{name}": _partial(definition) for name, definition in definitions.items()}
    for name, key in _SHORTHANDS.items():
        for kind in (name, f"Partial{name}"):
            whole = definitions[kind]
            definitions[kind] = {"anyOf": [whole, whole["properties"][key]], "description": whole["description"]}
    properties = schema["properties"] | {"base": {"$ref": "#/$defs/Base", "description": base["description"]}}
    name = properties.pop("recipe")
    changed = _partial({"properties": properties})["properties"]
    schema["properties"] = {
        "recipe": name,
        **{key: _description(value) for key, value in properties.items()},
        "deltas": {"description": _DELTAS},
    }
    schema["if"] = {"properties": {"extends": {"type": "string"}}, "required": ["extends"]}
    schema["then"] = {"properties": {**changed, "deltas": _deltas(extends=True)}}
    schema["else"] = {"properties": {**properties, "deltas": _deltas(extends=False)}, "required": ["base"]}
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "A recipe of a dataset"
    schema["description"] = "A recipe file. A file that other recipes extend may omit any key."
    schema["$defs"] = dict(sorted(definitions.items()))
    return schema


def _deltas(*, extends: bool) -> dict[str, Any]:
    """Return the schema of `deltas`; in a recipe that extends another, null removes an axis or one of its values."""
    value: dict[str, Any] = {"$ref": "#/$defs/PartialBase"}
    axis = {
        "type": "object",
        "propertyNames": {"pattern": NAME},
        "additionalProperties": _nullable(value) if extends else value,
        "minProperties": 1,
    }
    return {
        "type": "object",
        "description": _DELTAS,
        "propertyNames": {"pattern": NAME},
        "additionalProperties": _nullable(axis) if extends else axis,
    }


def _nullable(value: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [value, {"type": "null"}]}


def _partial(definition: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a delta: no key is required, null removes a value, and nested maps are partial too."""
    partial = copy.deepcopy(definition)
    partial.pop("required", None)
    for key, value in partial.get("properties", {}).items():
        value.pop("default", None)
        partial["properties"][key] = {**_nullable(_redirected(value)), **_description(value)}
    return partial


def _description(value: dict[str, Any]) -> dict[str, Any]:
    return {"description": value["description"]} if "description" in value else {}


def _redirected(value: Any) -> Any:
    if isinstance(value, dict):
        changed = {k: _redirected(v) for k, v in value.items() if k not in {"minProperties"}}
        if "$ref" in changed:
            changed["$ref"] = changed["$ref"].replace("#/$defs/", "#/$defs/Partial")
        for pattern, named in changed.get("patternProperties", {}).items():  # null removes a named entry
            changed["patternProperties"][pattern] = _nullable(named)
        return changed
    return [_redirected(item) for item in value] if isinstance(value, list) else value


def template(name: str) -> str:
    """Return the text of a new recipe with that name: complete, with comments."""
    text = (Path(__file__).parent / "template.yaml").read_text(encoding="utf-8")
    plain, problems = parse(f"recipe: {name}\n".encode(), "")
    bare = (
        plain is not None and not problems and plain.plain == {"recipe": name}
    )  # unlike `no` or `12`, which need quotes
    text = text.replace("TOWNS", ", ".join(towns.NAMES))
    return text.replace("recipe: my_dataset  ", f"recipe: {name if bare else json.dumps(name)} ".ljust(20))
