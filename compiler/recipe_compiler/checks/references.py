"""Checks that names in a recipe exist: presets, towns and their parameters, blueprints, actors, dates.

The merged values are checked even if the rest of a section is invalid, so that one run reports every mistake.
"""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TypeGuard

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.library import blueprints, towns, weather
from recipe_compiler.schema import remedies
from recipe_compiler.schema.fields import BLUEPRINT, NAME_LENGTH
from recipe_compiler.schema.messages import Suggestions, near, nearest
from recipe_compiler.schema.scene import Town
from recipe_compiler.schema.tick import MAX_TICK, nearest_ticks
from recipe_compiler.source.yaml_reader import Value, show

Check = tuple[Callable[[Value], Iterator[Problem]], tuple[str, ...]]
"""A check, and the sections of the base that it reads."""


def unknown_preset(base: Value) -> Iterator[Problem]:
    """Report an unknown weather preset."""
    name = _text(base, "weather", "preset")
    if name is not None and name not in weather.PRESETS:
        message, place = f"weather: unknown preset {show(name)}", base.place_of("weather", "preset")
        yield Problem(message, place, remedies.of_text(name) or nearest(name, weather.PRESETS), Code.UNKNOWN_NAME)


def unknown_town(base: Value) -> Iterator[Problem]:
    """Report an unknown town, and unknown or invalid parameters of a town."""
    name, spec = _text(base, "town", "name"), base.get("town")
    if name is None or spec is None:
        return
    if name not in towns.NAMES:
        message, place = f"town: unknown town {show(name)}", base.place_of("town", "name")
        yield Problem(message, place, remedies.of_text(name) or nearest(name, towns.NAMES), Code.UNKNOWN_NAME)
        return
    declared = towns.TOWNS[name].PARAMETERS
    for key, value in spec.map.items():
        if key in Town.model_fields:
            continue
        if key not in declared:
            others = [town for town in towns.NAMES if key in towns.TOWNS[town].PARAMETERS]
            remedy = nearest(key, [*Town.model_fields, *declared])
            if others:
                remedy = f"remove it: it is a parameter of {' and '.join(others)}"
            yield Problem(f"unknown key {show(key)} in town", spec.key_place(key), remedy, Code.UNKNOWN_KEY)
            continue
        try:
            declared[key].check(key, value.plain)
        except ValueError:
            limit = declared[key]
            plain = value.plain
            given = json.dumps(plain) if isinstance(plain, list) and len(json.dumps(plain)) <= 60 else show(plain)
            wanted = f"{limit.wanted} ({limit.description}), not {'nothing' if plain is None else given}"
            remedy = f"write {json.dumps(limit.default)}, the default, or remove the key"
            yield Problem(f"town.{key}: must be {wanted}", base.place_of("town", key), remedy, Code.OUT_OF_RANGE)


def unknown_blueprints(own: Sequence[str]) -> tuple[Check, ...]:
    """Return checks that ids and glob patterns of blueprints match one of the library or of `own`, ids of the recipe's.

    They read the actors, and the mix of the traffic.
    """

    def unknown(glob: str) -> bool:
        known = blueprints.match(glob) if re.search(BLUEPRINT, glob) and len(glob) <= NAME_LENGTH else True
        return not known and not any(fnmatchcase(name, glob) for name in own)

    def unknown_blueprint(base: Value) -> Iterator[Problem]:
        actors = base.get("actors")
        for name in actors.map if actors else ():
            glob = _text(base, "actors", name, "blueprint")
            if glob is not None and unknown(glob):
                message = f"actors.{name}.blueprint: {show(glob)} matches no blueprint"
                place = base.place_of("actors", name, "blueprint")
                yield Problem(message, place, blueprint_remedy(glob, own), Code.UNKNOWN_NAME)

    def unknown_mix(base: Value) -> Iterator[Problem]:
        mix = base.get("traffic", "mix")
        for glob in mix.map if mix is not None else ():
            if unknown(glob):
                message, place = f"traffic.mix: {show(glob)} matches no blueprint", mix.key_place(glob) if mix else None
                yield Problem(message, place, blueprint_remedy(glob, own), Code.UNKNOWN_NAME)

    return (unknown_blueprint, ("actors",)), (unknown_mix, ("traffic",))


def blueprint_remedy(glob: str, own: Sequence[str] = ()) -> str:
    """Return the remedy for an unknown blueprint: the nearest id, or the list of families.

    `own` are the ids of the recipe's blueprints.
    """
    names = [*blueprints.names(), *own]
    families = [name for name in names if name.endswith(".*")]
    family = next((name for name in families if f".{name}".endswith((f".{glob}.*", f".{glob}"))), None)
    head, _, number = glob.rpartition(".")
    padded = f"{head}.{number:0>4}"  # pedestrians have numbers of four digits
    close = family or (padded if number.isdigit() and padded in names else near(glob, names))
    if close is not None:
        return f"did you mean {show(close)}?"
    return f"valid are {', '.join(families)}, and the ids that `recipe blueprints` lists"


def unknown_carrier(base: Value) -> Iterator[Problem]:
    """Report sensors that are mounted on, or follow, an actor that the variant does not have."""
    actors, sensors = base.get("actors"), base.get("sensors")
    names = list(actors.map) if actors else []
    many = base.get("traffic", "density") is not None
    for kind, key in (("vehicle", "vehicles"), ("pedestrian", "pedestrians"), ("parked", "parked")):
        number = base.get("traffic", key)
        if number is not None and isinstance(number.data, int):
            names += [f"traffic.{kind}.{index}" for index in range(min(number.data, 1000))]
    known, suggestions = set(names), Suggestions(names)
    for name in sensors.map if sensors else ():
        for keys, does in ((("mount", "on"), "is mounted on"), (("motion", "follow", "actor"), "follows")):
            on, where = _text(base, "sensors", name, *keys), f"sensors.{name}.{'.'.join(keys)}"
            if on is None or on in known:
                continue
            removed = _removal(base, "actors", on)
            if removed is not None:
                message = f"the actor {show(on)} is removed here, but sensors.{name} {does} it"
                yield Problem(message, removed, "remove or remount the sensor too", Code.CONFLICT)
            elif not (many and re.fullmatch(r"traffic\.(vehicle|pedestrian)\.[0-9]{1,3}", on)):
                # With a density, whether there are so many is known when the town is.
                place = base.place_of("sensors", name, *keys)
                yield Problem(
                    f"{where}: there is no actor {show(on)}", place, suggestions.nearest(on), Code.UNKNOWN_NAME
                )


def unknown_sensor(base: Value) -> Iterator[Problem]:
    """Traffic near a sensor that the variant does not have."""
    near_sensor, sensors = _text(base, "traffic", "near"), base.get("sensors")
    if near_sensor is None or sensors is None or near_sensor in sensors.map:
        return
    if (removed := _removal(base, "sensors", near_sensor)) is not None:
        message = f"the sensor {show(near_sensor)} is removed here, but traffic.near names it"
        yield Problem(message, removed, "change or remove traffic.near too", Code.CONFLICT)
    else:
        message, place = f"traffic.near: there is no sensor {show(near_sensor)}", base.place_of("traffic", "near")
        yield Problem(message, place, nearest(near_sensor, list(sensors.map)), Code.UNKNOWN_NAME)


def uneven_tick(base: Value) -> Iterator[Problem]:
    """Report sensors whose tick is not a multiple of the frame interval."""
    rate, sensors = base.get("clock", "fps"), base.get("sensors")
    fps = rate.data if rate is not None else None
    for name in sensors.map if sensors else ():
        value = base.get("sensors", name, "tick")
        tick = value.data if value is not None else None
        if not _is_number(tick) or not _is_number(fps) or not 0 < fps <= 1000 or not 0 <= tick <= MAX_TICK:
            continue  # reported as a value out of range
        valid = nearest_ticks(tick, int(fps))
        if valid:
            message = f"sensors.{name}.tick: {tick:g} s is not a multiple of the frame interval, 1/{fps} s"
            several = ", the nearest that are" if len(valid) > 1 else ", the nearest that is"
            remedy = f"write {' or '.join(f'{tick:.6f}'.rstrip('0') for tick in valid)}{several}"
            yield Problem(message, base.place_of("sensors", name, "tick"), remedy, Code.OUT_OF_RANGE)


def _removal(base: Value, section: str, name: str) -> Place | None:
    """Return the place where a delta removes an entry of a section, or the whole section."""
    entries = base.get(section)
    if entries is None:
        return base.keys.get(section)
    return entries.keys.get(name) if name not in entries.map else None


def names_alike(base: Value) -> Iterator[Problem]:
    """Report names that differ in case only: they become folders, and some file systems ignore case."""
    for section in ("actors", "props", "patches", "sensors"):
        entries = base.get(section)
        if entries is not None:
            yield from alike(entries, section)


def alike(entries: Value, where: str) -> Iterator[Problem]:
    """Report keys of a map that differ in case only, at the later key."""
    seen: dict[str, str] = {}
    for name in entries.map:
        first = seen.setdefault(name.lower(), name)
        if first != name:
            message = f"{where}: {show(name)} and {show(first)} differ in case only, which some disks take for one name"
            yield Problem(message, entries.key_place(name), "rename one", Code.INVALID_NAME)


def unknown_day(base: Value) -> Iterator[Problem]:
    """Report a date that does not exist."""
    date = _text(base, "place", "date")
    if date is None or not re.match(r"[0-9]{4}-[0-9]{2}-[0-9]{2}\Z", date):
        return
    try:
        datetime.date.fromisoformat(date)
    except ValueError:
        message, place = f"place.date: {show(date)} does not exist", base.place_of("place", "date")
        yield Problem(message, place, "write an existing date", Code.INVALID_VALUE)


def unknown_asset(assets: Mapping[str, str]) -> Check:
    """Return a check that props use existing assets of the right kind; `assets`: name -> mesh or image."""

    def wrong_asset(base: Value) -> Iterator[Problem]:
        props, suggestions = base.get("props"), dict[str, Suggestions]()
        for name in props.map if props else ():
            for key, kind in (("asset", "mesh"), ("image", "image")):
                asset = _text(base, "props", name, key)
                if asset is None or assets.get(asset) == kind:
                    continue
                fitting = [n for n, k in assets.items() if k == kind]
                article = "an" if kind == "image" else "a"
                known = (
                    f"is of kind {assets.get(asset)}, not {article} {kind}" if asset in assets else "is not an asset"
                )
                message, place = f"props.{name}.{key}: {show(asset)} {known}", base.place_of("props", name, key)
                known_names = suggestions.setdefault(kind, Suggestions(fitting))
                remedy = known_names.nearest(asset) if fitting else f"name {article} {kind} file in `assets`"
                yield Problem(message, place, remedy, Code.UNKNOWN_NAME)

    return wrong_asset, ("props",)


CHECKS: tuple[Check, ...] = (
    (unknown_preset, ("weather",)),
    (unknown_town, ("town",)),
    (unknown_carrier, ("actors", "traffic", "sensors")),
    (unknown_sensor, ("traffic", "sensors")),
    (uneven_tick, ("clock", "sensors")),
    (unknown_day, ("place",)),
    (names_alike, ("actors", "props", "patches", "sensors")),
)
"""Each check with the sections that it looks at."""


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _text(base: Value, *path: str) -> str | None:
    value = base.get(*path)
    return value.data if value is not None and isinstance(value.data, str) else None
