"""Reads expanded plans from untrusted files, with limits on size before anything is stored.

Parts that are equal in several variants become one object, as in a compiled plan, so they are checked and hashed once.
Compiled plans are compared with the same limits before they are built (`check_readable`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from recipe_compiler.ir.canonical import JsonValue, pretty
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import AppearancePlan, DatasetPlan, Looks, RigPlan, ScenarioPlan, ScenePlan, TownPlan
from recipe_compiler.ir.plan_types import MAX_BODIES, MAX_ELEMENTS, Name, Slots

from recipe_runtime.dataset.json_stream import loads
from recipe_runtime.dataset.limits import MAX_POSES, MAX_ROWS, check_bounds
from recipe_runtime.dataset.manifest_reader import first_error

T = TypeVar("T")

MAX_BYTES = 1 << 28  # of all plans of a dataset
MAX_PLAN_BYTES = 1 << 26  # of one plan
_MAX_VALUES = 2_600_000  # of one plan: 300,000 poses and a town
_OBJECTS = "objects of towns, scenes, rigs and appearances"  # of JSON, which may omit each field that has a default
_SLOTS_OF_LOOKS = "slots of distinct colours"
_SENSORS = "sensors of variants"  # each has labels and a picture of frame 0
_MAX_NUMBERS = {"poses of sensors": MAX_POSES, "points of routes": 300_000, "elements of towns": 20 * MAX_ELEMENTS,
         "colours of bodies": 40 * MAX_BODIES, _SLOTS_OF_LOOKS: 2_000_000, _SENSORS: MAX_ROWS // 2,
         _OBJECTS: 1_000_000}  # fmt: skip
_WITH_OBJECTS = {"town": 2, "scene": 1, "rig": 1, "appearance": 1}  # counted parts: objects around each in `_parts`
_REMEDY = "split the recipe into several"
_FRAMING = 200  # bytes of a plan, at most, between its parts
_SLOTS, _NAME = TypeAdapter(Slots), TypeAdapter(Name)


def check_readable(dataset: DatasetPlan) -> None:
    """Check that the plans of a dataset, once written, can be read again, and its lockfile with them.

    Raises:
        InputError: a number in them is out of its bounds, or together they are larger than any that are read.
    """
    check_bounds(dataset)
    scenes = {v.scene.digest: v.scene for v in dataset.variants}.values()
    towns = {scene.town.digest: scene.town for scene in scenes}.values()
    looks = {v.appearance.looks.digest: v.appearance.looks for v in dataset.variants}.values()
    numbers = {
        _SENSORS: sum(len(variant.rig.sensors) for variant in dataset.variants),
        "points of routes": sum(len(actor.route) for scene in scenes for actor in scene.actors),
        "elements of towns": sum(len(town.elements) for town in towns),
        "colours of bodies": sum(len(look.root) for look in looks),
        _SLOTS_OF_LOOKS: sum(map(len, _distinct(slots for look in looks for slots in look.root.values()))),
    }
    for what, number in numbers.items():
        _check_number(what, number)
    sizes, total, objects = dict[str, int](), 0, 0
    for variant in dataset.variants:
        size = _FRAMING + len(variant.variant.encode())
        for key, make in _parts(variant):
            if key not in sizes:
                text = pretty(make())
                sizes[key] = len(text.encode())
                around = _WITH_OBJECTS.get(key.partition(" ")[0])
                objects += text.count("{") - around if around is not None else 0
                _check_number(_OBJECTS, objects)
            size += sizes[key]
        total += size
        if size > MAX_PLAN_BYTES:
            raise InputError(f"the plan of {variant.variant} has over {MAX_PLAN_BYTES:,} bytes", help=_REMEDY)
        if total > MAX_BYTES:
            each = f"that of {variant.variant} has {size:,}"
            raise InputError(f"the plans have over {MAX_BYTES:,} bytes together; {each}", help=_REMEDY)


def _distinct(colours: Iterable[Mapping[str, object]]) -> Iterable[tuple[tuple[str, object], ...]]:
    """Return the distinct colours of bodies, as pairs of slot and colour."""
    return dict.fromkeys(tuple(sorted(slots.items())) for slots in colours)


def _check_number(what: str, number: int) -> None:
    if number > _MAX_NUMBERS[what]:
        raise InputError(f"the plans have {number:,} {what}, over {_MAX_NUMBERS[what]:,}", help=_REMEDY)


def _parts(variant: ScenarioPlan) -> Iterator[tuple[str, Callable[[], JsonValue]]]:
    """Yield the parts of a plan that variants share: a key, and what returns the part in its place in the document."""
    scene, rig, appearance = variant.scene, variant.rig, variant.appearance
    yield f"town {scene.town.digest}", lambda: {"scene": {"town": scene.town.document()}}
    yield f"scene {scene.digest}", lambda: {"scene": scene.model_dump(mode="json", exclude={"town"})}
    yield f"rig {rig.digest}", lambda: {"rig": rig.document()}
    looks = appearance.looks
    yield f"looks {looks.digest}", lambda: {"appearance": {"looks": looks.model_dump(mode="json")}}
    rest = {"looks"}
    yield f"appearance {appearance.digest}", lambda: {"appearance": appearance.model_dump(mode="json", exclude=rest)}


class PlanReader:
    """Reads the plans of one dataset."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, bytes], Any] = {}
        self._slots: dict[tuple[tuple[object, object], ...], dict[str, str]] = {}
        self._numbers = dict.fromkeys(_MAX_NUMBERS, 0)
        self._bytes = 0

    def read(self, body: bytes) -> ScenarioPlan:
        """Return the plan in a file's content; ValueError with a one-line message if it is invalid or too large."""
        self._bytes += len(body)
        if len(body) > MAX_PLAN_BYTES:
            raise ValueError(f"a plan of more than {MAX_PLAN_BYTES:,} bytes is not read")
        if self._bytes > MAX_BYTES:
            raise ValueError(f"plans of together more than {MAX_BYTES:,} bytes are not read")
        try:
            return self._scenario(loads(body, _MAX_VALUES))
        except ValidationError as error:
            raise ValueError(first_error(error)) from None
        except (OverflowError, RecursionError) as error:
            raise ValueError(f"a number or a list is out of range: {error}") from None

    def _scenario(self, raw: object) -> ScenarioPlan:
        raw = dict(_object(raw, "a plan"))
        for key, read in (("scene", self._scene), ("rig", self._rig), ("appearance", self._appearance)):
            raw[key] = self._once(key, _object(raw.get(key), key), read)
        plan = ScenarioPlan.model_validate(raw)
        self._count(_SENSORS, len(plan.rig.sensors))  # each variant's are checked, also those that it shares
        return plan

    def _scene(self, raw: dict[str, object]) -> ScenePlan:
        actors = [actor for actor in _list(raw.get("actors")) if isinstance(actor, dict)]
        self._count("points of routes", sum(len(_list(actor.get("route"))) for actor in actors))
        self._count(_OBJECTS, _objects(raw, "town"))
        return ScenePlan.model_validate(
            {**raw, "town": self._once("town", _object(raw.get("town"), "town"), self._town)}
        )

    def _town(self, raw: dict[str, object]) -> TownPlan:
        self._count("elements of towns", len(_list(raw.get("elements"))))
        self._count(_OBJECTS, _objects(raw))
        return TownPlan.model_validate(raw)

    def _rig(self, raw: dict[str, object]) -> RigPlan:
        sensors = [sensor for sensor in _list(raw.get("sensors")) if isinstance(sensor, dict)]
        self._count("poses of sensors", sum(len(_list(sensor.get("poses"))) for sensor in sensors))
        self._count(_OBJECTS, _objects(raw))
        return RigPlan.model_validate(raw)

    def _appearance(self, raw: dict[str, object]) -> AppearancePlan:
        self._count(_OBJECTS, _objects(raw, "looks"))
        return AppearancePlan.model_validate(
            {**raw, "looks": self._once("looks", _object(raw.get("looks"), "looks"), self._looks)}
        )

    def _looks(self, raw: dict[str, object]) -> Looks:
        """Return colours; bodies with equal colours share one object."""
        self._count("colours of bodies", len(raw))
        if len(raw) > MAX_BODIES:
            raise ValueError(f"looks has more than {MAX_BODIES:,} bodies")
        return Looks.model_construct(root={_NAME.validate_python(name): self._colours(raw[name]) for name in raw})

    def _colours(self, raw: object) -> dict[str, str]:
        slots = _object(raw, "a look")
        key = tuple(slots.items())
        try:
            found = self._slots.get(key)
        except TypeError:  # a list or an object in place of a colour
            found = None
        if found is None:
            self._count(_SLOTS_OF_LOOKS, len(slots))
            found = self._slots[key] = _SLOTS.validate_python(slots)
        return found

    def _once(self, part: str, raw: dict[str, object], make: Callable[[dict[str, object]], T]) -> T:
        """Return the result of `make` for a part of a plan; the same object for equal parts."""
        key = part, hashlib.sha256(json.dumps(raw, sort_keys=True).encode()).digest()
        if key not in self._known:
            self._known[key] = make(raw)
        found: T = self._known[key]
        return found

    def _count(self, what: str, number: int) -> None:
        self._numbers[what] += number
        if self._numbers[what] > _MAX_NUMBERS[what]:
            raise ValueError(f"{self._numbers[what]:,} {what} are over {_MAX_NUMBERS[what]:,}")


def _objects(raw: Mapping[str, object], without: str = "") -> int:
    """Return the number of JSON objects in a part of a plan, except in one of its members."""
    return json.dumps({key: value for key, value in raw.items() if key != without}).count("{")


def _object(value: object, what: str) -> dict[str, object]:
    if not isinstance(value, dict):
        raise ValueError(f"{what} is not an object")
    return value


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else []
