"""Translates validation errors to problems with place, value, limit and the nearest valid name."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from recipe_compiler.ir.errors import MAX_SHOWN, Code, Problem, split_remedy
from recipe_compiler.schema import remedies
from recipe_compiler.source.similar_names import MAX_LENGTH, similar_names
from recipe_compiler.source.yaml_reader import Value, show

Path = tuple[str | int, ...]

_LIMITS = {
    "greater_than_equal": ("ge", "is below the minimum, {}"),
    "greater_than": ("gt", "must be above {}"),
    "less_than_equal": ("le", "is above the maximum, {}"),
    "less_than": ("lt", "must be below {}"),
}
_SIDES = {"ge": " of at least", "gt": " above", "le": " of at most", "lt": " below"}
_UNIT = re.compile(r"\b(m/s|metres|degrees|seconds|hours|percent|kelvins|1/s)(?!\w)", re.IGNORECASE)  # in descriptions
_KINDS = {  # start of pydantic's type -> what is wanted, the remedy
    "int": ("a whole number", "write it in digits, without quotes or a fraction"),
    "float": ("a number", "write it in digits, without quotes"),
    "string": ("text", "put it in quotes"),
    "bool": ("true or false", "write true or false"),
    "dict": ("a map", "write keys and values, such as {key: value}"),
    "model": ("a map", "write keys and values, such as {key: value}"),
    "tuple": ("a list", "write it in square brackets, such as [a, b]"),
    "list": ("a list", "write it in square brackets, such as [a, b]"),
}
_SEVERAL = "for several, make each a value of an axis in `deltas`"
_DEFAULTS = {"town": "downtown", "weather": "ClearNoon"}
_BY_NAME = {"town": "a name, such as downtown,", "weather": "a preset's name, such as ClearNoon,"}  # or a map
_CARLA = {  # CARLA's key -> ours, the first that the map may have
    "image_size_x": ("width",),
    "image_size_y": ("height",),
    "sensor_tick": ("tick",),
    "transform": ("mount", "start"),
    "destination_transform": ("goal",),
    "attach_to": ("on",),
    "max_frames": ("frames",),
}
_NAME_RULE = "use letters, digits, _ and - only, a letter or digit first: names become folders"
_PATTERNS = {  # what marks the pattern -> what is wrong, the remedy
    "walker": (
        "is not the id of an own blueprint",
        "write `walker.pedestrian.NAME`, or `vehicle.KIND.NAME`: a sedan, hatchback, suv, van, pickup, bus or truck",
    ),
    "#": ("is not a colour", 'write it as "#rrggbb"'),
    "(19|20)": ("is not a date", 'write it as "2022-08-12"'),
    "([01]": ("is not a time of day", 'write it as "19:40"'),
    "a-f]{64}": ("is not a SHA-256", "write its 64 hexadecimal digits in lower case, as `sha256sum` prints them"),
    "https?": ("is not a URL", "write it as https://example.org/dataset"),
    "{1,6}": ("is not a version", 'write three numbers, quoted: "1.0.0"'),
    "x00-": ("has control characters", "remove them"),
    "?*": ("is not a blueprint id or glob", "use letters, digits, and _ . - * ? only"),
    "_-": ("is not a name", _NAME_RULE),
    "_.-": ("is not an actor's name", "use letters, digits, _ . and - only, a letter or digit first"),
}
# Of our own checks, those of keys that exclude others.
_CONFLICTS = {"way", "asset", "prop", "carrier", "texture", "distribution", "clip", "moves", "frame"}
_MAX_LISTED = 12  # valid names that a remedy lists

Words = tuple[Code, str, str | None]
"""Code, message and remedy of a problem."""


def nearest(word: str, options: Iterable[str]) -> str:
    """Return the remedy for an unknown name: a similar valid name, else valid names, those of its family first.

    The family of a dotted name, such as `wall.1`, are the names with the same first part.
    """
    names = list(options)
    close = near(word, names)
    if close is not None:
        return f"did you mean {show(close)}?"
    family, dot, _ = word.partition(".")
    return listed(sorted(names, key=lambda name: not name.startswith(f"{family}.")) if dot else names)


def listed(names: Sequence[str]) -> str:
    """A remedy that lists valid names, or the first of them."""
    if not names:
        return "there are none here"
    shown = ", ".join(names[:_MAX_LISTED])
    return (
        f"valid are {shown}" if len(names) <= _MAX_LISTED else f"valid are {shown} and {len(names) - _MAX_LISTED} more"
    )


def near(word: str, options: Iterable[str]) -> str | None:
    """Return the option that a word is probably a misspelling of, or None.

    Dotted names are compared part by part, because names of one family share most of their letters.
    """
    names = list(options)
    same = next((name for name in names if name.lower() == word.lower()), None)
    if same is not None:
        return same
    parts = word[:MAX_LENGTH].split(".")
    for name in similar_names(word, names, 5, 0.6):
        candidate = name.split(".")
        if len(parts) == 1 or (len(candidate) == len(parts) and all(map(_alike, parts, candidate))):
            return name
    return None


class Suggestions:
    """Remedies for wrong names among the same valid ones. Only the first wrong names are compared with all of these."""

    def __init__(self, options: Iterable[str]) -> None:
        self._options, self._searches = list(options), 0

    def nearest(self, word: str) -> str:
        """As `nearest`, for as many words as there are problems shown; then the valid names."""
        self._searches += 1
        return nearest(word, self._options) if self._searches <= MAX_SHOWN else listed(self._options)


def _alike(one: str, other: str) -> bool:
    """Whether two words are equal except for a typing error; different numbers are not."""
    if one == other or (any(c in one for c in "*?") and difflib.SequenceMatcher(None, one, other).ratio() >= 0.5):
        return True
    if one.isdigit() and other.isdigit():
        return False
    return difflib.SequenceMatcher(None, one, other).ratio() >= 0.7


def translate(error: ValidationError, model: type[BaseModel], root: Value, prefix: Path = ()) -> list[Problem]:
    """The problems of a value that does not fit a model. `prefix` is the value's own path below `root`."""
    return [_problem(detail, model, root, prefix) for detail in details(error)]


def details(error: ValidationError) -> list[ErrorDetails]:
    """Return the errors of a validation, without those that follow from another.

    Pydantic reports a value that matches no member of a union once per member, and counts invalid items of a list as
    missing.
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
    if "key" in detail.get("ctx", {}):  # the error of a map that one of its keys causes
        path = (*path, detail["ctx"]["key"])
    key_is_wrong = detail["loc"][-1:] == ("[key]",)
    if detail["type"] == "extra_forbidden" or key_is_wrong:
        parent = root.get(*path[:-1])
        place = parent.key_place(path[-1]) if parent else root.place_of(*path)
    else:
        place = root.place_of(*path)
    value = root.get(*path)
    gone = [key for key in value.keys if key not in value.map] if value and detail["type"] == "too_short" else []
    if value and gone:  # a delta removed what is missing
        place = value.key_place(gone[-1])
    code, message, help = _words(detail, model, path, key_is_wrong)
    return Problem(message, place, help or "", code)


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


def _words(detail: ErrorDetails, model: type[BaseModel], path: Path, key_is_wrong: bool) -> Words:
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    where = dotted(path)
    around = where if not key_is_wrong else dotted(path[:-1])
    if kind == "extra_forbidden":
        return _unknown_key(detail, model, path)
    if kind == "missing":
        return _missing(detail, model, path)
    if kind in _LIMITS:
        key, words = _LIMITS[kind]
        limit = f"{where}: {show(value)} {words.format(_number(context[key]))}"
        span = _range(model, detail["loc"]) or f"{_SIDES[key]} {_number(context[key])}"
        return Code.OUT_OF_RANGE, limit, f"write a value{span}{_unit(model, detail['loc'])}"
    if kind == "string_pattern_mismatch":
        wrong, remedy = next(words for mark, words in _PATTERNS.items() if mark in context["pattern"][:40])
        code = Code.INVALID_NAME if remedy == _NAME_RULE else Code.INVALID_VALUE
        return code, f"{around}: {show(value)} {wrong}", remedies.of_text(value) or remedy
    if kind == "string_too_long":
        return (
            Code.INVALID_VALUE,
            f"{where}: {show(value)} is longer than {context['max_length']} characters",
            "shorten it",
        )
    if kind == "literal_error":
        return (
            Code.INVALID_VALUE,
            f"{where}: unknown value {show(value)}",
            remedies.of_word(value) or nearest(str(value), _literals(context["expected"])),
        )
    if kind in {"too_short", "too_long"}:
        size = len(value) if isinstance(value, (dict, list, tuple)) else context["actual_length"]
        return _size(where, kind, {**context, "actual_length": size})  # pydantic does not count a map that is too long
    if kind == "string_too_short":
        return Code.INVALID_VALUE, f"{around}: the text is empty", "remove it"
    if kind == "finite_number":
        return Code.INVALID_VALUE, f"{where}: is not a finite number", "write a finite one"
    given = "nothing" if value is None else show(value)
    if _is_of_union(detail["loc"]):
        return Code.INVALID_VALUE, f"{where}: must be a number, text, true or false, not {given}", "write one value"
    if len(path) == 1 and where in _BY_NAME and kind.startswith("model_"):
        several = _SEVERAL if isinstance(value, list) else f"write such as `{where}: {_DEFAULTS[where]}`"
        return Code.INVALID_VALUE, f"{where}: must be {_BY_NAME[where]} or a map, not {given}", several
    return _wrong_type(kind, detail, path, model)


def _unknown_key(detail: ErrorDetails, model: type[BaseModel], path: Path) -> Words:
    inside = f" in {dotted(path[:-1])}" if len(path) > 1 else ""
    what = f"unknown key {show(str(path[-1]))}{inside}"
    remedy = remedy_of_key(str(path[-1]), detail["input"], model, _without_markers(detail["loc"][:-1]))
    return Code.UNKNOWN_KEY, what, remedy


def remedy_of_key(key: str, value: object, model: type[BaseModel], around: Path = ()) -> str:
    """Return the remedy for an unknown key: CARLA's key, the map beside it where it belongs, or a similar key.

    Args:
        key: the key.
        value: its value.
        model: the model of the whole value.
        around: the path of the map in the model.
    """
    keys = fields_at(model, around)
    own = next((known for known in _CARLA.get(key, ()) if known in keys), None)
    if own is not None:
        return f"use {show(own)}, which is CARLA's {key}"
    homes = [field for field in keys if key in fields_at(model, (*around, field))]
    home = f"it is a key of {homes[0]}: write {homes[0]}: {{{key}: ...}}" if len(homes) == 1 else None
    return remedies.of_key(key, value) or home or nearest(key, keys)


def _missing(detail: ErrorDetails, model: type[BaseModel], path: Path) -> Words:
    if isinstance(path[-1], int):
        return Code.MISSING_KEY, f"{dotted(path[:-1])} lacks an item", "add it"
    whole = "base" if model.__name__ == "Base" else "the recipe"
    inside = dotted(path[:-1]) if len(path) > 1 else whole
    return Code.MISSING_KEY, f"{inside} lacks {show(path[-1])}", f"add `{path[-1]}`{_hint(model, detail['loc'])}"


def _range(model: type[BaseModel], loc: Sequence[str | int]) -> str:
    """The limits of a number in words: ` from LOW to HIGH`, ` of at least LOW`, or nothing."""
    info = _field_at(model, _without_markers(tuple(loc)))
    limits = [*info.metadata, *_metadata(info.annotation)] if info else []
    at = {k: _number(v) for m in limits for k in ("ge", "gt", "le", "lt") if (v := getattr(m, k, None)) is not None}
    if "ge" in at and "le" in at:
        return f" from {at['ge']} to {at['le']}"
    return "".join(f"{_SIDES[key]} {limit}" for key, limit in at.items()).replace(" of at most", ", at most")


def _metadata(annotation: object) -> list[object]:
    """What is annotated inside an annotation such as `Annotated[float, Ge(0)] | None`."""
    inner = [found for argument in get_args(annotation) for found in _metadata(argument)]
    return [*getattr(annotation, "__metadata__", ()), *inner]


def _wrong_type(kind: str, detail: ErrorDetails, path: Path, model: type[BaseModel]) -> Words:
    value, where = detail["input"], dotted(path)
    for word, (wanted, usual) in _KINDS.items():
        if kind.startswith(f"{word}_"):
            given = "nothing" if value is None else show(value)
            within = _range(model, detail["loc"]) if word in {"int", "float"} else ""
            known = remedies.of_value(str(path[-1]), wanted, value, _unit(model, detail["loc"]))
            keys = fields_at(model, _without_markers(detail["loc"])) if wanted == "a map" else ()
            usual = f"write keys and values: {listed(keys)}" if keys else usual
            return Code.INVALID_VALUE, f"{where}: must be {wanted}{within}, not {given}", known or usual
    message, remedy = split_remedy(f"{where}: {detail['msg']}")
    return Code.CONFLICT if kind in _CONFLICTS else Code.INVALID_VALUE, message, remedy


def _size(where: str, kind: str, context: Mapping[str, int]) -> Words:
    number = context["actual_length"]
    if kind == "too_long":
        most = context["max_length"]
        return Code.OUT_OF_RANGE, f"{where}: {number} items exceed the limit of {most}", "remove some"
    least = context["min_length"]
    message = f"{where}: needs at least {least} item{'s' if least > 1 else ''}, has {number}"
    return Code.OUT_OF_RANGE, message, "add one" if least - number == 1 else "add some"


def _number(limit: float) -> str:
    return f"{limit:g}" if abs(limit) < 1e5 else f"{limit:.0f}"


def _literals(expected: str) -> list[str]:
    return [word.strip("' ") for word in expected.replace(" or ", ", ").split(",")]


def _hint(model: type[BaseModel], loc: Sequence[str | int]) -> str:
    info = _field_at(model, tuple(loc))
    return f": {_uncapitalised(info.description)}" if info is not None and info.description else ""


def _unit(model: type[BaseModel], loc: Path) -> str:
    """The unit that the description of a field names, as in `, in metres`; empty if it names none."""
    info = _field_at(model, _without_markers(loc))
    found = _UNIT.search((info.description if info else None) or "")
    return f", in {found[1].lower()}" if found else ""


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
    here: object = model
    for step in loc:
        if isinstance(here, type) and issubclass(here, BaseModel):
            info = here.model_fields.get(str(step))
            here = info.annotation if info else None
        else:  # an item of a list or a map
            here = next((_inner(argument) for argument in get_args(here) if _inner(argument)), None)
        here = _inner(here) or here
    return here if isinstance(here, type) and issubclass(here, BaseModel) else None


def _inner(annotation: object) -> type[BaseModel] | None:
    """The model in an annotation such as `Start | None`, looking through unions and Annotated, not containers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    origin = getattr(annotation, "__origin__", None)
    if origin in {dict, tuple, list}:
        return None
    return next((found for argument in get_args(annotation) if (found := _inner(argument))), None)
