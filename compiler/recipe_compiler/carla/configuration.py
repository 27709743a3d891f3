"""Reads the values of a configuration, checks their types and limits, and resolves references such as `${max_frames}`.

Nothing is executed: a reference to another value of the same configuration is replaced with that value, and every other
`${...}` remains text, which is an error where a value is needed.
"""

from __future__ import annotations

import math
import re
from itertools import islice

from recipe_compiler.carla.report import Ledger, Node, Path, key_of, number_text
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.source.yaml_reader import MAX_DEPTH, Value, show

_REFERENCE = re.compile(r"\$\{([A-Za-z_][\w-]*(?:\.[\w-]+|\[\d+\])*)\}\Z")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\Z")
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_INDEX = re.compile(r"[0-9]{1,9}\Z")
_MAX_REFERENCE_DEPTH = 16  # references in a chain
_MAX_REPLACED_VALUES = 10_000  # values that replace references


class Reader:
    """Reads typed values and collects problems.

    Attributes:
        ledger: the outcome of each key.
        problems: the mistakes of the configuration.
    """

    def __init__(self) -> None:
        self.ledger = Ledger()
        self.problems: list[Problem] = []

    def reject(self, node: Node, message: str, remedy: str, code: Code = Code.INVALID_VALUE) -> None:
        """Add a problem at a value."""
        where = f"{node.key}: " if node.path else ""
        self.problems.append(Problem(where + message, node.place, remedy, code))

    def number(self, node: Node | None, low: float = -1e6, high: float = 1e6) -> float | None:
        """Return a number, which may be written as text.

        Returns:
            None if it is absent; None, with a problem, if it is not a finite number or is out of range.
        """
        if node is None:
            return None
        data = node.value.data
        if isinstance(data, str) and len(data) <= 40 and _NUMBER.match(data.strip()):
            data = float(data)
        if isinstance(data, bool) or not isinstance(data, int | float) or not math.isfinite(data):
            self._wrong_type(node, "a number")
            return None
        if not low <= data <= high:
            remedy = f"write a number from {number_text(low)} to {number_text(high)}"
            self.reject(node, f"{show(node.value.plain)} is out of range", remedy, Code.OUT_OF_RANGE)
            return None
        return data + 0.0

    def integer(self, node: Node | None, low: int, high: int) -> int | None:
        """Return an integer, like `number`."""
        number = self.number(node, low, high)
        if node is None or number is None:
            return None
        if number != int(number):
            self._wrong_type(node, "a whole number")
            return None
        return int(number)

    def text(self, node: Node | None) -> str | None:
        """Return text; numbers are converted. None if absent; None, with a problem, if it is a map or a list."""
        if node is None:
            return None
        data = node.value.data
        if isinstance(data, dict | tuple) or "${" in str(data):
            self._wrong_type(node, "text")
            return None
        return data if isinstance(data, str) else show(data)

    def boolean(self, node: Node | None) -> bool | None:
        """Return a boolean, which may be written as text. None if absent; None, with a problem, if it is not one."""
        if node is None:
            return None
        data = node.value.data
        found = data if isinstance(data, bool) else _BOOLEANS.get(str(data).lower())
        if found is None:
            self._wrong_type(node, "true or false")
        return found

    def map(self, node: Node | None) -> Node | None:
        """Return a map. None if absent; None, with a problem, if the value is not a map."""
        if node is not None and not isinstance(node.value.data, dict):
            self._wrong_type(node, "a map")
            return None
        return node

    def items(self, node: Node | None) -> list[Node]:
        """Return the items of a list. Empty if absent; empty, with a problem, if the value is not a list."""
        if node is None:
            return []
        if not isinstance(node.value.data, tuple):
            self._wrong_type(node, "a list")
            return []
        return list(node.children())

    def _wrong_type(self, node: Node, wanted: str) -> None:
        data = node.value.data
        if isinstance(data, str) and "${" in data:
            remedy = "write the value itself, or a reference to a value of these files, such as ${max_frames}"
            self.reject(node, f"the reference {show(data)} cannot be resolved", remedy)
        else:
            self.reject(node, f"it is {show(node.value.plain)}", f"write {wanted}")


def resolve(root: Value, problems: list[Problem]) -> tuple[Value, dict[Path, Path]]:
    """Resolve references to other values of the same configuration.

    Args:
        root: the configuration.
        problems: receives the first reference that is circular or leads to too many values.

    Returns:
        The configuration with the referenced values, and the path of the value that each reference names. References of
        other forms remain text.
    """
    targets: dict[Path, Path] = {}
    replaced = 0

    def resolved(value: Value, path: Path, depth: int) -> Value:
        nonlocal replaced
        if isinstance(value.data, dict):
            entries = {key: resolved(each, (*path, key), depth) for key, each in value.data.items()}
            return Value(entries, value.place, value.keys)
        if isinstance(value.data, tuple):
            items = (resolved(each, (*path, index), depth) for index, each in enumerate(value.data))
            return Value(tuple(items), value.place)
        match = _REFERENCE.match(value.data) if isinstance(value.data, str) and not problems else None
        target = _target(match[1]) if match is not None else ()
        referenced = root.get(*target) if target else None
        if referenced is None:
            return value
        replaced += sum(1 for _ in islice(Node.root(referenced).leaves(), _MAX_REPLACED_VALUES))
        if depth >= _MAX_REFERENCE_DEPTH or len(path) > MAX_DEPTH or replaced > _MAX_REPLACED_VALUES:
            message = f"{key_of(path)}: the reference {show(value.data)} is circular, or leads to too many values"
            problems.append(Problem(message, value.place, "write the value itself", Code.INPUT_LIMIT))
            return value
        targets.setdefault(path, target)
        return resolved(referenced, path, depth + 1)

    return resolved(root, (), 0), targets


def _target(text: str) -> Path:
    """The path that a reference names: keys, and indices in brackets or as keys."""
    steps = re.findall(r"[\w-]+", text)
    return tuple(int(step) if _INDEX.match(step) else step for step in steps)
