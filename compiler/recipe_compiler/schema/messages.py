"""Validation errors as lines for people: where, what is wrong, the value, the limit, the nearest valid name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from recipe_compiler.errors import Problem
from recipe_compiler.source import Value, show

Path = tuple[str | int, ...]

_LIMITS = {
    "greater_than_equal": ("ge", "is below the least allowed, {}"),
    "greater_than": ("gt", "must be above {}"),
    "less_than_equal": ("le", "is above the most allowed, {}"),
    "less_than": ("lt", "must be below {}"),
}
_KINDS = {
    "int": "a whole number",
    "float": "a number",
    "string": "text",
    "bool": "true or false",
    "dict": "a map",
    "model": "a map",
    "tuple": "a list",
    "list": "a list",
}
_BY_NAME = {"town": "a name, such as downtown,", "weather": "a preset's name, such as ClearNoon,"}  # or a map
_CARLA = {"image_size_x": "width", "image_size_y": "height"}
_PATTERNS = {
    "#": 'is not a colour; write it as "#rrggbb"',
    "(19|20)": 'is not a date; write it as "2022-08-12"',
    "([01]": 'is not a time of day; write it as "19:40"',
    "a-f]{64}": "is not a SHA-256; write its 64 hexadecimal digits in lower case, as `sha256sum` prints them",
    "?*": "is not a blueprint id or glob; letters, digits, and _ . - * ? only",
    "_-": "is not a name: names become folders, so letters, digits, _ and - only, a letter or digit first",
    "_.-": "is not an actor's name: letters, digits, _ . and - only, a letter or digit first",
}


def nearest(word: str, options: Iterable[str]) -> str:
    """A remedy for a wrong name: the nearest valid one, or all of them if they are few."""
    names = list(options)
    close = difflib.get_close_matches(word[:100], names, n=1, cutoff=0.6)
    if close:
        return f"did you mean {show(close[0])}?"
    if not names:
        return "there are none here"
    shown = ", ".join(names[:12])
    return f"valid are {shown}" if len(names) <= 12 else f"valid are {shown} and {len(names) - 12} more"


def translate(error: ValidationError, model: type[BaseModel], root: Value, prefix: Path = ()) -> list[Problem]:
    """The problems of a value that does not fit a model. `prefix` is the value's own path below `root`."""
    return [_problem(detail, model, root, prefix) for detail in details(error)]


def details(error: ValidationError) -> list[ErrorDetails]:
    """What a validation found, less what only follows from it.

    Pydantic blames a value that fits no member of a union once for each, and a list for those of its items that do
    not fit as if they were missing.
    """
    found: list[ErrorDetails] = []
    for detail in error.errors(include_url=False):
        if _is_of_union(detail["loc"]):
            if any(other["loc"][:-1] == detail["loc"][:-1] for other in found):
                continue
        elif detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]:
            continue
        found.append(detail)
    return found


def _problem(detail: ErrorDetails, model: type[BaseModel], root: Value, prefix: Path) -> Problem:
    path = (*prefix, *_without_markers(detail["loc"]))
    if "key" in detail.get("ctx", {}):  # an error of a map that one of its keys is to blame for
        path = (*path, detail["ctx"]["key"])
    key_is_wrong = detail["loc"][-1:] == ("[key]",)
    if detail["type"] == "extra_forbidden" or key_is_wrong:
        parent = root.get(*path[:-1])
        place = parent.key_place(path[-1]) if parent else root.place_of(*path)
    else:
        place = root.place_of(*path)
    return Problem(_message(detail, model, path, key_is_wrong), place)


_UNION_MEMBERS = {"bool", "int", "float", "str"}  # pydantic names the member of a union that it tried


def _is_of_union(loc: Path) -> bool:
    """Whether an error is of one member of a union: only items of lists are unions in this language."""
    return len(loc) > 1 and loc[-1] in _UNION_MEMBERS and isinstance(loc[-2], int)


def _without_markers(loc: Path) -> Path:
    return tuple(step for step in (loc[:-1] if _is_of_union(loc) else loc) if step != "[key]")


def dotted(path: Path) -> str:
    """A path as messages write it: actors.hero1.route[2].x."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step[:80]}" if text else step[:80]
    return text


def _message(detail: ErrorDetails, model: type[BaseModel], path: Path, key_is_wrong: bool) -> str:
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    where = dotted(path)
    if kind == "extra_forbidden":
        inside = f" in {dotted(path[:-1])}" if len(path) > 1 else ""
        if path[-2:] == ("camera", "exposure"):
            return f'unknown key "exposure"{inside}; as in CARLA, it is "exposure_compensation"'
        keys = fields_at(model, _without_markers(detail["loc"][:-1]))
        ours = _CARLA.get(str(path[-1]))
        if ours in keys:
            return f"unknown key {show(str(path[-1]))}{inside}; what CARLA calls so is {show(ours)} here"
        return f"unknown key {show(str(path[-1]))}{inside}; {nearest(str(path[-1]), keys)}"
    if kind == "missing":
        if isinstance(path[-1], int):
            return f"{dotted(path[:-1])} lacks an item"
        inside = (
            f"{dotted(path[:-1])} lacks"
            if len(path) > 1
            else "base lacks"
            if model.__name__ == "Base"
            else "the recipe lacks"
        )
        return f"{inside} {show(path[-1])}, which it needs{_hint(model, detail['loc'])}"
    if kind in _LIMITS:
        key, words = _LIMITS[kind]
        return f"{where}: {show(value)} {words.format(_number(context[key]))}"
    if kind == "string_pattern_mismatch":
        words = next(text for mark, text in _PATTERNS.items() if mark in context["pattern"][:40])
        return f"{where if not key_is_wrong else dotted(path[:-1])}: {show(value)} {words}"
    if kind == "string_too_long":
        return f"{where}: {show(value)} is longer than {context['max_length']} characters"
    if kind == "literal_error":
        options = _literals(context["expected"])
        return f"{where}: unknown value {show(value)}; {nearest(str(value), options)}"
    if kind in {"too_short", "too_long"}:
        return _size(where, kind, context)
    if kind == "string_too_short":
        return f"{where if not key_is_wrong else dotted(path[:-1])}: an empty text stands for nothing; remove it"
    if kind == "finite_number":
        return f"{where}: is not a finite number"
    if _is_of_union(detail["loc"]):
        return f"{where}: must be a number, text, true or false, not {'nothing' if value is None else show(value)}"
    if len(path) == 1 and where in _BY_NAME and kind.startswith("model_"):
        given = "nothing" if value is None else show(value)
        several = "; for several, make each a value of an axis in `deltas`" if isinstance(value, list) else ""
        return f"{where}: must be {_BY_NAME[where]} or a map, not {given}{several}"
    return f"{where}: {_type_message(kind, detail, value, _range(model, detail['loc']))}"


def _range(model: type[BaseModel], loc: Sequence[str | int]) -> str:
    """` from LOW to HIGH` where a number has both limits; else nothing."""
    info = _field_at(model, _without_markers(tuple(loc)))
    limits = info.metadata if info else []
    low, high = (next((v for m in limits if (v := getattr(m, key, None)) is not None), None) for key in ("ge", "le"))
    return "" if low is None or high is None else f" from {_number(low)} to {_number(high)}"


def _type_message(kind: str, detail: ErrorDetails, value: Any, span: str) -> str:
    for word, wanted in _KINDS.items():
        if kind.startswith(f"{word}_"):
            given = "nothing" if value is None else show(value)
            unquote = word in {"int", "float", "bool"} and isinstance(value, str) and _looks_plain(value)
            within = span if word in {"int", "float"} else ""
            return f"must be {wanted}{within}, not {given}" + ("; remove the quotes" if unquote else "")
    return detail["msg"]


def _looks_plain(text: str) -> bool:
    return text in {"true", "false"} or text.lstrip("+-").replace(".", "", 1).isdecimal()


def _size(where: str, kind: str, context: Mapping[str, Any]) -> str:
    if kind == "too_long":
        return f"{where}: {context['actual_length']} items are more than the most allowed, {context['max_length']}"
    least = context["min_length"]
    return f"{where}: needs at least {least} item{'s' if least > 1 else ''}, has {context['actual_length']}"


def _number(limit: float) -> str:
    return f"{limit:g}" if abs(limit) < 1e5 else f"{limit:.0f}"


def _literals(expected: str) -> list[str]:
    return [word.strip("' ") for word in expected.replace(" or ", ", ").split(",")]


def _hint(model: type[BaseModel], loc: Sequence[str | int]) -> str:
    info = _field_at(model, tuple(loc))
    return f": {_uncapitalised(info.description)}" if info is not None and info.description else ""


def _uncapitalised(text: str) -> str:
    return (text[0].lower() + text[1:]).rstrip(".")


def fields_at(model: type[BaseModel], loc: Path) -> tuple[str, ...]:
    """The keys that a map at a place of a model may have."""
    inner = _model_at(model, loc)
    return tuple(inner.model_fields) if inner else ()


def _field_at(model: type[BaseModel], loc: Path) -> FieldInfo | None:
    inner = _model_at(model, loc[:-1])
    return inner.model_fields.get(str(loc[-1])) if inner else None


def _model_at(model: type[BaseModel], loc: Path) -> type[BaseModel] | None:
    here: Any = model
    for step in loc:
        if isinstance(here, type) and issubclass(here, BaseModel):
            info = here.model_fields.get(str(step))
            here = info.annotation if info else None
        else:  # an item of a list or a map
            here = next((_inner(argument) for argument in get_args(here) if _inner(argument)), None)
        here = _inner(here) or here
    return here if isinstance(here, type) and issubclass(here, BaseModel) else None


def _inner(annotation: Any) -> type[BaseModel] | None:
    """The model in an annotation such as `Start | None`, looking through unions and Annotated, not containers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    origin = getattr(annotation, "__origin__", None)
    if origin in {dict, tuple, list}:
        return None
    return next((found for argument in get_args(annotation) if (found := _inner(argument))), None)
