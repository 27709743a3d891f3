"""A recipe under construction, and its text."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from recipe_compiler.carla.report import Report, number_text
from recipe_compiler.ir.errors import printable
from recipe_compiler.schema.fields import NAME, NAME_LENGTH
from recipe_compiler.source.yaml_reader import show

Data: TypeAlias = "bool | int | float | str | Sequence[Data] | Mapping[str, Data]"

_COLUMNS = 110  # of a map on one line
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.*?-]*\Z")
_WORDS = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"}
_BLOCKS = ("base", "base.actors", "base.sensors", "base.patches", "deltas", "deltas.weather")  # a line for each key
_BASE = ("clock", "town", "weather", "actors", "traffic", "patches", "sensors")


@dataclass
class Draft:
    """The maps of a recipe, filled key by key.

    Attributes:
        data: the recipe.
        draws: distributions by path, below `base`.
    """

    data: dict[str, Data] = field(default_factory=dict)
    draws: dict[str, dict[str, Data]] = field(default_factory=dict)

    def set(self, path: str, value: Data) -> None:
        """Set a value at a dotted path."""
        *parents, last = path.split(".")
        here = self.data
        for key in parents:
            here = here.setdefault(key, {})  # type: ignore[assignment]
        here[last] = value

    def finish(self) -> None:
        """Put the keys of `base` into the order of a recipe, and add the draws."""
        base = self.data["base"]
        assert isinstance(base, dict)
        self.data["base"] = {key: base[key] for key in _BASE if key in base}
        if self.draws:
            self.set("sweep.draw", {"count": 1, "values": self.draws})


def name_for(text: str, taken: Sequence[str], fallback: str) -> str:
    """Return a free name of the recipe language that is as similar to a text as possible.

    Args:
        text: the wanted name.
        taken: the names in use; names that differ from them only in case are not free either.
        fallback: the name if no character of the text is allowed.
    """
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_-")[:NAME_LENGTH] or fallback
    assert re.fullmatch(NAME.strip("^$"), name), name
    lower, number, free = {each.lower() for each in taken}, 1, name
    while free.lower() in lower:
        number += 1
        free = f"{name[: NAME_LENGTH - 8]}_{number}"
    return free


def text_of(draft: Draft, report: Report) -> str:
    """Return the text of a recipe, with a comment at each value that was mapped."""
    head = [
        f"# Imported from {', '.join(map(printable, report.files))} by `recipe import carla`.",
        f"# {report.name}.import.txt reports the outcome of every key.",
        *(f"# {printable(note)}" for note in report.notes),
    ]
    lines = _block(draft.data, (), _comments(draft.data, report))
    return "\n".join(["\n".join(_wrapped(line) for line in head), *lines, ""])


def _comments(data: Mapping[str, Data], report: Report) -> dict[tuple[str, ...], list[str]]:
    """Return the comments of each line, by the path of the value whose line it is."""
    found: dict[tuple[str, ...], dict[str, list[str]]] = {}
    entries = [(row.to, row.why, 0) for row in report.rows if row.outcome == "mapped" and row.to]
    entries += [(default.to, default.why, int(default.to.count(".") > 1)) for default in report.defaults]
    for to, why, above in entries:  # defaults are noted at the line of the map that holds them
        path = tuple(to.split("."))
        line = _line_of(data, path[: len(path) - above])
        rest = to.split(".")[len(line) :] or [line[-1]]
        keys = found.setdefault(line, {}).setdefault(why, [])
        if ".".join(rest) not in keys:
            keys.append(".".join(rest))
    return {line: [f"{', '.join(keys)}: {why}" for why, keys in by.items()] for line, by in found.items()}


def _line_of(data: Mapping[str, Data], path: tuple[str, ...]) -> tuple[str, ...]:
    """Return the longest prefix of a path whose value has a line of its own."""
    here: Data = data
    for depth, key in enumerate(path):
        if not isinstance(here, Mapping) or key not in here:
            return path[:depth] or path[:1]
        here = here[key]
        if not _is_block(here, path[: depth + 1]):
            return path[: depth + 1]
    return path


def _is_block(value: Data, path: tuple[str, ...]) -> bool:
    """Return whether a value is a map that is written with a line for each key."""
    if not isinstance(value, Mapping) or not value:
        return False
    return ".".join(path) in _BLOCKS or len("  " * len(path) + f"{path[-1]}: {_flow(value)}") > _COLUMNS


def _block(data: Mapping[str, Data], path: tuple[str, ...], comments: Mapping[tuple[str, ...], list[str]]) -> list[str]:
    lines = []
    indent = "  " * len(path)
    for key, value in data.items():
        here = (*path, key)
        if not path and isinstance(value, Mapping):
            lines.append("")
        lines += [_wrapped(f"{indent}# {printable(comment)}") for comment in comments.get(here, [])]
        if isinstance(value, Mapping) and _is_block(value, here):
            lines += [f"{indent}{_key(key)}:", *_block(value, here, comments)]
        else:
            lines.append(f"{indent}{_key(key)}: {_flow(value)}")
    return lines


def _flow(value: Data) -> str:
    if isinstance(value, str):
        return value if _PLAIN.match(value) and value.lower() not in _WORDS else _quoted(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)}: {_flow(each)}" for key, each in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_flow, value)) + "]"
    return number_text(value) if isinstance(value, float) else show(value)


def _key(text: str) -> str:
    """A key: words that YAML reads as values are text in keys of recipes."""
    return text if _PLAIN.match(text) else _quoted(text)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=not text.isprintable())  # YAML knows no escapes of surrogate pairs


def _wrapped(line: str) -> str:
    """A comment, wrapped at 120 columns."""
    indent = line[: len(line) - len(line.lstrip())]
    words = " ".join(line.split())
    wide = textwrap.TextWrapper(120, indent, f"{indent}#  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(wide.wrap(words))
