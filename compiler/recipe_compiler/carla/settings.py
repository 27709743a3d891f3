"""Reads the settings of a configuration: clock, seed and town, and the client's keys, which are ignored."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.carla.catalogue import towns
from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Draft
from recipe_compiler.carla.options import Options
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code
from recipe_compiler.library.towns import NAMES
from recipe_compiler.schema.fields import MAX_FRAMES, MAX_SEED

Keys = tuple[str, ...]  # a path of keys

_FRAMES = 300  # if max_frames is absent, without which the collector records until it is stopped
_PHYSICS_RATE = 240  # steps per second, the language's default
_MAX_RATE = 1000  # steps per second, the language's limit
_SERVER = dict.fromkeys(
    ("host", "port", "timeout", "retry", "traffic_manager_port"),
    "no server: the recipe is simulated in the process that builds it",
) | {"respawn": "vehicles never become dormant here"}
_SYNC = {"timeout": "no queues: every sensor has a picture of every frame"}
_RUN = {
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
    """The settings that the other parts of an import use, and a note on the town for the report."""

    seed: int
    fps: int
    town: str
    note: str


def read(reader: Reader, root: Node, form: Form, draft: Draft, options: Options) -> Settings | None:
    """Read the settings into a draft.

    Args:
        reader: collects problems and outcomes.
        root: the configuration.
        form: its form.
        draft: the recipe.
        options: what is chosen for the import.

    Returns:
        The settings; None, with problems, if they are invalid.
    """
    node = root.get(*form.client, "seed")
    seed = reader.integer(node, 0, MAX_SEED)
    seed = form.seed if seed is None else seed
    reader.ledger.record(node, "seed", seed, "", f"no seed is given: the documented default of {form.name}")
    steps, fps = _rate(reader, root, form)
    frames = _frames(reader, root.get("max_frames"), options.frames)
    name, note = _town(reader, root.get(*form.simulation, "townmap"), options.town)
    for path, keys in ((form.client, _SERVER), (form.simulation, _SERVER), (form.sync, _SYNC), ((), _RUN)):
        for key, why in keys.items():
            reader.ledger.ignored(root.get(*path, key), why)
    if fps is None or frames is None or not name:
        return None
    draft.set("seed", seed)
    derived = _physics_and_warmup(reader, root.get(*form.simulation, "warmup"), form, steps, fps)
    draft.set("base.clock", {"fps": fps, "frames": frames, **derived})
    draft.set("base.town", name)
    return Settings(seed, fps, name, note)


def _frames(reader: Reader, node: Node | None, chosen: int | None) -> int | None:
    """Return the number of frames; None, with a problem, if it is invalid."""
    why = "" if chosen is None else "the number of frames chosen in the command"
    frames = chosen or (_FRAMES if node is None else reader.integer(node, 1, MAX_FRAMES))
    absent = why or "no max_frames is given: the collector records until it is stopped"
    reader.ledger.record(node, "base.clock.frames", frames, why, absent)
    return frames


def _physics_and_warmup(reader: Reader, node: Node | None, form: Form, steps: float, fps: int) -> dict[str, float]:
    """Return the physics rate, if the default is no multiple of the frame rate, and the warm-up, which `node` sets."""
    clock: dict[str, float] = {}
    if _PHYSICS_RATE % fps:
        clock["physics"] = fps * -(-_PHYSICS_RATE // fps)
        why = f"the smallest multiple of {fps} frames per second that is not below {_PHYSICS_RATE}"
        reader.ledger.default("base.clock.physics", clock["physics"], why)
    if form.warmup is not None:
        given = reader.integer(node, 0, 600_000)
        clock["warmup"] = seconds = (form.warmup if given is None else given) / steps
        if seconds > 600.0 and node is not None:
            reader.reject(node, f"{seconds:g} s are out of range", "write at most 600 s", Code.OUT_OF_RANGE)
        absent = f"no warm-up is given: OSCAR's default is {form.warmup} steps"
        why = f"steps at {steps:g} per second, in seconds"
        reader.ledger.record(node, "base.clock.warmup", seconds, why, absent)
    return clock


def _rate(reader: Reader, root: Node, form: Form) -> tuple[float, int | None]:
    """Return the collector's steps per second, and the recipe's frames per second; None if they are invalid."""
    found = [node for key in form.rate if (node := root.get(*key.split("."))) is not None]
    if not found:
        absent = "no frame rate is given: the collector records 30 frames per second"
        reader.ledger.default("base.clock.fps", 30, absent)
        return 30.0, 30
    node, *others = found
    for other in others:
        reader.ledger.ignored(other, f"the collector reads {node.key} instead")
    steps = reader.number(node, 1e-3, float(_MAX_RATE))
    if steps is None:
        return 30.0, None
    interval_node = root.get(*form.simulation, "interval") if form is OSCAR else None
    interval = reader.integer(interval_node, 1, 1_000_000) or 1
    rate = steps / interval
    if rate != int(rate) or rate < 1:
        each = f" at one picture in {interval} steps" if interval_node is not None else ""
        message = f"{steps:g} steps per second{each} is {rate:g} frames per second"
        reader.reject(node, message, "choose a whole number of frames per second, 1 to 1000")
        return steps, None
    why = f"one picture in {interval} steps of {steps:g} per second"
    reader.ledger.record(interval_node, "base.clock.fps", int(rate), why)
    why = "divided by the interval" if interval > 1 else ""
    if node.key == "carla.sync.fps":
        why = "the collector reads carla.fps instead and records 30 frames per second; the import uses this key"
    reader.ledger.record(node, "base.clock.fps", int(rate), why)
    return steps, int(rate)


def _town(reader: Reader, node: Node | None, chosen: str | None) -> tuple[str, str]:
    """Return the town of the library and a note; empty, with a problem, if CARLA has no such town."""
    wanted = reader.text(node) or towns.DEFAULT
    name, why = chosen, "the town chosen in the command"
    if chosen is None:
        match = towns.closest_match(wanted)
        if match is None and node is not None:
            remedy = f"write one of {', '.join(towns.NAMES)}, or choose one of {', '.join(NAMES)} in the command"
            reader.reject(node, f"CARLA has no town {wanted[:60]!r}", remedy, Code.UNKNOWN_NAME)
        name, words = match or ("", "")
        why = f"the town most similar to {wanted}, {words}"
    assert name is not None
    reader.ledger.record(node, "base.town", name, why, f"no town is given; {why}")
    short = wanted.rsplit("/", 1)[-1]
    return name, f"CARLA's {short} becomes {name}, a different town with other streets, buildings and terrain"
