"""The recipe language: its models, its messages, its JSON Schema and a recipe to start from."""

from recipe_compiler.schema.json_schema import json_schema, template

__all__ = ["json_schema", "template"]
