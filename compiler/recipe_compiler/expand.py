"""Expands axes, exclusions, repeats and draws to named variants, each a merged base with a seed.

The number of variants is computed before any is created. Names follow the file: `weather=rainy,jitter=still`, with
`#2` for the second repeat or draw. A variant depends on its own values only: adding a value to an axis, a repeat or a
draw changes no other variant.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.plan_types import fixed
from recipe_compiler.ir.streams import Stream
from recipe_compiler.schema.fields import MAX_DRAWS, MAX_SEED, MAX_VARIANTS
from recipe_compiler.schema.messages import Suggestions, nearest
from recipe_compiler.schema.sweep import Distribution, Sweep
from recipe_compiler.source.merge import Merger, expand_shorthands
from recipe_compiler.source.yaml_reader import Value, show

MAX_NAME = 200  # a variant's name is a folder's, and file systems end at 255 bytes
_MAX_MERGES = 300  # of deltas, to check a recipe whose sweep cannot be expanded
PLAIN_NAME = "base"  # of the variant of a recipe without axes

Axes = dict[str, dict[str, Value]]  # axis -> value -> delta


@dataclass(frozen=True)
class Variant:
    """One variant before it is lowered: its name, its seed and its merged base."""

    name: str
    seed: int
    base: Value


def chosen_axes(root: Value, sweep: Sweep, problems: list[Problem]) -> Axes:
    """The axes of the sweep, in its order. Unknown and repeated names are added to `problems`."""
    deltas = root.get("deltas")
    all_axes = {name: dict(value.map) for name, value in deltas.map.items()} if deltas else {}
    names = list(sweep.axes) if sweep.axes is not None else list(all_axes)
    for index, name in enumerate(names):
        place = root.place_of("sweep", "axes", index)
        if name not in all_axes:
            problems.append(
                Problem(
                    f"sweep.axes: there is no axis {show(name)} in deltas",
                    place,
                    nearest(name, all_axes),
                    Code.UNKNOWN_NAME,
                )
            )
        elif name in names[:index]:
            problems.append(Problem(f"sweep.axes: {show(name)} occurs twice", place, "remove one", Code.CONFLICT))
    return {name: all_axes[name] for name in names if name in all_axes}


def count(axes: Axes, sweep: Sweep) -> int:
    """The number of variants before exclusions, without expanding them."""
    draws = sweep.draw.count if sweep.draw else 1
    return math.prod(len(values) for values in axes.values()) * sweep.repeats * draws


def too_many(axes: Axes, sweep: Sweep, root: Value) -> list[Problem]:
    """A problem if there are too many variants or draws."""
    total = count(axes, sweep)
    if total <= MAX_VARIANTS:
        draws = sweep.draw.count * sweep.repeats * len(sweep.draw.values) if sweep.draw else 0
        message = f"sweep.draw: {draws} draws exceed the limit of {MAX_DRAWS}"
        remedy = "lower `count` or `repeats`, or draw fewer values"
        where = root.place_of("sweep", "draw")
        return [Problem(message, where, remedy, Code.INPUT_LIMIT)] if draws > MAX_DRAWS else []
    factors = [str(len(values)) for values in axes.values()]
    if sweep.repeats > 1:
        factors.append(f"{sweep.repeats} repeats")
    if sweep.draw:
        factors.append(f"{sweep.draw.count} draws")
    place = root.key_place("sweep" if root.get("sweep") else "deltas")
    product = " x ".join(factors[:20])
    shown = str(total) if total.bit_length() < 60 else f"about 10^{total.bit_length() * 30103 // 100000}"
    message = f"{shown} variants ({product}) exceed the limit of {MAX_VARIANTS}"
    remedy = "sweep fewer axes (`sweep.axes`), or give them fewer values, repeats or draws"
    return [Problem(message, place, remedy, Code.INPUT_LIMIT)]


def check_exclusions(axes: Axes, sweep: Sweep, root: Value) -> list[Problem]:
    """Problems of exclusions that name an unknown axis or value."""
    problems, of_axes = [], Suggestions(axes)
    of_values = {axis: Suggestions(values) for axis, values in axes.items()}
    for index, rule in enumerate(sweep.exclude):
        where = root.get("sweep", "exclude", index) or root
        if not rule:
            problems.append(
                Problem(
                    "sweep.exclude: an empty map would leave out every variant",
                    where.place,
                    "remove it",
                    Code.INVALID_VALUE,
                )
            )
        for axis, value in rule.items():
            if axis not in axes:
                message = f"sweep.exclude: there is no axis {show(axis)} in this sweep"
                problems.append(Problem(message, where.key_place(axis), of_axes.nearest(axis), Code.UNKNOWN_NAME))
            elif value not in axes[axis]:
                message = f"sweep.exclude: axis {axis} has no value {show(value)}"
                problems.append(
                    Problem(message, where.place_of(axis), of_values[axis].nearest(value), Code.UNKNOWN_NAME)
                )
    return problems


def combinations(axes: Axes, sweep: Sweep) -> list[dict[str, str]]:
    """Every combination of axis values that no exclusion matches, in file order."""
    product = (dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values()))
    return [one for one in product if not any(rule.items() <= one.items() for rule in sweep.exclude)]


def name_of(combination: Mapping[str, str], number: int) -> str:
    """A variant's stable name."""
    plain = ",".join(f"{axis}={value}" for axis, value in combination.items()) or PLAIN_NAME
    return plain if number == 1 else f"{plain}#{number}"


def names(axes: Axes, sweep: Sweep) -> Iterator[str]:
    """Yield the names of all variants, in file order, without merging any."""
    draws = sweep.draw.count if sweep.draw else 1
    for combination in combinations(axes, sweep):
        yield from (name_of(combination, number) for number in range(1, sweep.repeats * draws + 1))


def repeat_seed(seed: int, repeat: int) -> int:
    """The seed of a repeat, counted from 1; the first has the recipe's own."""
    return seed if repeat == 1 else Stream(seed, "repeat", str(repeat)).integer(0, MAX_SEED)


def variants(root: Value, axes: Axes, sweep: Sweep, seed: int) -> Iterator[Variant]:
    """Yield all variants, in file order. Values that no delta changes are the same objects in every variant."""
    merger = Merger()
    base = expand_shorthands(root.map["base"])
    draws = sweep.draw.count if sweep.draw else 1
    values = sweep.draw.values if sweep.draw else {}
    seeds = {repeat: repeat_seed(seed, repeat) for repeat in range(1, sweep.repeats + 1)}
    patches_of: dict[tuple[int, int], list[Value]] = {}
    for repeat, draw in itertools.product(seeds, range(1, draws + 1)):
        patches_of[repeat, draw] = [
            _patch(path, drawn(how, seeds[repeat], path, draw), root.place_of("sweep", "draw", "values", path))
            for path, how in values.items()
        ]
    for combination in combinations(axes, sweep):
        merged = _merged(merger, base, [axes[axis][value] for axis, value in combination.items()])
        for (repeat, draw), patches in patches_of.items():
            final = _merged(merger, merged, patches)
            number = (repeat - 1) * draws + draw
            yield Variant(name_of(combination, number), seeds[repeat], final)


def covering(root: Value, rules: Sequence[Mapping[str, str]]) -> Iterator[Variant]:
    """Yield variants in which every value of every axis occurs, to check a recipe whose sweep cannot be expanded.

    Their number is that of the values of the longest axis, but at most `_MAX_MERGES` deltas are merged. Malformed
    values are omitted, and so are the combinations that a rule of `rules` excludes.
    """
    deltas = root.get("deltas")
    axes = {
        axis: [(name, delta) for name, delta in values.map.items() if isinstance(delta.data, dict)]
        for axis, values in (deltas.map.items() if deltas else ())
        if isinstance(values.data, dict)
    }
    axes = {axis: values for axis, values in axes.items() if values}
    merger, base = Merger(), expand_shorthands(root.map["base"])
    number = min(max(map(len, axes.values()), default=0), _MAX_MERGES // max(1, len(axes)))
    for index in range(number):
        chosen = {axis: values[index % len(values)] for axis, values in axes.items()}
        combination = {axis: name for axis, (name, _) in chosen.items()}
        if any(rule.items() <= combination.items() for rule in rules):
            continue
        merged = _merged(merger, base, [delta for _, delta in chosen.values()])
        yield Variant(name_of(combination, 1), 0, merged)


def _merged(merger: Merger, base: Value, patches: Iterable[Value]) -> Value:
    """Return a base with patches merged over it, in order."""
    for patch in patches:
        base = expand_shorthands(merger.merge(base, patch))
    return base


def drawn(how: Distribution, seed: int, path: str, draw: int) -> bool | int | float | str:
    """The value of a draw, keyed by seed, path and draw number: the same in every combination of axis values."""
    stream = Stream(seed, "draw", path, str(draw))
    if how.choice is not None:
        return stream.choice(how.choice)
    if how.integer is not None:
        return stream.integer(*how.integer)
    if how.uniform is not None:
        return fixed(stream.uniform(*how.uniform))
    assert how.normal is not None
    value = stream.normal(*how.normal)
    if how.clip is not None:
        value = min(max(value, how.clip[0]), how.clip[1])
    return fixed(value)


def _patch(path: str, value: bool | int | float | str, place: Place) -> Value:
    result = Value(value, place)
    for key in reversed(path.split(".")):
        result = Value({key: result}, place, {key: place})
    return result


def leaves(delta: Value, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Place]]:
    """The paths that a delta sets or removes, each with its place."""
    for key, value in delta.map.items():
        if isinstance(value.data, dict) and value.data:
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key), delta.key_place(key)


def clashes(root: Value, axes: Axes, sweep: Sweep) -> list[Problem]:
    """A warning for each path that two axes set, at the later one, naming both; the draws are the last axis.

    A draw that replaces the map of an earlier draw is reported too.
    """
    warnings: dict[tuple[str, str, str], Problem] = {}
    earlier = _Paths()
    for axis, values in axes.items():
        own = [found for delta in values.values() for found in leaves(delta)]
        for path, place in own:
            if (other := earlier.conflicting(path)) is not None:
                message = f"axes {other} and {axis} both set {'.'.join(path)}"
                found = Problem(message, place, f"the later one, {axis}, wins", Code.AXES_OVERLAP)
                warnings.setdefault((other, axis, ".".join(path)), found)
        for path, _ in own:
            earlier.add(path, axis)
    drawn = _Paths()
    for drawn_path in sweep.draw.values if sweep.draw else ():
        keys, place = tuple(drawn_path.split(".")), root.place_of("sweep", "draw", "values", drawn_path)
        if (other := earlier.conflicting(keys)) is not None:
            message = f"axis {other} and sweep.draw both set {drawn_path}"
            warnings["", "", drawn_path] = Problem(message, place, "the draw wins", Code.AXES_OVERLAP)
        elif (lost := drawn.below(keys)) is not None:
            message = f"sweep.draw replaces {drawn_path} after it has drawn {lost}, which is lost"
            warnings["", "", drawn_path] = Problem(message, place, f"draw {drawn_path} first", Code.AXES_OVERLAP)
        drawn.add(keys, drawn_path)
    return list(warnings.values())


class _Paths:
    """The paths that axes set, indexed by prefix."""

    def __init__(self) -> None:
        self._set: dict[tuple[str, ...], str] = {}
        self._below: dict[tuple[str, ...], str] = {}  # each prefix of a path that is set -> the axis of the first

    def add(self, path: tuple[str, ...], axis: str) -> None:
        """Record that an axis sets a path; the first axis of a path is kept."""
        self._set.setdefault(path, axis)
        for n in range(1, len(path)):
            self._below.setdefault(path[:n], axis)

    def below(self, path: tuple[str, ...]) -> str | None:
        """The first axis that sets a path below this one."""
        return self._below.get(path)

    def conflicting(self, path: tuple[str, ...]) -> str | None:
        """The axis that sets this path, or one above or below it."""
        above = (path[:n] for n in range(1, len(path) + 1))
        return next((self._set[p] for p in above if p in self._set), None) or self._below.get(path)
