"""From a recipe file to a `DatasetPlan`: read, merge, check, expand, count, lower.

All that is wrong is raised at once, sorted by place. Nothing is executed, nothing outside the recipe's folder read,
and nothing large made before it is counted.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from recipe_compiler import expand, limits
from recipe_compiler.checks.check import Checker, check_deltas, check_removals
from recipe_compiler.checks.findings import Findings
from recipe_compiler.expand import Axes, Variant
from recipe_compiler.ir.errors import Code, InputError, Place, Problem, with_source
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_compiler.library.towns import Town
from recipe_compiler.limits import TooLargeError as TooLargeError
from recipe_compiler.lowering import asset_files, placement, workload
from recipe_compiler.lowering.lower import Lowering
from recipe_compiler.schema.messages import nearest, translate
from recipe_compiler.schema.recipe import Base, Recipe
from recipe_compiler.source import merge
from recipe_compiler.source.yaml_reader import Value, show

_CHECKED_APART = {"base", "deltas"}
_LOOKS = {100, 300, 1000, 3000}  # numbers of variants after which to look whether they are too much already


@dataclass(frozen=True)
class Compiled:
    """A recipe, compiled: its plan, what to warn of, the digest of every file read, and what building it costs."""

    plan: DatasetPlan
    warnings: tuple[Problem, ...]
    files: dict[str, str]  # path relative to the recipe's folder -> SHA-256 of its bytes
    cost: limits.Cost
    assets: tuple[asset_files.Brought, ...] = ()
    folder: Path = Path()  # the recipe's
    towns: Mapping[str, Town] = field(default_factory=dict)  # by their plans' digests

    @property
    def places(self) -> dict[str, Path]:
        """Where the assets lie, by digest."""
        return {asset.file.sha256: self.folder / asset.path for asset in self.assets}


def compile_recipe(
    path: Path, *, allow_large: bool = False, free_disk: int | None = None, memory: limits.Memory | None = None
) -> Compiled:
    """Compile a recipe file.

    `free_disk` is the number of bytes free where the dataset would go, if known, and `memory` what the host has of
    it. InputError with all problems; TooLargeError, which is one, before any plan is made if the recipe is over the
    limits and `allow_large` is not set.
    """
    sources = merge.read(path)
    try:
        compiled = _compile(path, sources, allow_large, free_disk, memory)
    except InputError as error:
        error.with_source(sources.lines)
        raise
    return dataclasses.replace(compiled, warnings=with_source(compiled.warnings, sources.lines))


def _compile(
    path: Path, sources: merge.Sources, allow_large: bool, free_disk: int | None, memory: limits.Memory | None
) -> Compiled:
    problems = list(sources.problems)
    root = sources.root
    stumbles = {problem.place for problem in problems}  # where YAML itself stumbled; no second blame there
    if root is None:
        raise InputError(_sorted(problems))
    recipe = _check_recipe(root, problems)
    assets, unfit = asset_files.read(root, recipe.assets, path.parent, sources) if recipe else ({}, [])
    axes = _check_sweep(root, recipe, problems)
    if recipe is None or root.get("base") is None or _fatal(problems, sources.problems):
        problems += [*unfit, *_check_base_alone(root, _kinds(recipe))]
        raise InputError(_sorted(sources.problems, _new(problems, stumbles)))
    problems += unfit
    loads: list[limits.Load] = []
    found = Findings()
    checked: list[tuple[Variant, Base]] = []
    changes = len(axes) + (len(recipe.sweep.draw.values) if recipe.sweep.draw else 0)
    variants = expand.variants(root, axes, recipe.sweep, recipe.seed)
    for variant, base in _check_variants(root, variants, _kinds(recipe), found):
        if base is None:
            continue
        checked.append((variant, base))
        loads.append(workload.estimated(variant, base, changes))
        if len(loads) in _LOOKS and not allow_large:
            too_long = _too_long(root, loads, expand.count(axes, recipe.sweep))
            if too_long and not problems and not found.total:
                raise too_long
            if too_long:
                break
    problems += found.problems()
    if problems:
        raise InputError(_sorted(sources.problems, _new(problems, stumbles)))
    estimate = limits.total(loads, recipe.output.depth)
    reasons = estimate.over(free_disk, memory)
    if reasons and not allow_large:
        raise limits.TooLargeError(_costliest(root, estimate), estimate, reasons)
    lowering = Lowering(_instances(root, problems), assets)
    plans, cautions = _lowered(lowering, checked)
    plan = DatasetPlan(
        recipe=recipe.recipe,
        description=recipe.description,
        variants=tuple(plans),
        annotations=recipe.output.annotations,
        depth=recipe.output.depth,
    )
    cost = dataclasses.replace(
        limits.total(map(workload.measured, plans), recipe.output.depth),
        compile_seconds=estimate.compile_seconds,
        compile_bytes=estimate.compile_bytes,
    )
    clashes = expand.clashes(root, axes, recipe.sweep)
    warnings = _sorted(clashes, cautions)
    files = dict(sorted(sources.files.items()))
    return Compiled(plan, tuple(warnings), files, cost, tuple(assets.values()), path.parent, lowering.towns)


def named_files(path: Path) -> tuple[str, set[str]] | None:
    """A recipe's name and the files that it names, itself among them, without compiling it; None if it is broken."""
    sources = merge.read(path)
    if sources.root is None or sources.problems:
        return None
    name = sources.root.get("recipe")
    return str(name.data if name else ""), {*sources.files, *asset_files.named(sources.root, path.parent, sources)}


def _lowered(lowering: Lowering, checked: Sequence[tuple[Variant, Base]]) -> tuple[list[ScenarioPlan], list[Problem]]:
    """The plans of all variants, and what to warn of; InputError if one has problems."""
    plans, wrong, cautions = [], Findings(), Findings()
    for variant, base in checked:
        plan = lowering.scenario(variant, base)
        wrong.add(lowering.problems, variant)
        cautions.add(lowering.warnings, variant)
        lowering.problems.clear()
        lowering.warnings.clear()
        if plan is not None:
            plans.append(plan)
    if wrong.total:
        raise InputError(wrong.problems())
    return plans, cautions.problems()


def _kinds(recipe: Recipe | None) -> dict[str, str]:
    """Whether an asset is a mesh or an image, by name."""
    assets = recipe.assets if recipe else {}
    return {name: "image" if asset.mesh is None else "mesh" for name, asset in assets.items()}


def _new(problems: Iterable[Problem], stumbles: set[Place | None]) -> list[Problem]:
    return [problem for problem in problems if problem.place not in stumbles]


def _sorted(*problems: Iterable[Problem]) -> list[Problem]:
    """Problems by place, each once."""
    found = Findings()
    found.add(itertools.chain(*problems))
    return found.problems()


def _fatal(problems: list[Problem], of_reading: list[Problem]) -> bool:
    """Whether the problems so far leave no sense in expanding variants."""
    return len(problems) > len(of_reading)


def _check_recipe(root: Value, problems: list[Problem]) -> Recipe | None:
    for key in root.map:
        if key not in Recipe.model_fields and key not in _CHECKED_APART:
            options = [*Recipe.model_fields, *_CHECKED_APART]
            problems.append(
                Problem(
                    f"unknown key {show(key)}", root.key_place(key), nearest(key, sorted(options)), Code.UNKNOWN_KEY
                )
            )
    base = root.get("base")
    if base is None or not isinstance(base.data, dict):
        found = "" if base is None else f", not {show(base.plain)}"
        problems.append(
            Problem(
                f'the recipe lacks "base"{found}',
                root.key_place("base"),
                "add `base`: a map of clock, town and sensors, and of what else the scene has",
                Code.MISSING_KEY,
            )
        )
    plain = {key: value.plain for key, value in root.map.items() if key in Recipe.model_fields}
    try:
        return Recipe.model_validate(plain)
    except ValidationError as error:
        problems += translate(error, Recipe, root)
        return None


def _check_sweep(root: Value, recipe: Recipe | None, problems: list[Problem]) -> Axes:
    wrong = check_deltas(root)
    problems += wrong
    if recipe is None or wrong:
        return {}
    problems += check_removals(root)
    axes = expand.chosen_axes(root, recipe.sweep, problems)
    wrong = expand.check_exclusions(axes, recipe.sweep, root)
    problems += wrong
    excess = expand.too_many(axes, recipe.sweep, root)
    problems += excess
    if not excess and not wrong and not expand.combinations(axes, recipe.sweep):
        problems.append(
            Problem(
                "sweep.exclude: leaves no variant at all",
                root.place_of("sweep", "exclude"),
                "remove a rule",
                Code.CONFLICT,
            )
        )
    return axes


def _check_base_alone(root: Value, kinds: dict[str, str]) -> list[Problem]:
    problems: list[Problem] = []
    base = root.get("base")
    if base is not None and isinstance(base.data, dict):
        base = merge.expand_shorthands(base)
        Checker(base, kinds).base(base, problems)
    return problems


def _costliest(root: Value, cost: limits.Cost) -> Place:
    """Where the number stands that a recipe over the limits owes most of its size to."""
    if cost.over_to_compile() or cost.variants * cost.variants > cost.frames:
        for path in (("sweep", "repeats"), ("sweep", "draw", "count"), ("deltas",), ("base", "traffic")):
            if root.get(*path):
                return root.place_of(*path)
    return root.place_of("base", "clock", "frames")


def _too_long(root: Value, loads: list[limits.Load], variants: int) -> limits.TooLargeError | None:
    """What is wrong if these first variants alone would take too long to compile: checking all would, too."""
    estimate = limits.total(loads, "carla")
    reasons = estimate.over_to_compile()
    if reasons:
        reasons[0] = f"of the first {len(loads)} variants alone, {reasons[0]}"
    whole = dataclasses.replace(estimate, variants=variants)
    return limits.TooLargeError(_costliest(root, whole), whole, reasons) if reasons else None


def _check_variants(
    root: Value, variants: Iterable[Variant], kinds: dict[str, str], found: Findings
) -> Iterator[tuple[Variant, Base | None]]:
    """The variants, one by one, with their models; None for one that has problems."""
    checker = Checker(root.map["base"], kinds)
    for variant in variants:
        if len(variant.name) > expand.MAX_NAME:
            message = f"the variant name {show(variant.name)} is longer than {expand.MAX_NAME} characters"
            remedy = "shorten the names of axes or of their values"
            found.add([Problem(message, root.key_place("deltas"), remedy, Code.INVALID_NAME)])
        problems: list[Problem] = []
        base = checker.base(variant.base, problems)
        found.add(problems, variant)
        yield variant, base
        if found.total > 1000:
            break


def _instances(root: Value, problems: list[Problem]) -> dict[str, int]:
    base = root.map["base"].get("actors")
    own = list(base.map) if base else []
    others: dict[str, None] = {}
    deltas = root.get("deltas")
    for values in deltas.map.values() if deltas else ():
        for delta in values.map.values():
            actors = delta.get("actors")
            others.update(dict.fromkeys(name for name in (actors.map if actors else ()) if name not in own))
    try:
        return placement.instance_numbers(own, list(others))
    except ValueError as error:
        problems.append(Problem(f"actors: {error}", root.place_of("base", "actors"), code=Code.INPUT_LIMIT))
        raise InputError(_sorted(problems)) from None
