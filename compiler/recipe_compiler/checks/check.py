"""Validates the merged base of each variant. A section that variants share is validated once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError, create_model

from recipe_compiler.checks import references
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.schema.fields import NAME, NAME_LENGTH, Model
from recipe_compiler.schema.messages import Suggestions, details, remedy_of_key, translate
from recipe_compiler.schema.recipe import Base
from recipe_compiler.source.yaml_reader import Value, show

_NAMED = {
    "actors": "actor",
    "props": "prop",
    "patches": "patch",
    "sensors": "sensor",
}  # the maps whose entries deltas address by name
_NEEDS = {"actors": "blueprint", "props": "at, and asset or size", "patches": "on", "sensors": "mount and capture"}


def _section_models() -> dict[str, type[BaseModel]]:
    fields: dict[str, Any] = {name: (info.annotation, info) for name, info in Base.model_fields.items()}
    return {name: create_model("Base", __base__=Model, **{name: field}) for name, field in fields.items()}


_SECTIONS = _section_models()


class Checker:
    """Validates merged bases, section by section, and caches results by the identity of the section.

    Attributes:
        values: the number of values that were validated so far.
    """

    def __init__(
        self, base: Value, assets: Mapping[str, str] | None = None, own_blueprints: Sequence[str] = ()
    ) -> None:
        """`base` is the recipe's own, before any delta: what deltas may name.

        `assets`: name -> mesh or image; None if they are not known, and names of assets are not checked.
        `own_blueprints`: the ids of the recipe's blueprints.
        """
        own = () if assets is None else (references.unknown_asset(assets),)
        self._checks = (*references.CHECKS, *references.unknown_blueprints(own_blueprints), *own)
        self._names = {kind: set(value.map) if (value := base.get(kind)) else set() for kind in _NAMED}
        self._cross_checks: dict[tuple[object, ...], tuple[object, list[Problem]]] = {}
        self._sections: dict[tuple[str, int], tuple[Value | None, object, list[Problem]]] = {}
        self.values = 0

    def base(self, merged: Value, problems: list[Problem]) -> Base | None:
        """The model of a merged base, or None if it has problems, which are added to `problems`."""
        sections: dict[str, Any] = {}
        found: list[Problem] = []
        for name in _SECTIONS:
            section, wrong = self._section(name, merged)
            sections[name] = section
            found += wrong
        for key, value in merged.map.items():
            if key not in _SECTIONS:
                message = f"unknown key {show(key)} in base"
                found.append(
                    Problem(message, merged.key_place(key), remedy_of_key(key, value.plain, Base), Code.UNKNOWN_KEY)
                )
        for check, sections_read in self._checks:
            parts = tuple(merged.get(section) for section in sections_read)
            identity = (check.__name__, *map(id, parts))
            if identity not in self._cross_checks:
                self._cross_checks[identity] = (parts, list(check(merged)))
            found += self._cross_checks[identity][1]
        problems += found
        return None if found else Base.model_construct(**sections)

    def _section(self, name: str, merged: Value) -> tuple[object, list[Problem]]:
        value = merged.get(name)
        key = (name, id(value))
        if key not in self._sections:
            self.values += _size(value)
            self._sections[key] = (value, *self._validate(name, value, merged))
        return self._sections[key][1:]

    def _validate(self, name: str, value: Value | None, merged: Value) -> tuple[object, list[Problem]]:
        try:
            model = _SECTIONS[name].model_validate({} if value is None else {name: value.plain})
        except ValidationError as error:
            return None, self._translate(error, merged)
        return getattr(model, name), []

    def _translate(self, error: ValidationError, merged: Value) -> list[Problem]:
        unknown: dict[tuple[str, str], Problem] = {}
        suggestions = {kind: Suggestions(sorted(names)) for kind, names in self._names.items()}
        for detail in details(error):
            kind, name = (*map(str, detail["loc"]), "", "")[:2]
            if detail["type"] == "missing" and kind in _NAMED and name and name not in self._names[kind]:
                remedy = f"{suggestions[kind].nearest(name)} (a new one needs {_NEEDS[kind]})"
                message = f"the base has no {_NAMED[kind]} {show(name)} to change"
                place = (merged.get(kind) or merged).key_place(name)
                unknown[kind, name] = Problem(message, place, remedy, Code.UNKNOWN_NAME)
        missing = {(kind, name) for kind, name in unknown}
        others = [
            problem
            for detail, problem in zip(details(error), translate(error, Base, merged), strict=True)
            if not (detail["type"] == "missing" and tuple(map(str, detail["loc"][:2])) in missing)
        ]
        return [*unknown.values(), *others]


def _size(value: Value | None) -> int:
    """The number of values in a value, itself included."""
    if value is None:
        return 0
    return 1 + sum(map(_size, value.data if isinstance(value.data, tuple) else value.map.values()))


def check_deltas(root: Value) -> list[Problem]:
    """Problems of the shape of `deltas`: axis -> value -> a map, every name fit to be a folder's."""
    deltas = root.get("deltas")
    if deltas is None or deltas.data is None:
        return []
    if not isinstance(deltas.data, dict):
        message, remedy = (
            f"deltas: must be a map of axes, not {show(deltas.plain)}",
            "write `deltas: {axis: {value: {}}}`",
        )
        return [Problem(message, deltas.place, remedy, Code.INVALID_VALUE)]
    problems: list[Problem] = []
    for axis, values in deltas.map.items():
        problems += _check_name(deltas, axis, "the axis")
        if not isinstance(values.data, dict) or not values.data:
            message = f"deltas.{axis}: an axis is a map of at least one value, not {_given(values)}"
            remedy = "write a name and its changes, such as `still: {}`"
            problems.append(Problem(message, deltas.key_place(axis), remedy, Code.INVALID_VALUE))
        problems += references.alike(values, f"deltas.{axis}")
        for name, delta in values.map.items():
            problems += _check_name(values, name, f"axis {axis}, value")
            if not isinstance(delta.data, dict):
                message = f"deltas.{axis}.{name}: must be a map of changes, not {_given(delta)}"
                remedy = "write such as {weather: ClearNoon}, or {} for none"
                problems.append(Problem(message, values.key_place(name), remedy, Code.INVALID_VALUE))
    return problems


def _given(value: Value) -> str:
    if value.data is None:
        return "nothing"
    return "an empty map" if value.data == {} else show(value.plain)


def _check_name(parent: Value, name: str, what: str) -> list[Problem]:
    if re.match(NAME.replace("$", r"\Z"), name) and len(name) <= NAME_LENGTH:
        return []
    rule = f"use letters, digits, _ and - only, a letter or digit first, at most {NAME_LENGTH}: names become folders"
    return [Problem(f"{what} {show(name)} is not a name", parent.key_place(name), rule, Code.INVALID_NAME)]


def check_removals(root: Value) -> list[Problem]:
    """Problems of deltas that remove an actor, a prop or a sensor that no layer defines."""
    deltas, base = root.get("deltas"), root.get("base")
    everything = (
        [base, *(delta for values in deltas.map.values() for delta in values.map.values())] if deltas and base else []
    )
    known: dict[str, set[str]] = {kind: set() for kind in _NAMED}
    for layer in everything:
        for kind in _NAMED:
            named = layer.get(kind) if layer else None
            known[kind] |= {n for n, v in named.map.items() if v.data is not None} if named else set()
    return [problem for layer in everything[1:] if layer for problem in _removals(layer, known)]


def _removals(delta: Value, known: Mapping[str, set[str]]) -> list[Problem]:
    problems = []
    for kind, word in _NAMED.items():
        named, suggestions = delta.get(kind), Suggestions(sorted(known[kind]))
        for name, value in named.map.items() if named else ():
            if value.data is None and name not in known[kind] and named:
                message, remedy = f"there is no {word} {show(name)} to remove", suggestions.nearest(name)
                problems.append(Problem(message, named.key_place(name), remedy, Code.UNKNOWN_NAME))
    return problems
