"""Sorts files into configurations, weathers and common settings, and imports each configuration."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from recipe_compiler.carla import actors, sensors, weather
from recipe_compiler.carla.configuration import Reader, References, resolve
from recipe_compiler.carla.draft import Data, Draft, name_for, text_of
from recipe_compiler.carla.forms import collector, oscar
from recipe_compiler.carla.forms.specs import Spec, unread_classes
from recipe_compiler.carla.placement import Site
from recipe_compiler.carla.report import Default, Node, Report, Row, key_of
from recipe_compiler.carla.scene import Scene
from recipe_compiler.carla.settings import COLLECTOR, OSCAR, Form, SettingsReader
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.plurals import count
from recipe_compiler.library.weather import PARAMETERS
from recipe_compiler.source import yaml_reader
from recipe_compiler.source.merge import Merger
from recipe_compiler.source.yaml_reader import Value

MAX_FILES = 200
MAX_REPORTED = 100_000  # values in the reports of all configurations together
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
        """Its name without folder and ending."""
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
class _Sorted:
    """Files by what they hold."""

    configurations: list[_Source] = field(default_factory=list)
    weathers: list[tuple[_Source, tuple[str, ...]]] = field(default_factory=list)  # with the path of the parameters
    settings: list[_Source] = field(default_factory=list)


def imported(files: Sequence[File], *, town: str | None = None) -> tuple[Imported, ...]:
    """Import configurations.

    Args:
        files: configurations (with actors), weathers (with weather parameters only), and settings that all
            configurations share (any other keys). Several weathers become an axis of each recipe.
        town: the town of the library to use; None: the one most like the configuration's.

    Returns:
        One recipe for each configuration, in the order of the files.

    Raises:
        InputError: with every mistake of the files; each has its place and a remedy.
    """
    problems: list[Problem] = []
    lines: dict[str, list[str]] = {}
    sorted_files = _sort(_read(files, problems, lines), problems)
    problems += _excess(sorted_files)
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


def _excess(files: _Sorted) -> list[Problem]:
    """The problem if the reports would have too many values: shared files are reported with each configuration."""
    shared = sum(_values(source) for source in (*files.settings, *(source for source, _ in files.weathers)))
    total = sum(_values(source) + shared for source in files.configurations)
    if total <= MAX_REPORTED:
        return []
    message = f"the configurations have {total:,} values, those of shared files counted with each of them"
    remedy = f"import fewer files at once: at most {MAX_REPORTED:,} values"
    return [Problem(message, files.configurations[0].root.place, remedy, Code.INPUT_LIMIT)]


def _values(source: _Source) -> int:
    """The number of values of a file."""
    return sum(1 for _ in Node.root(source.root).leaves())


def _order(problem: Problem) -> tuple[Place, str]:
    return problem.place or Place("", 0, 0), problem.message


def _read(files: Sequence[File], problems: list[Problem], lines: dict[str, list[str]]) -> list[_Source]:
    if len(files) > MAX_FILES:
        raise InputError(f"{count(len(files), 'file')}; import at most {MAX_FILES} at once", code=Code.INPUT_LIMIT)
    found: list[_Source] = []
    values = 0
    for file in files:
        shown = yaml_reader.printable(file.path)
        start = Place(shown, 1, 1)
        if len(file.content) > yaml_reader.MAX_BYTES:
            message = f"the file is larger than {yaml_reader.MAX_BYTES:,} bytes"
            problems.append(
                Problem(message, start, "is this a configuration? if so, make it smaller", Code.INPUT_LIMIT)
            )
            continue
        lines[shown] = yaml_reader.lines(file.content)
        root, wrong = yaml_reader.parse(file.content, shown)
        wrong = [_of_empty(start) if each.code is Code.EMPTY_FILE else each for each in wrong]
        problems += wrong
        if root is not None and not isinstance(root.data, dict):
            message = "a configuration is a map of keys and values, and this is not"
            problems.append(
                Problem(message, root.place, "is this a configuration of CARLA's collector?", Code.INVALID_VALUE)
            )
        elif root is not None and not wrong:
            found.append(_Source(file, _of_group(root)))
            values += _values(found[-1])
        if values > MAX_REPORTED:
            message = f"{values:,} values up to here, and {MAX_REPORTED:,} is the limit of all files together"
            problems.append(Problem(message, start, "import fewer files at once", Code.INPUT_LIMIT))
            break
    return found


def _of_group(root: Value) -> Value:
    """A file of OSCAR's group `context`, below that key; other files as they are."""
    if not set(root.map) <= _CONTEXT or not set(root.map) & (_CONTEXT - {"_target_", "weather_params"}):
        return root
    return Value({"context": root}, root.place, {"context": root.place})


def _has_actors(root: Value) -> bool:
    """Whether a file is a configuration: one that spawns something, or that is not a map or a list there."""
    given = [root.map[key].data for key in _ACTORS if key in root.map]
    return any(data != {} and not (isinstance(data, str) and data.startswith("${oc.dict.values:")) for data in given)


def _of_empty(start: Place) -> Problem:
    return Problem("the file is empty", start, "name a configuration of CARLA's data collector", Code.EMPTY_FILE)


def _sort(sources: Iterable[_Source], problems: list[Problem]) -> _Sorted:
    """Sort files by their keys: actors make a configuration, weather parameters alone a weather."""
    found = _Sorted()
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
            remedy = "name the main configuration too"
            problems.append(Problem(message, source.root.place, remedy, Code.MISSING_KEY))
    return found


def _weather_path(root: Value) -> tuple[str, ...] | None:
    """The path of the weather parameters in a file that holds nothing else; None if it holds something else."""
    for path in _WEATHER_PATHS:
        here = root.get(*path)
        outer = [root.get(*path[:depth]) for depth in range(len(path))]
        alone = all(len([k for k in each.map if k != "_target_"]) == 1 for each in outer if each is not None)
        if here is None or not alone or not isinstance(here.data, dict):
            continue
        if path or (here.map and set(here.map) <= {*PARAMETERS, "_target_"}):
            return path
    return None


class _Import:
    """The import of one configuration."""

    def __init__(self, source: _Source, files: _Sorted, taken: Sequence[str], problems: list[Problem]) -> None:
        self._source, self._files, self._problems = source, files, problems
        self.reader = Reader()
        self.draft = Draft()
        self.name = name_for(source.file.stem, taken, "imported")

    def run(self, town: str | None) -> Imported | None:
        """The recipe and its report; None, with problems, if the configuration is wrong."""
        merger, merged = Merger(), Value({}, self._source.root.place)
        for each in [*self._files.settings, self._source]:
            merged = merger.merge(merged, each.root)
        merged = Value(merged.data, self._source.root.place, merged.keys)
        root, references = resolve(merged)
        self.reader.problems += references.problems
        node = Node.root(root)
        form = OSCAR if _is_oscar(root) else COLLECTOR
        self.draft.set("recipe", self.name)
        self.draft.set("description", f"Imported from {self._source.file.stem}, a configuration of {form.name}.")
        notes = self._fill(node, form, references, town)
        self._problems += self.reader.problems
        if notes is None or self.reader.problems:
            return None
        self.draft.finish()
        report = self._report(references, notes, node)
        return Imported(self.name, text_of(self.draft, report), report)

    def _fill(self, node: Node, form: Form, references: References, town: str | None) -> list[str] | None:
        """Write all parts of the recipe; the notes of the report, None if the settings are wrong."""
        settings_reader = SettingsReader(self.reader, node, form, self.draft)
        settings = settings_reader.read(town)
        self._write_weather(node, form)
        specs = oscar.read(self.reader, node) if form is OSCAR else collector.read(self.reader, node)
        if not any(spec.kind == "sensor" for spec in specs) and not self.reader.problems:
            place = node.get("spawn_actors") or node.get("actors") or node
            remedy = "add a sensor, such as sensor.camera.rgb"
            self.reader.refuse(place, "it has no camera, and so no pictures", remedy, Code.MISSING_KEY)
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
        return [*settings_reader.notes, *_note_of_shift(scene, specs)]

    def _put_sensors_last(self) -> None:
        base = self.draft.data["base"]
        assert isinstance(base, dict)
        order = ("clock", "town", "weather", "actors", "traffic", "patches", "sensors")
        self.draft.data["base"] = {key: base[key] for key in order if key in base}

    def _write_weather(self, node: Node, form: Form) -> None:
        """Write the weather of the configuration, and the axis of the weather files."""
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
        """The report, with an entry for each leaf of each file."""
        roots = [*self._files.settings, self._source, *(source for source, _ in self._files.weathers)]
        for source in roots:
            whole = Node.root(source.root)
            for child in unread_classes(whole):
                self.reader.ledger.ignored(child, "names a class: its keys say the same")
            for leaf in whole.leaves():
                if not self.reader.ledger.has(leaf):
                    self._note_rest(leaf, references, root)
        order = {yaml_reader.printable(source.file.path): number for number, source in enumerate(roots)}
        rows = [row for row in self.reader.ledger.rows.values() if _is_of(row, roots)]
        rows.sort(key=lambda row: (order.get(row.place.file, 0), row.place.line, row.place.column))
        files = tuple(
            PurePath(source.file.path).name for source in [self._source, *(r for r in roots if r is not self._source)]
        )
        return Report(self.name, files, tuple(notes), tuple(rows), tuple(_once(self.reader.ledger.defaults)))

    def _note_rest(self, leaf: Node, references: References, root: Node) -> None:
        """Note a leaf that nothing has read."""
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
            ledger.ignored(leaf, "another file sets this key, and a configuration comes before common settings")
        else:
            ledger.ignored(leaf, "not a key of the collector")


def _is_of(row: Row, roots: Sequence[_Source]) -> bool:
    return any(row.place.file == yaml_reader.printable(source.file.path) for source in roots)


def _once(defaults: Iterable[Default]) -> list[Default]:
    return list(dict.fromkeys(defaults))


def _is_oscar(root: Value) -> bool:
    """Whether a configuration has OSCAR's form."""
    if "actors" in root.map or "context" in root.map:
        return True
    spawned = root.map.get("spawn_actors")
    items = spawned.data if spawned is not None and isinstance(spawned.data, tuple) else ()
    return any("_target_" in item.map for item in items)


def _note_of_shift(scene: Scene, specs: Sequence[Spec]) -> list[str]:
    """How the positions of the configuration are treated."""
    if scene.vector == (0.0, 0.0) or not specs:
        return []
    x, y = scene.vector
    return [
        "positions of CARLA's towns mean nothing in this town. CARLA is left-handed: y, yaw and pitch change"
        f" their signs; then everything is moved by x {x:g}, y {y:g}, so that positions lie to each other as before"
    ]
