"""Sorts files into configurations, weathers and common settings, and imports each configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath

from recipe_compiler.carla import actors, sensors, settings, weather
from recipe_compiler.carla.configuration import Reader, resolve
from recipe_compiler.carla.draft import Data, Draft, name_for, text_of
from recipe_compiler.carla.forms import collector, oscar
from recipe_compiler.carla.forms.specs import unread_classes
from recipe_compiler.carla.options import Options
from recipe_compiler.carla.placement import Site
from recipe_compiler.carla.report import Node, Path, Report, key_of
from recipe_compiler.carla.scene import Scene
from recipe_compiler.carla.settings import COLLECTOR, OSCAR, Form
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.source import yaml_reader
from recipe_compiler.source.merge import Merger
from recipe_compiler.source.yaml_reader import Value

_ACTORS = ("spawn_actors", "actors")
_CONTEXT = {"_target_", "client_params", "simulation_params", "sync_params", "weather_params"}
_WEATHER_PATHS: tuple[tuple[str, ...], ...] = (("weather",), ("context", "weather_params"), ("weather_params",), ())
_NAME_ONE = "name a configuration of CARLA's data collector"


@dataclass(frozen=True)
class File:
    """The bytes of a file, and its path for messages and reports."""

    path: str
    content: bytes


@dataclass(frozen=True)
class Imported:
    """A recipe and the report of its import."""

    name: str
    text: str
    report: Report


@dataclass(frozen=True)
class _Source:
    """A file that was read: its path, its name without folder and suffix, and its content."""

    path: str
    stem: str
    root: Value


@dataclass
class _Sources:
    """Files by their content."""

    configurations: list[_Source] = field(default_factory=list)
    weathers: list[tuple[_Source, Node]] = field(default_factory=list)  # with the map of the parameters
    settings: list[_Source] = field(default_factory=list)


def import_configurations(files: Sequence[File], options: Options | None = None) -> tuple[Imported, ...]:
    """Import configurations.

    Args:
        files: configurations (files with actors), weathers (files with only weather parameters), and settings that all
            configurations share (all other files). Weathers become an axis of each recipe.
        options: what is chosen for all configurations; None: nothing.

    Returns:
        One recipe for each configuration, in the order of the files.

    Raises:
        InputError: with all mistakes of the files, each with its place and a remedy.
    """
    problems: list[Problem] = []
    sources = _Sources()
    for file in files:
        _read(file, sources, problems)
    if not sources.configurations and not problems:
        others = [*sources.settings, *(source for source, _ in sources.weathers)]
        problems += [_no_configuration(source.root) for source in others[:1]]
    made: list[Imported] = []
    for source in sources.configurations if not problems else ():
        name = name_for(source.stem, [each.name for each in made], "imported")
        one = _Import(source, sources, name, options or Options())
        imported = one.run()
        problems += one.reader.problems
        made += [] if imported is None else [imported]
    if problems:
        error = InputError(sorted(set(problems), key=lambda each: (each.place or Place("", 0, 0), each.message)))
        error.with_source({yaml_reader.printable(file.path): yaml_reader.lines(file.content) for file in files})
        raise error
    return tuple(made)


def _read(file: File, sources: _Sources, problems: list[Problem]) -> None:
    """Read a file and sort it by its keys: with actors it is a configuration, with only parameters a weather."""
    shown = yaml_reader.printable(file.path)
    root, wrong = yaml_reader.parse(file.content, shown)
    if len(file.content) > yaml_reader.MAX_BYTES or (wrong and wrong[0].code is Code.EMPTY_FILE):
        wrong = [replace(wrong[0], help=_NAME_ONE)]  # instead of a remedy for recipes
    if root is not None and not isinstance(root.data, dict):
        message = "a configuration must be a map of keys and values"
        wrong.append(Problem(message, root.place, _NAME_ONE, Code.INVALID_VALUE))
    problems += wrong
    if root is None or wrong:
        return
    root = _in_context(root)
    source, parameters = _Source(shown, PurePath(file.path).stem, root), _weather(root)
    if _has_actors(root):
        sources.configurations.append(source)
    elif parameters is not None:
        sources.weathers.append((source, parameters))
    else:
        sources.settings.append(source)


def _no_configuration(root: Value) -> Problem:
    """Return the problem that no file is a configuration, at one that is not."""
    message = "no configuration: none of the files has spawn_actors or actors"
    is_recipe = {"recipe", "base"} <= set(root.map)
    remedy = "this is a recipe: build it as it is" if is_recipe else "name the main configuration as well"
    return Problem(message, root.place, remedy, Code.MISSING_KEY)


def _in_context(root: Value) -> Value:
    """Return a file of OSCAR's configuration group `context` below that key, and other files unchanged."""
    if not set(root.map) <= _CONTEXT or not set(root.map) & (_CONTEXT - {"_target_", "weather_params"}):
        return root
    return Value({"context": root}, root.place, {"context": root.place})


def _has_actors(root: Value) -> bool:
    """Return whether a file is a configuration: `spawn_actors` or `actors` is present and not an empty map."""
    given = [root.map[key].data for key in _ACTORS if key in root.map]
    return any(data != {} and not (isinstance(data, str) and data.startswith("${oc.dict.values:")) for data in given)


def _weather(root: Value) -> Node | None:
    """Return the map of weather parameters of a file that contains nothing else; None for other files."""
    for path in _WEATHER_PATHS:
        here = Node.root(root).get(*path)
        outer = [root.get(*path[:depth]) for depth in range(len(path))]
        alone = all(len([k for k in each.map if k != "_target_"]) == 1 for each in outer if each is not None)
        if here is None or not alone or not isinstance(here.value.data, dict):
            continue
        if path or (here.value.map and set(here.value.map) <= {*weather.COLLECTOR, "_target_"}):
            return here
    return None


@dataclass
class _Import:
    """The import of one configuration."""

    source: _Source
    sources: _Sources
    name: str
    options: Options
    reader: Reader = field(default_factory=Reader)
    draft: Draft = field(default_factory=Draft)

    def run(self) -> Imported | None:
        """Return the recipe and its report; None, with problems of the reader, if the configuration is invalid."""
        merger, merged = Merger(), Value({}, self.source.root.place)
        for each in [*self.sources.settings, self.source]:
            merged = merger.merge(merged, each.root)
        merged = Value(merged.data, self.source.root.place, merged.keys)
        root, references = resolve(merged, self.reader.problems)
        node = Node.root(root)
        form = OSCAR if _is_oscar(root) else COLLECTOR
        self.draft.set("recipe", self.name)
        stem = yaml_reader.printable(self.source.stem)
        self.draft.set("description", f"Imported from {stem}, a configuration of {form.name}.")
        notes = self._fill(node, form, references)
        if self.reader.problems:
            return None
        self.draft.finish()
        report = self._report(references, notes, node)
        return Imported(self.name, text_of(self.draft, report), report)

    def _fill(self, node: Node, form: Form, references: dict[Path, Path]) -> list[str]:
        """Write all parts of the recipe and return the notes of the report; or report problems."""
        found = settings.read(self.reader, node, form, self.draft, self.options)
        self._write_weather(node, form)
        specs = oscar.read(self.reader, node) if form is OSCAR else collector.read(self.reader, node)
        if not any(spec.kind == "sensor" for spec in specs) and not self.reader.problems:
            place = node.get("spawn_actors") or node.get("actors") or node
            remedy = "add a sensor, such as sensor.camera.rgb"
            self.reader.reject(place, "the configuration has no camera", remedy, Code.MISSING_KEY)
        if found is None:
            return []
        scene = Scene(self.reader, self.draft, found, specs, references, Site(found.town), self.options)
        scene.prepare()
        if self.reader.problems:
            return []
        actors.write(scene)
        sensors.write(scene)
        actors.write_crowds(scene)
        notes = [found.note, *scene.notes()]
        if scene.vector == (0.0, 0.0):
            return notes
        shift = (
            "positions in CARLA's towns have no meaning in this town. CARLA is left-handed: y, yaw and pitch change"
            f" sign; then everything is moved by x {scene.vector[0]:g}, y {scene.vector[1]:g}, which keeps relative"
            " positions"
        )
        return [*notes, shift]

    def _write_weather(self, node: Node, form: Form) -> None:
        """Write the weather of the configuration, and an axis with the weather files."""
        own = self.reader.map(node.get(*form.weather))
        defaults = weather.OSCAR if form is OSCAR and own is None else weather.COLLECTOR
        self.draft.set("base.weather", weather.read(self.reader, own, "base.weather", defaults))
        if not self.sources.weathers:
            return
        axis: dict[str, Data] = {}
        if own is not None:
            axis[name_for(self.source.stem, [], "own")] = {}
        for source, parameters in self.sources.weathers:
            value = name_for(source.stem, list(axis), "weather")
            axis[value] = {"weather": weather.read(self.reader, parameters, f"deltas.weather.{value}.weather")}
        self.draft.set("deltas.weather", axis)

    def _report(self, references: dict[Path, Path], notes: list[str], root: Node) -> Report:
        """Return the report, with an entry for each scalar of each file."""
        ledger = self.reader.ledger
        users = {target: path for path, target in reversed(references.items())}  # the first reference to a value
        sources = [*self.sources.settings, self.source, *(source for source, _ in self.sources.weathers)]
        for source in sources:
            for child in unread_classes(Node.root(source.root)):
                ledger.ignored(child, "a class name, which its keys imply")
            for leaf in Node.root(source.root).leaves():
                if not ledger.has(leaf):
                    self._note_rest(leaf, references, users, root)
        order = {source.path: number for number, source in enumerate(sources)}
        rows = sorted(ledger.rows.values(), key=lambda row: (order[row.place.file], row.place.line, row.place.column))
        files = dict.fromkeys(PurePath(source.path).name for source in [self.source, *sources])
        return Report(self.name, tuple(files), tuple(notes), tuple(rows), tuple(ledger.defaults))

    def _note_rest(self, leaf: Node, references: dict[Path, Path], users: dict[Path, Path], root: Node) -> None:
        """Record the outcome of a scalar that no part of the import has read."""
        ledger, path = self.reader.ledger, leaf.path
        if path in references:
            ledger.mapped(leaf, "", f"the value of {key_of(references[path])}", "a reference, resolved")
            return
        user = next((users[path[:n]] for n in range(len(path) + 1) if path[:n] in users), None)
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


def _is_oscar(root: Value) -> bool:
    """Return whether a configuration has OSCAR's form."""
    if "actors" in root.map or "context" in root.map:
        return True
    spawned = root.map.get("spawn_actors")
    items = spawned.data if spawned is not None and isinstance(spawned.data, tuple) else ()
    return any("_target_" in item.map for item in items)
