"""Sorts files into configurations, weathers and common settings, and imports each configuration."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from recipe_compiler.carla import actors, sensors, weather
from recipe_compiler.carla import settings as settings_of
from recipe_compiler.carla.configuration import Reader, References, resolve
from recipe_compiler.carla.draft import Data, Draft, name_for, text_of
from recipe_compiler.carla.forms import collector, oscar
from recipe_compiler.carla.forms.specs import Spec, unread_classes
from recipe_compiler.carla.placement import Site
from recipe_compiler.carla.report import Node, Report, Row, key_of
from recipe_compiler.carla.scene import Scene
from recipe_compiler.carla.settings import COLLECTOR, OSCAR, Form
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.source import yaml_reader
from recipe_compiler.source.merge import Merger
from recipe_compiler.source.yaml_reader import Value

_ACTORS = ("spawn_actors", "actors")
_CONTEXT = {"_target_", "client_params", "simulation_params", "sync_params", "weather_params"}
_WEATHER_PATHS: tuple[tuple[str, ...], ...] = (("weather",), ("context", "weather_params"), ("weather_params",), ())


@dataclass(frozen=True)
class File:
    """The bytes of a file, and its path for messages and reports."""

    path: str
    content: bytes

    @property
    def stem(self) -> str:
        """Its name without folder and suffix."""
        return PurePath(self.path).stem


@dataclass(frozen=True)
class Imported:
    """A recipe and the report of its import."""

    name: str
    text: str
    report: Report


@dataclass
class _Source:
    """A file that was read."""

    file: File
    root: Value


@dataclass
class _SortedFiles:
    """Files by their content."""

    configurations: list[_Source] = field(default_factory=list)
    weathers: list[tuple[_Source, tuple[str, ...]]] = field(default_factory=list)  # with the parameters' path
    settings: list[_Source] = field(default_factory=list)


def import_configurations(files: Sequence[File], *, town: str | None = None) -> tuple[Imported, ...]:
    """Import configurations.

    Args:
        files: configurations (files with actors), weathers (files with only weather parameters), and settings that all
            configurations share (all other files). Weathers become an axis of each recipe.
        town: the town of the library to use; None: the one most similar to the configuration's.

    Returns:
        One recipe for each configuration, in the order of the files.

    Raises:
        InputError: with all mistakes of the files, each with its place and a remedy.
    """
    problems: list[Problem] = []
    lines: dict[str, list[str]] = {}
    sorted_files = _sort(_read(files, problems, lines), problems)
    made: list[Imported] = []
    for source in sorted_files.configurations if not problems else ():
        one = _Import(source, sorted_files, [each.name for each in made], problems)
        result = one.run(town)
        if result is not None:
            made.append(result)
    if problems:
        error = InputError(sorted(set(problems), key=_order))
        error.with_source(lines)
        raise error
    return tuple(made)


def _order(problem: Problem) -> tuple[Place, str]:
    return problem.place or Place("", 0, 0), problem.message


def _read(files: Sequence[File], problems: list[Problem], lines: dict[str, list[str]]) -> list[_Source]:
    found: list[_Source] = []
    for file in files:
        shown = yaml_reader.printable(file.path)
        start = Place(shown, 1, 1)
        if len(file.content) > yaml_reader.MAX_BYTES:
            message = f"the file is larger than {yaml_reader.MAX_BYTES:,} bytes"
            problems.append(
                Problem(message, start, "check that this is a configuration, and make it smaller", Code.INPUT_LIMIT)
            )
            continue
        lines[shown] = yaml_reader.lines(file.content)
        root, wrong = yaml_reader.parse(file.content, shown)
        wrong = [_empty_file(start) if each.code is Code.EMPTY_FILE else each for each in wrong]
        problems += wrong
        if root is not None and not isinstance(root.data, dict):
            message = "a configuration must be a map of keys and values"
            problems.append(
                Problem(message, root.place, "name a configuration of CARLA's data collector", Code.INVALID_VALUE)
            )
        elif root is not None and not wrong:
            found.append(_Source(file, _in_context(root)))
    return found


def _in_context(root: Value) -> Value:
    """Return a file of OSCAR's configuration group `context` below that key, and other files unchanged."""
    if not set(root.map) <= _CONTEXT or not set(root.map) & (_CONTEXT - {"_target_", "weather_params"}):
        return root
    return Value({"context": root}, root.place, {"context": root.place})


def _has_actors(root: Value) -> bool:
    """Return whether a file is a configuration: `spawn_actors` or `actors` is present and not an empty map."""
    given = [root.map[key].data for key in _ACTORS if key in root.map]
    return any(data != {} and not (isinstance(data, str) and data.startswith("${oc.dict.values:")) for data in given)


def _empty_file(start: Place) -> Problem:
    return Problem("the file is empty", start, "name a configuration of CARLA's data collector", Code.EMPTY_FILE)


def _sort(sources: Iterable[_Source], problems: list[Problem]) -> _SortedFiles:
    """Sort files by their keys: a file with actors is a configuration, one with only weather parameters a weather."""
    found = _SortedFiles()
    for source in sources:
        path = _weather_path(source.root)
        if _has_actors(source.root):
            found.configurations.append(source)
        elif path is not None:
            found.weathers.append((source, path))
        else:
            found.settings.append(source)
    if not found.configurations and not problems:
        for source in [*found.settings, *(source for source, _ in found.weathers)][:1]:
            message = "no configuration: none of the files has spawn_actors or actors"
            is_recipe = {"recipe", "base"} <= set(source.root.map)
            remedy = "this is a recipe: build it as it is" if is_recipe else "name the main configuration as well"
            problems.append(Problem(message, source.root.place, remedy, Code.MISSING_KEY))
    return found


def _weather_path(root: Value) -> tuple[str, ...] | None:
    """Return the path of the weather parameters in a file that contains nothing else; None for other files."""
    for path in _WEATHER_PATHS:
        here = root.get(*path)
        outer = [root.get(*path[:depth]) for depth in range(len(path))]
        alone = all(len([k for k in each.map if k != "_target_"]) == 1 for each in outer if each is not None)
        if here is None or not alone or not isinstance(here.data, dict):
            continue
        if path or (here.map and set(here.map) <= {*weather.COLLECTOR, "_target_"}):
            return path
    return None


class _Import:
    """The import of one configuration."""

    def __init__(self, source: _Source, files: _SortedFiles, taken: Sequence[str], problems: list[Problem]) -> None:
        self._source, self._files, self._problems = source, files, problems
        self.reader = Reader()
        self.draft = Draft()
        self.name = name_for(source.file.stem, taken, "imported")

    def run(self, town: str | None) -> Imported | None:
        """Return the recipe and its report; None, with problems, if the configuration is invalid."""
        merger, merged = Merger(), Value({}, self._source.root.place)
        for each in [*self._files.settings, self._source]:
            merged = merger.merge(merged, each.root)
        merged = Value(merged.data, self._source.root.place, merged.keys)
        root, references = resolve(merged)
        self.reader.problems += references.problems
        node = Node.root(root)
        form = OSCAR if _is_oscar(root) else COLLECTOR
        self.draft.set("recipe", self.name)
        stem = yaml_reader.printable(self._source.file.stem)
        self.draft.set("description", f"Imported from {stem}, a configuration of {form.name}.")
        notes = self._fill(node, form, references, town)
        self._problems += self.reader.problems
        if notes is None or self.reader.problems:
            return None
        self.draft.finish()
        report = self._report(references, notes, node)
        return Imported(self.name, text_of(self.draft, report), report)

    def _fill(self, node: Node, form: Form, references: References, town: str | None) -> list[str] | None:
        """Write all parts of the recipe and return the notes of the report; None, with problems, if it is invalid."""
        settings = settings_of.read(self.reader, node, form, self.draft, town)
        self._write_weather(node, form)
        specs = oscar.read(self.reader, node) if form is OSCAR else collector.read(self.reader, node)
        if not any(spec.kind == "sensor" for spec in specs) and not self.reader.problems:
            place = node.get("spawn_actors") or node.get("actors") or node
            remedy = "add a sensor, such as sensor.camera.rgb"
            self.reader.reject(place, "the configuration has no camera", remedy, Code.MISSING_KEY)
        if settings is None:
            return None
        scene = Scene(self.reader, self.draft, settings, specs, references.targets, Site(settings.town))
        scene.prepare()
        if self.reader.problems:
            return None
        actors.write(scene)
        sensors.write(scene)
        actors.write_crowds(scene)
        self._put_sensors_last()
        return [settings.note, *_note_of_shift(scene, specs)]

    def _put_sensors_last(self) -> None:
        base = self.draft.data["base"]
        assert isinstance(base, dict)
        order = ("clock", "town", "weather", "actors", "traffic", "patches", "sensors")
        self.draft.data["base"] = {key: base[key] for key in order if key in base}

    def _write_weather(self, node: Node, form: Form) -> None:
        """Write the weather of the configuration, and an axis with the weather files."""
        own = self.reader.map(node.get(*form.weather))
        given = {} if own is None else weather.read(self.reader, own, "base.weather")
        defaults = weather.OSCAR if form is OSCAR and own is None else weather.COLLECTOR
        full: dict[str, Data] = weather.complete(self.reader, given, defaults, "base.weather")
        self.draft.set("base.weather", full)
        if not self._files.weathers:
            return
        axis: dict[str, Data] = {}
        if own is not None:
            axis[name_for(self._source.file.stem, [], "own")] = {}
        for source, path in self._files.weathers:
            value = name_for(source.file.stem, list(axis), "weather")
            root = Node.root(source.root)
            inner = root.get(*path) if path else root
            assert inner is not None
            axis[value] = {"weather": weather.read(self.reader, inner, f"deltas.weather.{value}.weather")}
        self.draft.set("deltas.weather", axis)

    def _report(self, references: References, notes: list[str], root: Node) -> Report:
        """Return the report, with an entry for each scalar of each file."""
        roots = [*self._files.settings, self._source, *(source for source, _ in self._files.weathers)]
        for source in roots:
            root_node = Node.root(source.root)
            for child in unread_classes(root_node):
                self.reader.ledger.ignored(child, "a class name, which its keys imply")
            for leaf in root_node.leaves():
                if not self.reader.ledger.has(leaf):
                    self._note_rest(leaf, references, root)
        order = {yaml_reader.printable(source.file.path): number for number, source in enumerate(roots)}
        rows = [row for row in self.reader.ledger.rows.values() if _is_of(row, roots)]
        rows.sort(key=lambda row: (order.get(row.place.file, 0), row.place.line, row.place.column))
        files = tuple(
            PurePath(source.file.path).name for source in [self._source, *(r for r in roots if r is not self._source)]
        )
        return Report(self.name, files, tuple(notes), tuple(rows), tuple(self.reader.ledger.defaults))

    def _note_rest(self, leaf: Node, references: References, root: Node) -> None:
        """Record the outcome of a scalar that no part of the import has read."""
        ledger, path = self.reader.ledger, leaf.path
        if path in references.targets:
            ledger.mapped(leaf, "", f"the value of {key_of(references.targets[path])}", "a reference, resolved")
            return
        user = next((references.users[path[:n]] for n in range(len(path) + 1) if path[:n] in references.users), None)
        if user is not None:
            ledger.mapped(leaf, "", f"used by {key_of(user)}", "through a reference")
        elif leaf.value.data is None:
            ledger.ignored(leaf, "null counts as absent")
        elif leaf.value.data in ((), {}):
            ledger.ignored(leaf, "empty")
        elif (used := root.value.get(*path)) is None or used.place.file != leaf.place.file:
            ledger.ignored(leaf, "another file overrides this key: a configuration overrides common settings")
        else:
            ledger.ignored(leaf, "not a key of the collector")


def _is_of(row: Row, roots: Sequence[_Source]) -> bool:
    return any(row.place.file == yaml_reader.printable(source.file.path) for source in roots)


def _is_oscar(root: Value) -> bool:
    """Return whether a configuration has OSCAR's form."""
    if "actors" in root.map or "context" in root.map:
        return True
    spawned = root.map.get("spawn_actors")
    items = spawned.data if spawned is not None and isinstance(spawned.data, tuple) else ()
    return any("_target_" in item.map for item in items)


def _note_of_shift(scene: Scene, specs: Sequence[Spec]) -> list[str]:
    """Return a note on how positions are moved; none if they are not."""
    if scene.vector == (0.0, 0.0) or not specs:
        return []
    x, y = scene.vector
    return [
        "positions in CARLA's towns have no meaning in this town. CARLA is left-handed: y, yaw and pitch change"
        f" sign; then everything is moved by x {x:g}, y {y:g}, which keeps relative positions"
    ]
