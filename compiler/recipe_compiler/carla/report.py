"""The outcome of every key of an imported configuration: kept, mapped or ignored, with its place and the reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Literal, TypeAlias, get_args

from recipe_compiler.ir.errors import Place, printable
from recipe_compiler.source.yaml_reader import Value, show

Path: TypeAlias = "tuple[str | int, ...]"
Outcome = Literal["kept", "mapped", "ignored"]
"""The outcome of a key: the recipe has the same value with the same meaning; another value, or a value with nearly the
same meaning; or nothing that depends on it."""

_MAX_KEY_LENGTH = 60  # characters of a key in a path


@dataclass(frozen=True)
class Row:
    """The outcome of one key.

    Args:
        place: the key in the configuration.
        key: its path, such as `spawn_actors[0].blueprint.name`.
        value: its value, as messages show it.
        outcome: its outcome.
        to: the path in the recipe, such as `base.clock.fps`; empty if it is ignored.
        written: the value in the recipe, if it differs.
        why: the reason, if it is not kept.
    """

    place: Place
    key: str
    value: str
    outcome: Outcome
    to: str = ""
    written: str = ""
    why: str = ""


@dataclass(frozen=True)
class Default:
    """A value of the recipe that the configuration does not set: the collector's default."""

    to: str
    written: str
    why: str


@dataclass(frozen=True)
class Node:
    """A value of a configuration with its path. A null counts as absent."""

    value: Value
    path: Path
    place: Place

    @classmethod
    def root(cls, value: Value) -> Node:
        """The node of an entire configuration."""
        return cls(value, (), value.place)

    @property
    def key(self) -> str:
        """The path as text."""
        return key_of(self.path)

    def get(self, *keys: str) -> Node | None:
        """The value at a path of keys below it; None if it is absent or null."""
        node = self
        for key in keys:
            child = node.value.map.get(key)
            if child is None or child.data is None:
                return None
            node = Node(child, (*node.path, key), node.value.key_place(key))
        return node

    def children(self) -> Iterator[Node]:
        """The values of a map or a list, in file order, nulls included."""
        if isinstance(self.value.data, dict):
            for key, child in self.value.data.items():
                yield Node(child, (*self.path, key), self.value.key_place(key))
        elif isinstance(self.value.data, tuple):
            for index, child in enumerate(self.value.data):
                yield Node(child, (*self.path, index), child.place)

    def leaves(self) -> Iterator[Node]:
        """The scalars below it, and the empty maps and lists."""
        children = list(self.children())
        if not children:
            yield self
        for child in children:
            yield from child.leaves()


def key_of(path: Path) -> str:
    """A path as text: `spawn_actors[0].blueprint`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{_short(step)}" if text else _short(step)
    return printable(text)


def _short(key: str) -> str:
    """A key, truncated so that the paths of all values of a file take little memory."""
    return key if len(key) <= _MAX_KEY_LENGTH else f"{key[:_MAX_KEY_LENGTH]}..."


def written(value: object) -> str:
    """A value of the recipe, as a report shows it."""
    if isinstance(value, float):
        return number_text(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {written(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(written, value)) + "]"
    return show(value)


def number_text(value: float) -> str:
    """A number to 6 decimals, without trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


@dataclass
class Ledger:
    """Collects the outcomes of keys; only the first entry of a key is kept. Absent keys, None, have no outcome."""

    rows: dict[tuple[str, Path], Row] = field(default_factory=dict)
    defaults: dict[Default, None] = field(default_factory=dict)

    def kept(self, node: Node | None, to: str) -> None:
        """Record that the recipe has the same value, with the same meaning, at the path `to`."""
        self._note(node, "kept", to)

    def mapped(self, node: Node | None, to: str, value: object, why: str) -> None:
        """Record that the recipe has `value` at the path `to` instead, with the reason."""
        self._note(node, "mapped", to, written(value), why)

    def ignored(self, node: Node | None, why: str) -> None:
        """Record that nothing in the recipe depends on a value or on the values below it that have no entry yet."""
        self._note(node, "ignored", why=why)

    def default(self, to: str, value: object, why: str) -> None:
        """Record a value of the recipe that no key sets."""
        self.defaults[Default(to, written(value), why)] = None

    def record(self, node: Node | None, to: str, value: object, why: str, absent: str = "") -> None:
        """Record a value of the recipe: kept if `why` is empty, else mapped; without a key a default, why `absent`."""
        if node is None:
            if absent:
                self.default(to, value, absent)
        elif why:
            self.mapped(node, to, value, why)
        else:
            self.kept(node, to)

    def has(self, node: Node) -> bool:
        """Return whether a key has an entry."""
        return (node.place.file, node.path) in self.rows

    def _note(self, node: Node | None, outcome: Outcome, to: str = "", value: str = "", why: str = "") -> None:
        if node is None:
            return
        is_spread = outcome == "ignored" or isinstance(node.value.data, tuple)  # a range: a row for each of its ends
        for leaf in node.leaves() if is_spread else (node,):
            shown = show(leaf.value.plain)
            row = Row(leaf.place, leaf.key, shown, outcome, to, "" if value == shown else value, why)
            self.rows.setdefault((leaf.place.file, leaf.path), row)


@dataclass(frozen=True)
class Report:
    """The report of one import: every key of its input, in the order of files and lines."""

    name: str
    files: tuple[str, ...]
    notes: tuple[str, ...]
    rows: tuple[Row, ...]
    defaults: tuple[Default, ...]

    def counts(self) -> dict[str, int]:
        """The number of keys by outcome."""
        return {each: sum(row.outcome == each for row in self.rows) for each in get_args(Outcome)}

    def lines(self) -> Iterator[str]:
        """The report as text."""
        for note in self.notes:
            yield f"note: {printable(note)}"
        for row in self.rows:
            arrow = f" -> {row.to}" if row.to else ""
            value = f" = {row.written}" if row.written else ""
            why = f" ({row.why})" if row.why else ""
            where = f"{row.place.file}:{row.place.line}"
            yield f"{row.outcome:<8} {where}: {row.key}: {row.value}{arrow}{value}{why}"
        for default in self.defaults:
            yield f"default  {default.to} = {default.written} ({default.why})"

    def document(self) -> dict[str, object]:
        """The report as JSON data."""
        return {
            "recipe": self.name,
            "files": list(self.files),
            "counts": self.counts(),
            "notes": list(self.notes),
            "keys": [
                {"file": row.place.file, "line": row.place.line, "key": row.key}
                | {name: getattr(row, name) or None for name in ("value", "outcome", "to", "written", "why")}
                for row in self.rows
            ],
            "defaults": [asdict(default) for default in self.defaults],
        }
