"""Reads the settings of a configuration: clock, seed and town, and the client's keys, which are ignored."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.carla.catalogue import towns
from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Draft
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.library.towns import NAMES
from recipe_compiler.schema.fields import MAX_FRAMES, MAX_SEED

Keys = tuple[str, ...]  # a path of keys

_PHYSICS_RATE = 240  # steps per second, the language's default
_MAX_RATE = 1000  # steps per second, the language's limit
_NO_SERVER = "no server: the recipe is simulated in the process that builds it"
_IGNORED = {
    "host": _NO_SERVER,
    "port": _NO_SERVER,
    "timeout": _NO_SERVER,
    "retry": _NO_SERVER,
    "traffic_manager_port": _NO_SERVER,
    "respawn": "vehicles never become dormant here",
    "sync.timeout": "no queues: every sensor has a picture of every frame",
}
_ELSEWHERE = {
    "output_dir": "the folder is chosen when the recipe is built",
    "defaults": "Hydra's composition is not executed: name the other files in the command",
    "hydra": "Hydra is not executed: it only sets folders and log files",
    "paths": "folders of a run: the output folder is chosen when the recipe is built",
}


@dataclass(frozen=True)
class Form:
    """A form of configurations: the paths of its settings and the collector's defaults."""

    name: str
    client: Keys  # of the map with the host
    simulation: Keys  # of the map with the town
    sync: Keys
    weather: Keys
    seed: int
    warmup: int | None  # steps; None: the form has no such key
    rate: Keys  # dotted paths of the frame rate; the first that is present is used


COLLECTOR = Form(
    name="CARLA's data collector",
    client=("carla",),
    simulation=("carla",),
    sync=("carla", "sync"),
    weather=("weather",),
    seed=42,
    warmup=None,
    rate=("carla.fps", "carla.sync.fps"),
)
OSCAR = Form(
    name="OSCAR's data collector",
    client=("context", "client_params"),
    simulation=("context", "simulation_params"),
    sync=("context", "sync_params"),
    weather=("context", "weather_params"),
    seed=30,
    warmup=50,
    rate=("context.sync_params.fps",),
)


@dataclass(frozen=True)
class Settings:
    """The settings that the other parts of an import use."""

    seed: int
    fps: int
    town: str


class SettingsReader:
    """Reads the settings of one configuration into a draft."""

    def __init__(self, reader: Reader, root: Node, form: Form, draft: Draft) -> None:
        self._reader, self._root, self._form, self._draft = reader, root, form, draft
        self._ledger = reader.ledger
        self.notes: list[str] = []

    def read(self, town: str | None) -> Settings | None:
        """Read the settings.

        Args:
            town: the town of the library to use; None: the one most similar to the configuration's.

        Returns:
            The settings; None, with problems, if they are invalid.
        """
        seed = self._seed()
        steps, fps = self._rate()
        frames = self._frames()
        name = self._town(town)
        if fps is None or frames is None or name is None:
            return None
        self._draft.set("seed", seed)
        physics = self._physics(fps)
        self._draft.set("base.clock", {"fps": fps, "frames": frames, **physics, **self._warmup(steps)})
        self._draft.set("base.town", name)
        self._note_ignored()
        return Settings(seed, fps, name)

    def _seed(self) -> int:
        node = self._root.get(*self._form.client, "seed")
        seed = self._reader.integer(node, 0, MAX_SEED)
        if node is None or seed is None:
            self._ledger.default(
                "seed", self._form.seed, f"no seed is given: the documented default of {self._form.name}"
            )
            return self._form.seed
        self._ledger.kept(node, "seed")
        return seed

    def _rate(self) -> tuple[float, int | None]:
        """Return the collector's steps per second, and the recipe's frames per second; None if they are invalid."""
        found = [node for key in self._form.rate if (node := self._root.get(*key.split("."))) is not None]
        if not found:
            why = "no frame rate is given: the collector records 30 frames per second"
            self._ledger.default("base.clock.fps", 30, why)
            return 30.0, 30
        node, *others = found
        for other in others:
            self._ledger.ignored(other, f"the collector reads {node.key} instead")
        steps = self._reader.number(node, 1e-3, float(_MAX_RATE))
        if steps is None:
            return 30.0, None
        interval_node = self._root.get(*self._form.simulation, "interval") if self._form.warmup is not None else None
        interval = self._reader.integer(interval_node, 1, 1_000_000)
        rate = steps / (interval or 1)
        if rate != int(rate) or rate < 1:
            each = f" at one picture in {interval} steps" if interval_node is not None else ""
            message = f"{steps:g} steps per second{each} is {rate:g} frames per second"
            self._reader.reject(node, message, "choose a whole number of frames per second, 1 to 1000")
            return steps, None
        if interval_node is not None:
            why = f"one picture in {interval} steps of {steps:g} per second"
            self._ledger.mapped(interval_node, "base.clock.fps", int(rate), why)
        if interval not in (None, 1):
            self._ledger.mapped(node, "base.clock.fps", int(rate), "divided by the interval")
        elif node.key == "carla.sync.fps":
            why = "the collector reads carla.fps instead and records 30 frames per second; the import uses this key"
            self._ledger.mapped(node, "base.clock.fps", int(rate), why)
        else:
            self._ledger.kept(node, "base.clock.fps")
        return steps, int(rate)

    def _physics(self, fps: int) -> dict[str, int]:
        """Return the physics rate, if the default is not a multiple of the frame rate."""
        if _PHYSICS_RATE % fps == 0:
            return {}
        physics = fps * -(-_PHYSICS_RATE // fps)
        why = f"the smallest multiple of {fps} frames per second that is not below {_PHYSICS_RATE}"
        self._ledger.default("base.clock.physics", physics, why)
        return {"physics": physics}

    def _frames(self) -> int | None:
        node = self._root.get("max_frames")
        if node is None:
            message = "max_frames is missing: the collector would record until it is stopped"
            self._reader.problems.append(
                Problem(message, self._root.place, "add a line such as `max_frames: 300`", Code.MISSING_KEY)
            )
            return None
        frames = self._reader.integer(node, 1, MAX_FRAMES)
        if frames is not None:
            self._ledger.kept(node, "base.clock.frames")
        return frames

    def _town(self, chosen: str | None) -> str | None:
        node = self._root.get(*self._form.simulation, "townmap")
        wanted = self._reader.text(node) or towns.DEFAULT
        match = towns.closest_match(wanted)
        if chosen is not None:
            name, why = chosen, "the town chosen in the command"
        elif match is None and node is not None:
            known = ", ".join(towns.NAMES)
            remedy = f"write one of {known}, or choose one of {', '.join(NAMES)} in the command"
            self._reader.reject(node, f"CARLA has no town {wanted[:60]!r}", remedy, Code.UNKNOWN_NAME)
            return None
        else:
            assert match is not None
            name, why = match[0], f"the town most similar to {wanted}, {match[1]}"
        if node is None:
            self._ledger.default("base.town", name, f"no town is given; {why}")
        else:
            self._ledger.mapped(node, "base.town", name, why)
        short = wanted.rsplit("/", 1)[-1]
        self.notes.append(f"CARLA's {short} becomes {name}, a different town with other streets, buildings and terrain")
        return name

    def _warmup(self, steps: float) -> dict[str, float]:
        if self._form.warmup is None:
            return {}
        node = self._root.get(*self._form.simulation, "warmup")
        given = self._reader.integer(node, 0, 600_000)
        seconds = (self._form.warmup if given is None else given) / steps
        if seconds > 600.0 and node is not None:
            self._reader.reject(node, f"{seconds:g} s are out of range", "write at most 600 s", Code.OUT_OF_RANGE)
        if node is None:
            why = f"no warm-up is given: OSCAR's default is {self._form.warmup} steps"
            self._ledger.default("base.clock.warmup", seconds, why)
        else:
            self._ledger.mapped(node, "base.clock.warmup", seconds, f"steps at {steps:g} per second, in seconds")
        return {"warmup": seconds}

    def _note_ignored(self) -> None:
        for key, why in _IGNORED.items():
            for parent in (self._form.client, self._form.simulation, self._form.sync[:-1], self._form.sync):
                node = self._root.get(*parent, *key.split("."))
                if node is not None and not self._ledger.has(node):
                    self._ledger.ignored(node, why if parent != self._form.sync else _IGNORED["sync.timeout"])
        for key, why in _ELSEWHERE.items():
            node = self._root.get(key)
            if node is not None:
                self._ledger.ignored(node, why)
