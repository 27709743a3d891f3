"""YAML with positions: every value of a recipe knows the file, line and column that set it.

Recipes are untrusted: bytes, nodes and depth are limited, tags are refused, and only numbers, text, lists and maps
are constructed. A plain scalar on which YAML 1.1 and YAML 1.2 disagree (`no`,
`12:30`, `1_000`, `017`, `1e3`, a date) is refused, with both readings in the message;
quoting or rewriting it removes the ambiguity. Keys are always text, so `on:` is a key like any other.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import yaml

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.errors import printable as printable
from recipe_compiler.source.yaml_help import FLOAT, LINE_BREAK, ambiguity, explain, missing_colon

MAX_BYTES = 1 << 20
MAX_NODES = 50_000  # after aliases are expanded
MAX_DEPTH = 32
MAX_INTEGER = 2**53 - 1  # beyond it, JSON readers disagree

_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)\Z|0x[0-9a-fA-F]+\Z")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)\Z|\.(nan|NaN|NAN)\Z")
_NULLS = {"null": None, "Null": None, "NULL": None, "~": None, "": None}
_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}

Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[str, Plain] | None"


@dataclass(frozen=True, eq=False)
class Value:
    """A value of a recipe: a scalar, a tuple of values, or a map of them, with the place that set it."""

    data: bool | int | float | str | tuple[Value, ...] | dict[str, Value] | None
    place: Place
    keys: dict[str, Place] = field(default_factory=dict)  # of a map: the place of each key
    replaces: bool = False  # a map of a patch that replaces the existing value, as other values do

    @cached_property
    def plain(self) -> Plain:
        """The value as plain Python data, without places."""
        if isinstance(self.data, dict):
            return {key: value.plain for key, value in self.data.items()}
        if isinstance(self.data, tuple):
            return [value.plain for value in self.data]
        return self.data

    @property
    def map(self) -> dict[str, Value]:
        """Its entries; empty if it is not a map."""
        return self.data if isinstance(self.data, dict) else {}

    def get(self, *path: str | int) -> Value | None:
        """The value at a path of keys and indices below it; None if it does not exist."""
        here: Value = self
        for step in path:
            if isinstance(here.data, dict) and step in here.data:
                here = here.data[str(step)]
            elif isinstance(here.data, tuple) and isinstance(step, int) and step < len(here.data):
                here = here.data[step]
            else:
                return None
        return here

    def place_of(self, *path: str | int) -> Place:
        """The place of the value at a path; if it does not exist, the place of the nearest enclosing map's key."""
        here, place = self, self.place
        for step in path:
            child = here.get(step)
            if child is None:
                return here.keys.get(str(step), place)
            place = here.key_place(step) if isinstance(child.data, dict) else child.place
            here = child
        return place

    def key_place(self, key: str | int) -> Place:
        """The place of a key of this map; for an item of a list, the item's own place."""
        if isinstance(key, str) and key in self.keys:
            return self.keys[key]
        child = self.get(key)
        return child.place if child else self.place


def show(value: object) -> str:
    """A value for messages: JSON, shortened; letters of every script are kept, control characters are escaped."""
    if isinstance(value, dict):
        return "a map"
    if isinstance(value, list | tuple):
        return "a list"
    text = printable(json.dumps(value[:60] if isinstance(value, str) else value, ensure_ascii=False))
    return text if len(text) <= 60 and not (isinstance(value, str) and len(value) > 60) else text[:56] + '..."'


def parse(content: bytes, file: str) -> tuple[Value | None, list[Problem]]:
    """Parse a YAML document.

    Args:
        content: the bytes of the file.
        file: its name in places.

    Returns:
        The root value, None if it cannot be read, and all problems of the YAML.
    """
    start = Place(file, 1, 1)
    if len(content) > MAX_BYTES:
        message = f"the file is larger than {MAX_BYTES:,} bytes, the limit for a recipe"
        return None, [Problem(message, start, "is this a recipe? if so, split it with `extends`", Code.INPUT_LIMIT)]
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start].decode("utf-8-sig", errors="replace")
        message = f"not a text file in UTF-8: byte 0x{content[error.start]:02x} at offset {error.start}"
        return None, [Problem(message, _place_after(before, file), "save the file as UTF-8 text", Code.NOT_TEXT)]
    reader = _Reader(file)
    try:
        root = reader.document(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.reader.ReaderError as error:
        message = f"the character U+{int(error.character):04X} is not allowed in YAML"
        place = _place_after(text[: error.position], file)
        return None, [*reader.problems, Problem(message, place, "remove it; is this a text file?", Code.NOT_TEXT)]
    except yaml.MarkedYAMLError as error:
        opened = _place_of(error.context_mark, file)
        place = _place_of(error.problem_mark, file) or opened or start
        return None, [*reader.problems, explain(error.problem or "", error.context or "", opened, text, place)]
    except _StopError as stop:
        return None, [*reader.problems, stop.problem]
    if root is None and not reader.problems:
        remedy = "a recipe starts with the line `recipe: its_name`; `recipe init` writes one"
        return None, [Problem("the file is empty", start, remedy, Code.EMPTY_FILE)]
    return root, reader.problems


def lines(content: bytes) -> list[str]:
    """The lines of a file, to show where a problem is; empty if the file is too large."""
    if len(content) > MAX_BYTES:
        return []
    return LINE_BREAK.split(content.decode("utf-8-sig", errors="replace"))


def _place_after(text: str, file: str) -> Place:
    """The place that follows a text from the start of a file."""
    before = LINE_BREAK.split(text)
    return Place(file, len(before), len(before[-1]) + 1)


def _place_of(mark: yaml.Mark | None, file: str) -> Place | None:
    return Place(file, mark.line + 1, mark.column + 1) if mark else None


class _StopError(Exception):
    """Reading stops: what follows cannot be understood."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem


class _Reader:
    """Builds values from YAML events and collects problems."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self._anchors: dict[str, tuple[Value | None, int, int]] = {}  # value (None: still open), its nodes, its depth
        self._nodes = self._deepest = 0

    def document(self, events: Iterator[yaml.Event]) -> Value | None:
        root: Value | None = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent) and root is not None:
                raise self._stop(event, "a second document starts here", "a recipe is one document: remove the `---`")
            if isinstance(event, yaml.NodeEvent):
                root = self._value(event, events, 0)
        return None if root is None or root.data is None else root

    def _place(self, event: yaml.Event) -> Place:
        mark = event.start_mark
        return Place(self.file, mark.line + 1, mark.column + 1) if mark else Place(self.file, 1, 1)

    def _stop(self, event: yaml.Event, message: str, help: str, code: Code = Code.UNSUPPORTED_YAML) -> _StopError:
        return _StopError(Problem(message, self._place(event), help, code))

    def _report(self, event: yaml.Event, message: str, help: str, code: Code = Code.UNSUPPORTED_YAML) -> None:
        self.problems.append(Problem(message, self._place(event), help, code))

    def _count(self, event: yaml.Event, nodes: int) -> None:
        self._nodes += nodes
        if self._nodes > MAX_NODES:
            message = f"{self._nodes:,} values up to here, counting what aliases repeat; the limit is {MAX_NODES:,}"
            raise self._stop(event, message, "repeat less with aliases (`*name`)", Code.INPUT_LIMIT)

    def _value(self, event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Value:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth)
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        self._check_depth(event, depth, "close brackets that are open")
        nodes, deepest, self._deepest = self._nodes, self._deepest, depth
        self._count(event, 1)
        if event.tag:
            self._report(event, f"the tag {show(event.tag)} is refused: recipes hold plain data only", "remove it")
        if event.anchor:
            self._anchors[event.anchor] = (None, 0, 0)
        if isinstance(event, yaml.ScalarEvent):
            value = Value(self._scalar(event), self._place(event))
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self._list(event, events, depth)
        else:
            value = self._map(event, events, depth)
        if event.anchor:
            self._anchors[event.anchor] = (value, self._nodes - nodes, self._deepest - depth)
        self._deepest = max(deepest, self._deepest)
        return value

    def _check_depth(self, event: yaml.Event, depth: int, remedy: str) -> None:
        """Record the depth of a value, and stop if it exceeds the limit."""
        self._deepest = max(self._deepest, depth)
        if depth > MAX_DEPTH:
            message = f"{depth} maps or lists inside each other, the limit is {MAX_DEPTH}"
            raise self._stop(event, message, f"a recipe needs no more than eight: {remedy}", Code.INPUT_LIMIT)

    def _alias(self, event: yaml.AliasEvent, depth: int) -> Value:
        name = event.anchor or ""
        value, nodes, inner = self._anchors.get(name, (None, -1, 0))
        if value is None:
            cause = "is not defined above" if nodes < 0 else "is used inside the value that it names"
            remedy = f"define it above with `&{name[:40]}`, or quote a text that starts with `*`"
            if nodes >= 0:
                remedy = "write out the value: it would contain itself"
            raise self._stop(event, f"the alias *{name[:40]} {cause}", remedy)
        self._count(event, nodes)
        self._check_depth(event, depth + inner, "nest aliases less")
        return value

    def _list(self, event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Value:
        items: list[Value] = []
        for inner in events:
            if isinstance(inner, yaml.SequenceEndEvent):
                break
            items.append(self._value(inner, events, depth + 1))
        return Value(tuple(items), self._place(event))

    def _map(self, event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Value:
        entries: dict[str, Value] = {}
        keys: dict[str, Place] = {}
        for inner in events:
            if isinstance(inner, yaml.MappingEndEvent):
                break
            if not isinstance(inner, yaml.ScalarEvent):
                raise self._stop(
                    inner, "a key must be plain text, not a list, a map or an alias", "write a name before the `:`"
                )
            self._count(inner, 1)
            key = inner.value
            if key == "<<" and inner.implicit[0]:
                self._report(inner, "merge keys `<<` are not part of the language", "use `extends` or a delta")
            elif inner.implicit[0] and re.search(r"[{\[]", key) and (words := missing_colon(key)):
                raise self._stop(inner, *words, Code.YAML_SYNTAX)
            elif key in entries:
                message = f"duplicate key {show(key)}, first on line {keys[key].line}"
                self._report(inner, message, "remove one", Code.DUPLICATE_KEY)
            value = self._value(next(events), events, depth + 1)
            if key not in entries and key != "<<":
                entries[key], keys[key] = value, self._place(inner)
        return Value(entries, self._place(event), keys)

    def _scalar(self, event: yaml.ScalarEvent) -> bool | int | float | str | None:
        text = str(event.value)
        if not event.implicit[0]:
            return text  # quoted, or a block
        if text in _NULLS:
            return None
        if text in _BOOLEANS:
            return _BOOLEANS[text]
        if _NOT_FINITE.match(text):
            self._report(event, f"{text} is not a finite number", "write a finite one", Code.INVALID_VALUE)
            return text
        ambiguous = ambiguity(text)
        if ambiguous:
            self._report(event, *ambiguous, Code.AMBIGUOUS_YAML)
            return text
        return self._number(event, text)

    def _number(self, event: yaml.ScalarEvent, text: str) -> int | float | str:
        if _INTEGER.match(text):
            if len(text) > 20 or abs(int(text, 0)) > MAX_INTEGER:
                shown = text if len(text) <= 20 else f"{text[:20]}... of {len(text)} digits"
                message = f"the number {shown} is too large"
                self._report(event, message, f"write one within {MAX_INTEGER}", Code.OUT_OF_RANGE)
                return text
            return int(text, 0)
        if FLOAT.match(text) and len(text) <= 400:
            number = float(text)
            if not math.isfinite(number):
                message = f"the number {text[:20]} is too large for a float"
                self._report(event, message, "write a smaller one", Code.OUT_OF_RANGE)
                return text
            return number + 0.0  # -0.0 is 0
        return text
