"""`extends` and deltas: JSON merge patches (RFC 7386) over values that keep their places.

A map is merged into the existing map, any other value replaces the existing value, and `null` removes it. The place of
a merged value is that of the file and line that set it. Files are read only from the root recipe's folder and below.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.source import file_help, yaml_reader
from recipe_compiler.source.file_help import nearest_file
from recipe_compiler.source.yaml_reader import Value, show

MAX_CHAIN = 16

# A bare word is short for a map with one entry: `weather: ClearNoon` for `{preset: ClearNoon}`.
SHORTHANDS = {"weather": "preset", "town": "name"}


class Merger:
    """Merges patches. Equal arguments (by identity) give the same result object, so sharing is visible by identity."""

    def __init__(self) -> None:
        self._merged: dict[tuple[int, int], tuple[Value, Value, Value]] = {}

    def merge(self, target: Value, patch: Value) -> Value:
        """The target with the patch applied; the target itself if the patch changes nothing."""
        if not isinstance(patch.data, dict):
            return patch
        if not isinstance(target.data, dict):
            target = Value({}, patch.place)
        known = self._merged.get((id(target), id(patch)))
        if known:
            return known[2]
        result = self._merge_maps(target, patch)
        self._merged[id(target), id(patch)] = (target, patch, result)  # kept alive, so that their ids stay unique
        return result

    def _merge_maps(self, target: Value, patch: Value) -> Value:
        entries, keys, changed = dict(target.map), dict(target.keys), False
        for key, value in patch.map.items():
            if value.data is None:
                changed |= entries.pop(key, None) is not None
                keys[key] = patch.key_place(key)  # so that an error about its absence has this place
                continue
            before = None if value.replaces else entries.get(key)
            after = self.merge(before if before is not None else Value({}, value.place), value)
            if before is None or after is not before:
                entries[key], changed = after, True
                keys.setdefault(key, patch.key_place(key))
                if before is not None and not isinstance(value.data, dict):
                    keys[key] = patch.key_place(key)
        return Value(entries, target.place, keys) if changed else target


def expand_shorthands(base: Value) -> Value:
    """A base with its shorthands expanded; the same object if it has none."""
    entries = dict(base.map)
    for key, name in SHORTHANDS.items():
        value = entries.get(key)
        if value is not None and isinstance(value.data, str):
            entries[key] = Value({name: value}, value.place, {name: value.place}, replaces=True)
    return base if all(entries[k] is base.map[k] for k in entries) else Value(entries, base.place, base.keys)


@dataclass
class Sources:
    """The files of a recipe: the merged root value, the digest of each file, and the problems of reading them."""

    root: Value | None = None
    files: dict[str, str] = field(default_factory=dict)
    lines: dict[str, list[str]] = field(default_factory=dict)  # of each file by its path in messages
    problems: list[Problem] = field(default_factory=list)


def read(path: Path) -> Sources:
    """Read a recipe file and the files that it extends, and merge them. Each file is read and hashed once."""
    sources, merger, folder = Sources(), Merger(), path.parent
    layers: list[Value] = []
    name: str | None = path.name
    place: Place | None = None
    seen: list[str] = []
    while name is not None:
        if len(seen) >= MAX_CHAIN:
            message = f"extends: {len(seen) + 1} files in the chain, the limit is {MAX_CHAIN}"
            _report(sources, message, place, "join some of the files", Code.INPUT_LIMIT)
            return sources
        value = _read_one(folder, name, place, sources)
        if value is None:
            return sources
        seen.append(name)
        layers.append(value if len(seen) == 1 else _without(value, "recipe", "extends"))  # a name is the root's own
        name, place = _next(folder, name, value, seen, sources)
    merged = layers.pop()
    while layers:
        merged = _merged_over(merged, layers.pop(), merger)
    sources.root = merged
    return sources


def _merged_over(below: Value, above: Value, merger: Merger) -> Value:
    base = below.get("base")
    if base is not None:
        below = Value({**below.map, "base": expand_shorthands(base)}, below.place, below.keys)
    merged = merger.merge(below, above)
    entries = dict(merged.map)
    patches = below.get("deltas"), above.get("deltas")
    if patches[1] is not None and patches[1].data is not None:
        entries["deltas"] = _joined(patches[0], patches[1])
    return Value(entries, above.place, {**merged.keys, **above.keys})


def _joined(below: Value | None, above: Value, depth: int = 0) -> Value:
    """Merge deltas over deltas. They are patches themselves: a null in one is kept, since it removes from the base.

    A null for a whole axis, or for one of its values, removes that. A map over something else, such as a shorthand or
    a null, replaces what the base has, as that alone does.
    """
    if not isinstance(above.data, dict):
        return above
    entries, keys, replaces = {}, {}, False
    if below is not None:
        entries, keys = dict(below.map), dict(below.keys)
        replaces = below.replaces or not isinstance(below.data, dict)
    short = expand_shorthands(Value(entries, above.place)).map if depth == 2 else entries
    for key, value in above.map.items():
        keys[key] = above.key_place(key)
        if depth < 2 and value.data is None:
            entries.pop(key, None)
        else:
            entries[key] = _joined(short.get(key), value, depth + 1)
    return Value(entries, above.place, keys, replaces)


def _without(value: Value, *keys: str) -> Value:
    return Value({key: item for key, item in value.map.items() if key not in keys}, value.place, value.keys)


def _report(
    sources: Sources, message: str, place: Place | None, help: str | None = None, code: Code = Code.UNREADABLE_FILE
) -> None:
    sources.problems.append(Problem(message, place, help, code))


def _read_one(folder: Path, name: str, place: Place | None, sources: Sources) -> Value | None:
    path = folder / name
    where = f"extends: {show(name)}: " if place else f"{path}: "
    try:
        content = read_regular(path, yaml_reader.MAX_BYTES)
    except FileNotFoundError:
        usual = "paths are relative to this file" if place else "`recipe init` writes a recipe"
        remedy = nearest_file(path, {folder / read for read in sources.files}) or usual
        _report(sources, f"{where}there is no such file", place, remedy, Code.FILE_NOT_FOUND)
        return None
    except IsADirectoryError:
        _report(sources, f"{where}is a folder", place, file_help.recipe_of_folder(path))
        return None
    except (OSError, ValueError) as error:
        cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        _report(sources, f"{where}cannot be read: {cause}", place, "name a recipe file that you may read")
        return None
    sources.files[name] = hashlib.sha256(content).hexdigest()
    kind = file_help.other_kind(content)
    if kind is not None:
        _report(sources, f"{where}is {kind[0]}, and not a recipe", place, kind[1], Code.INVALID_VALUE)
        return None
    shown = yaml_reader.printable(str(path))
    sources.lines[shown] = yaml_reader.lines(content)
    value, problems = yaml_reader.parse(content, shown)
    sources.problems += problems
    if value is not None and not isinstance(value.data, dict):
        message = f"a recipe is a map, and this is {_kind(value)}"
        _report(sources, message, value.place, "start with the line `recipe: its_name`", Code.INVALID_VALUE)
        return None
    return value


def _kind(value: Value) -> str:
    return "a list" if isinstance(value.data, tuple) else f"the value {show(value.plain)}"


def _next(folder: Path, name: str, value: Value, seen: list[str], sources: Sources) -> tuple[str | None, Place | None]:
    """The file that this one extends, relative to the root recipe's folder, and the place of its name."""
    extends = value.get("extends")
    if extends is None or extends.data is None:
        return None, None
    if not isinstance(extends.data, str) or not extends.data:
        message = f"extends: must be the path of a recipe file, not {show(extends.plain)}"
        _report(sources, message, extends.place, "write such as `extends: street.yaml`", Code.INVALID_VALUE)
        return None, None
    problem, code = forbidden(extends.data), Code.PATH_REFUSED
    target = str(PurePosixPath(name).parent / extends.data) if not problem else ""
    if not problem and not stays_below(folder, target):
        problem = "leaves the recipe's folder through a symbolic link; put a copy of the file in the folder"
    if not problem and target in seen:
        circle = " -> ".join([*seen[seen.index(target) :], target])
        problem, code = f"the files extend each other in a circle: {circle}; remove one `extends`", Code.EXTENDS_CYCLE
    if problem:
        _report(sources, f"extends: {show(extends.data)}: {problem}", extends.place, code=code)
        return None, None
    return target, extends.place


def forbidden(target: str) -> str:
    """Why a path in a recipe is refused, before it is accessed; empty if it is allowed."""
    if target.startswith(("/", "~")) or "\\" in target or ":" in target or "\0" in target:
        return "an absolute or foreign path is refused; write it relative to this file, with `/`"
    if ".." in target.split("/"):
        name = show(PurePosixPath(target).name)
        reason = "`..` is refused: a recipe reads only files of its own folder and below"
        return f"{reason}; copy {name} into the recipe's folder and write {name}"
    if len(target) > 200:
        return f"the path has {len(target)} characters, the limit is 200; shorten it"
    try:
        target.encode()
    except UnicodeEncodeError:
        return "it has a character that no file name can have; rename the file"
    return ""


def stays_below(folder: Path, target: str) -> bool:
    """Whether a path stays within a folder after symbolic links are resolved."""
    try:
        return (folder / target).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):
        return False
