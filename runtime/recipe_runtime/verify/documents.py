"""The fields in which two plans or other JSON documents differ."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping

from recipe_compiler.ir.plan import AppearancePlan, Looks, RigPlan, ScenarioPlan, ScenePlan
from recipe_compiler.ir.plurals import count

MAX_FIELDS = 12  # limit of reported fields per part of a plan; the rest is counted


def plan_fields(pairs: Iterable[tuple[str, ScenarioPlan, ScenarioPlan]]) -> dict[str, list[str]]:
    """Return the fields in which pairs of plans differ, in words, each with the names of the pairs that differ in it.

    Parts that several pairs share, such as the colours of a whole town, are compared once.
    """
    known: dict[tuple[str, str, str], list[str]] = {}
    found: dict[str, list[str]] = {}
    for name, a, b in pairs:
        for (path, ours), (_, theirs) in zip(_parts(a), _parts(b), strict=True):
            key = path, ours.digest, theirs.digest
            if ours.digest != theirs.digest and key not in known:
                excluded = {"looks"} if path == "appearance" else None
                documents = [part.model_dump(mode="json", exclude=excluded) for part in (ours, theirs)]
                known[key] = _first(walk(documents[0], documents[1], path), path)
            for message in known.get(key, ()):
                found.setdefault(message, []).append(name)
    return found


def _parts(plan: ScenarioPlan) -> list[tuple[str, ScenePlan | RigPlan | AppearancePlan | Looks]]:
    appearance = plan.appearance
    return [
        ("scene", plan.scene),
        ("rig", plan.rig),
        ("appearance", appearance),
        ("appearance.looks", appearance.looks),
    ]


def _first(messages: Iterator[str], part: str) -> list[str]:
    """Return the first messages, at most MAX_FIELDS, and one on the number of the rest."""
    first = list(itertools.islice(messages, MAX_FIELDS))
    rest = sum(1 for _ in messages)
    return [*first, f"and {count(rest, 'more field', 'more fields')} of the {part} plan"] if rest else first


def walk(ours: object, theirs: object, path: str) -> Iterator[str]:
    """Yield the fields in which two documents differ, with both values.

    Named items of lists are matched by name; another order of them is a difference, too.
    """
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        for key in [*ours, *(key for key in theirs if key not in ours)]:
            yield from _pair(ours, theirs, key, f"{path}.{key}")
    elif isinstance(ours, list) and isinstance(theirs, list):
        first, second = (
            {str(item["name"]): item for item in side if isinstance(item, Mapping) and "name" in item}
            for side in (ours, theirs)
        )
        if (len(first), len(second)) == (len(ours), len(theirs)):
            for key in [*first, *(key for key in second if key not in first)]:
                yield from _pair(first, second, key, f"{path}[{key}]")
            if [key for key in first if key in second] != [key for key in second if key in first]:
                yield f"{path}: the entries are in another order"
        elif len(ours) != len(theirs):
            yield f"{path} has {count(len(ours), 'entry', 'entries')} and {len(theirs):,}"
        else:
            for number, pair in enumerate(zip(ours, theirs, strict=True)):
                yield from walk(*pair, f"{path}[{number}]")
    elif ours != theirs:
        yield f"{path}: {_short(ours)} and {_short(theirs)}"


def _pair(ours: Mapping[str, object], theirs: Mapping[str, object], key: str, path: str) -> Iterator[str]:
    if key not in ours or key not in theirs:
        yield f"{path} is in the {'first' if key in ours else 'second'} only"
    elif ours[key] != theirs[key]:
        yield from walk(ours[key], theirs[key], path)


def _short(value: object) -> str:
    """Return a value in the notation of a recipe, shortened."""
    text = value if isinstance(value, str) else "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."
