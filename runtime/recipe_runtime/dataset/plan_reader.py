"""Reads expanded plans from untrusted files.

A file is decoded into the form in which the compiler writes plans: every key, no other key, every value of its type.
Only then are the models of `recipe_compiler.ir.plan` made, which check ranges. Parts that are equal in several variants
become one object, as in a compiled plan, so they are checked and hashed once. Compiled plans are compared with the same
limits before they are built (`check_readable`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, cast, get_args, get_origin

import msgspec
from pydantic import BaseModel, RootModel, ValidationError
from recipe_compiler.ir.canonical import JsonValue, pretty
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import AppearancePlan, DatasetPlan, Looks, RigPlan, ScenarioPlan, ScenePlan, TownPlan

from recipe_runtime.core.documents import decode
from recipe_runtime.dataset.plan_checks import (
    MAX_BOXES,
    MAX_POINTS_IN_ALL,
    MAX_POSES,
    box_count,
    check_bounds,
    point_count,
    pose_count,
)

MAX_BYTES = 1 << 28  # of all plans of a dataset
MAX_PLAN_BYTES = 1 << 26  # of one plan
_FRAMING = 200  # bytes of a plan, at most, between its parts
_REMEDY = "split the recipe into several"
_OMITTED = {"arm", "driver", "interval", "mesh", "patches", "sensor"}  # keys that plans without them do not have
_PARTS: dict[type[BaseModel], dict[str, type[BaseModel]]] = {
    ScenarioPlan: {"scene": ScenePlan, "rig": RigPlan, "appearance": AppearancePlan},
    ScenePlan: {"town": TownPlan},
    AppearancePlan: {"looks": Looks},
}

_COUNTED: dict[Callable[[Any], int], tuple[type[BaseModel], int, str]] = {
    pose_count: (RigPlan, MAX_POSES, "poses of sensors"),
    box_count: (RigPlan, MAX_BOXES, "boxes that shorten arms"),
    point_count: (ScenePlan, MAX_POINTS_IN_ALL, "points of routes"),
}


def check_readable(dataset: DatasetPlan) -> None:
    """Check that the plans of a dataset, once written, can be read again, and its manifest and lockfile with them.

    Raises:
        InputError: the dataset is not within its bounds, or the plans are larger than those that are read.
    """
    check_bounds(dataset)
    sizes, total = dict[str, int](), 0
    for variant in dataset.variants:
        size = _FRAMING + len(variant.variant.encode())
        for key, make in _shared(variant):
            if key not in sizes:
                sizes[key] = len(pretty(make()).encode())
            size += sizes[key]
        total += size
        if size > MAX_PLAN_BYTES:
            raise InputError(f"the plan of {variant.variant} has over {MAX_PLAN_BYTES:,} bytes", help=_REMEDY)
        if total > MAX_BYTES:
            each = f"that of {variant.variant} has {size:,}"
            raise InputError(f"the plans have over {MAX_BYTES:,} bytes together; {each}", help=_REMEDY)


def _shared(variant: ScenarioPlan) -> Iterator[tuple[str, Callable[[], JsonValue]]]:
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
        self._known: dict[tuple[type[BaseModel], bytes], BaseModel] = {}
        self._bytes = 0
        self._totals = dict.fromkeys(_COUNTED, 0)

    def read(self, body: bytes) -> ScenarioPlan:
        """Return the plan in a file's content; ValueError with a one-line message if it is invalid or too large."""
        self._bytes += len(body)
        if len(body) > MAX_PLAN_BYTES:
            raise ValueError(f"a plan of more than {MAX_PLAN_BYTES:,} bytes is not read")
        if self._bytes > MAX_BYTES:
            raise ValueError(f"plans of together more than {MAX_BYTES:,} bytes are not read")
        try:
            return cast(ScenarioPlan, self._part(ScenarioPlan, decode(body, _plan_form())))
        except ValidationError as error:
            raise ValueError(_first_error(error)) from None

    def _part(self, model: type[BaseModel], found: Any) -> BaseModel:
        """Return a part of a plan from its decoded form; the same object for equal parts."""
        key = model, hashlib.sha256(msgspec.json.encode(found)).digest()
        if key in self._known:
            return self._known[key]
        for counter, (kind, most, what) in _COUNTED.items():  # these become objects of many times their size
            self._totals[counter] += counter(found) if model is kind else 0
            if self._totals[counter] > most:
                raise ValueError(f"more than {most:,} {what}")
        fields = found if isinstance(found, dict) else msgspec.structs.asdict(found)
        for name, part in _PARTS.get(model, {}).items():
            fields[name] = self._part(part, fields[name])
        made = self._known[key] = model.model_validate(fields, from_attributes=True)
        return made


@cache
def _plan_form() -> Any:
    return _form(ScenarioPlan)


def _form(kind: Any) -> Any:
    """Return the type into which the documents of a model are decoded: every key and no other, without ranges."""
    arguments = get_args(kind)
    if isinstance(kind, type) and issubclass(kind, RootModel):
        return _form(kind.model_fields["root"].annotation)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        fields = [
            (name, _form(field.annotation), *([field.default] if name in _OMITTED else []))
            for name, field in kind.model_fields.items()
        ]
        required_first = sorted(fields, key=len)
        return msgspec.defstruct(kind.__name__, required_first, forbid_unknown_fields=True)
    if get_origin(kind) is Annotated:
        return _form(arguments[0])
    if get_origin(kind) in (Union, UnionType):
        return Union[tuple(map(_form, arguments))]  # noqa: UP007  made of a tuple
    if get_origin(kind) in (tuple, dict):
        return get_origin(kind)[tuple(a if a is Ellipsis else _form(a) for a in arguments)]
    return kind


def _first_error(error: ValidationError) -> str:
    """Return the first error of a document with its place, on one line."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    place = ".".join(str(step)[:60] for step in first["loc"][:8])
    return f"{place}: {first['msg']}"[:300]
