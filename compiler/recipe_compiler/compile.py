"""Compiles a recipe file to a `DatasetPlan`: read, merge, check, expand, estimate, lower.

All problems are raised together, sorted by place. Nothing in a recipe is executed, no file outside its folder is read,
and the size of the result is estimated before anything large is created.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from recipe_compiler import compile_guard, expand, limits
from recipe_compiler.checks.check import Checker, check_deltas, check_removals
from recipe_compiler.checks.findings import Findings
from recipe_compiler.compile_guard import CompileGuard
from recipe_compiler.expand import Axes, Variant
from recipe_compiler.ir.errors import Code, InputError, Place, Problem, with_source
from recipe_compiler.ir.ground.path_planner import TooMuchWorkError
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_compiler.library.towns import Town
from recipe_compiler.limits import TooLargeError as TooLargeError
from recipe_compiler.load import Load
from recipe_compiler.lowering import asset_files, placement, plausibility, workload
from recipe_compiler.lowering.lower import Lowering
from recipe_compiler.lowering.patches import texture_files
from recipe_compiler.schema.messages import nearest, translate
from recipe_compiler.schema.recipe import Base, Recipe
from recipe_compiler.schema.sweep import Sweep
from recipe_compiler.source import merge
from recipe_compiler.source.yaml_reader import Value, show

_CHECKED_SEPARATELY = {"base", "deltas"}
_CARLA_KEYS = {"carla", "spawn_actors"}  # of configurations of CARLA's data collector
_EARLY_CHECKS = {100, 300, 1000, 3000}  # numbers of variants after which the compile cost so far is checked
_MAX_PROBLEMS = 1000  # of all variants; further variants are neither checked nor lowered


@dataclass(frozen=True)
class Compiled:
    """A compiled recipe: its plan, warnings, the digest of every file that was read, and the cost of building it."""

    plan: DatasetPlan
    warnings: tuple[Problem, ...]
    files: dict[str, str]  # path relative to the recipe's folder -> SHA-256 of its bytes
    cost: limits.Cost
    assets: tuple[asset_files.AssetFile, ...] = ()
    folder: Path = Path()  # the recipe's
    towns: Mapping[str, Town] = field(default_factory=dict)  # by their plans' digests

    @property
    def places(self) -> dict[str, Path]:
        """The paths of the assets by digest."""
        return {asset.file.sha256: self.folder / asset.path for asset in self.assets}


def compile_recipe(
    path: Path,
    *,
    allow_large: bool = False,
    free_disk: int | None = None,
    memory: limits.Memory | None = None,
    guard: CompileGuard | None = None,
) -> Compiled:
    """Compile a recipe file.

    Args:
        path: the recipe file.
        allow_large: compile even if the recipe exceeds the size limits.
        free_disk: bytes free where the dataset would be written, if known.
        memory: the memory of the host, if known.
        guard: stops compiling that takes too long, or too much memory; a new one by default, without limits if
            `allow_large`.

    Returns:
        The compiled recipe.

    Raises:
        InputError: with all problems of the recipe.
        TooLargeError: the recipe exceeds the limits, by its estimate or while it is compiled, and `allow_large` is not
            set; or those of `guard`.
    """
    guard, sources = guard or CompileGuard(unlimited=allow_large), merge.read(path)
    try:
        compiled = _compile(path, sources, guard, allow_large, free_disk, memory)
    except InputError as error:
        error.with_source(sources.lines)
        raise
    return dataclasses.replace(compiled, warnings=with_source(compiled.warnings, sources.lines))


def _compile(
    path: Path,
    sources: merge.Sources,
    guard: CompileGuard,
    allow_large: bool,
    free_disk: int | None,
    memory: limits.Memory | None,
) -> Compiled:
    problems = list(sources.problems)
    root = sources.root
    yaml_places = {problem.place for problem in problems}  # a place with a YAML error gets no second problem
    if root is None:
        raise InputError(_sorted(problems))
    recipe, faulty = _check_recipe(root, problems)
    textures = texture_files.find(root, path.parent, sources)
    assets, asset_problems = asset_files.read(root, recipe.assets, path.parent, sources, textures.files)
    asset_problems += textures.problems
    axes = _check_sweep(root, None if "sweep" in faulty else recipe.sweep, problems)
    if root.get("base") is None or len(problems) > len(sources.problems):
        kinds = None if "assets" in faulty else _kinds(recipe)
        rules = recipe.sweep.exclude if "sweep" not in faulty else None
        problems += [*asset_problems, *_check_variants_in_part(root, kinds, rules, guard)]
        raise InputError(_sorted(sources.problems, _without_repeats(problems, yaml_places)))
    problems += asset_problems
    found, sizes = Findings(), workload.sizes_of(assets)
    checked, loads = _checked(root, recipe, axes, sizes, guard, allow_large, bool(problems), found)
    problems += found.problems()
    if problems:
        raise InputError(_sorted(sources.problems, _without_repeats(problems, yaml_places)))
    estimate = limits.total(loads, recipe.output.depth)
    reasons = estimate.over(free_disk, memory)
    if reasons and not allow_large:
        raise limits.TooLargeError(compile_guard.place_of_size(root, estimate), estimate, reasons)
    lowering = Lowering(_instances(root, problems), assets, textures.read(assets), allow_large=guard.unlimited)
    plans, warnings = _lowered(lowering, checked, root, estimate, guard)
    plan = DatasetPlan(
        recipe=recipe.recipe,
        description=recipe.description,
        variants=tuple(plans),
        annotations=recipe.output.annotations,
        depth=recipe.output.depth,
    )
    cost = _cost(plans, recipe.output.depth, sizes, estimate)
    clashes = expand.clashes(root, axes, recipe.sweep)
    warnings = _sorted(clashes, plausibility.of_weather(root), warnings)
    files = dict(sorted(sources.files.items()))
    return Compiled(plan, tuple(warnings), files, cost, tuple(assets.values()), path.parent, lowering.towns)


def _checked(
    root: Value,
    recipe: Recipe,
    axes: Axes,
    sizes: workload.AssetSizes,
    guard: CompileGuard,
    allow_large: bool,
    is_faulty: bool,
    found: Findings,
) -> tuple[list[tuple[Variant, Base]], list[Load]]:
    """Check all variants, and estimate their cost.

    Args:
        root: the recipe, as text with places.
        recipe: its model.
        axes: the axes of its sweep.
        sizes: the sizes of its assets.
        guard: measures the cost of compiling.
        allow_large: ignore the limits.
        is_faulty: whether the recipe has problems already, which are reported in place of an excess.
        found: receives the problems.

    Raises:
        TooLargeError: compiling the variants exceeds the limits, and the recipe has no problems.
    """
    checked: list[tuple[Variant, Base]] = []
    loads: list[Load] = []
    changes = len(axes) + (len(recipe.sweep.draw.values) if recipe.sweep.draw else 0)
    variants = expand.variants(root, axes, recipe.sweep, recipe.seed)
    for variant, base in _check_variants(root, variants, _kinds(recipe), found):
        if base is None:
            continue
        checked.append((variant, base))
        loads.append(workload.estimated(variant, base, changes, sizes))
        excess = guard.excess(len(loads))
        if excess or (len(loads) in _EARLY_CHECKS and not allow_large):
            limit_error = compile_guard.compile_limit_error(root, loads, expand.count(axes, recipe.sweep), excess)
            if limit_error and not is_faulty and not found.total:
                raise limit_error
            if limit_error:
                break
    return checked, loads


def _cost(plans: Sequence[ScenarioPlan], depth: str, sizes: workload.AssetSizes, estimate: limits.Cost) -> limits.Cost:
    """The cost of building plans; that of compiling them is the estimate's."""
    return dataclasses.replace(
        limits.total((workload.measured(plan, sizes) for plan in plans), depth),
        compile_seconds=estimate.compile_seconds,
        compile_bytes=estimate.compile_bytes,
    )


def named_files(path: Path) -> tuple[str, set[str]] | None:
    """Return the name of a recipe and the files that it uses, itself included, without compiling it.

    Returns:
        None if the recipe cannot be read.
    """
    sources = merge.read(path)
    if sources.root is None or sources.problems:
        return None
    name = sources.root.get("recipe")
    textures = texture_files.find(sources.root, path.parent, sources)
    used = {*asset_files.named(sources.root, path.parent, sources), *(file.path for file in textures.files.values())}
    return str(name.data if name else ""), {*sources.files, *used}


def _lowered(
    lowering: Lowering,
    checked: Sequence[tuple[Variant, Base]],
    root: Value,
    estimate: limits.Cost,
    guard: CompileGuard,
) -> tuple[list[ScenarioPlan], list[Problem]]:
    """Lower all variants to plans.

    Returns:
        The plans, and the warnings.

    Raises:
        InputError: with the problems of all variants.
        TooLargeError: compiling takes too long, or too much memory.
    """
    plans, wrong, warnings = [], Findings(), Findings()
    for number, (variant, base) in enumerate(checked):
        excess = guard.excess(number)
        if excess:
            raise limits.TooLargeError(compile_guard.place_of_size(root, estimate), estimate, [excess])
        try:
            plan = lowering.scenario(variant, base)
        except TooMuchWorkError:
            raise compile_guard.too_much_planning(root, estimate) from None
        except ValidationError as error:
            raise compile_guard.beyond_plans(root, variant.name, error) from None
        wrong.add(lowering.problems, variant)
        warnings.add(lowering.warnings, variant)
        lowering.problems.clear()
        lowering.warnings.clear()
        if plan is not None:
            plans.append(plan)
        if wrong.total > _MAX_PROBLEMS:
            break
    if wrong.total:
        raise InputError(wrong.problems())
    return plans, warnings.problems()


def _kinds(recipe: Recipe) -> dict[str, str]:
    """Asset name -> `mesh` or `image`."""
    return {name: "image" if asset.mesh is None else "mesh" for name, asset in recipe.assets.items()}


def _without_repeats(problems: Iterable[Problem], yaml_places: set[Place | None]) -> list[Problem]:
    """Return the problems at places without a YAML error."""
    return [problem for problem in problems if problem.place not in yaml_places]


def _sorted(*problems: Iterable[Problem]) -> list[Problem]:
    """Problems by place, each once."""
    found = Findings()
    found.add(itertools.chain(*problems))
    return found.problems()


def _check_recipe(root: Value, problems: list[Problem]) -> tuple[Recipe, set[str]]:
    """Check a recipe without `base` and `deltas`.

    Returns:
        The recipe, with defaults in place of faulty parts, so that the other parts can be checked; the faulty keys.
    """
    for key in root.map:
        if key not in Recipe.model_fields and key not in _CHECKED_SEPARATELY:
            options = [*Recipe.model_fields, *_CHECKED_SEPARATELY]
            of_base = f"it is a key of `base`: indent it below `base:`, as `  {key}:`"
            remedy = of_base if key in Base.model_fields else nearest(key, sorted(options))
            if key in _CARLA_KEYS:
                remedy = "`recipe import carla` writes the recipe of a configuration of CARLA's data collector"
            problems.append(Problem(f"unknown key {show(key)}", root.key_place(key), remedy, Code.UNKNOWN_KEY))
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
        return Recipe.model_validate(plain), set()
    except ValidationError as error:
        problems += translate(error, Recipe, root)
        faulty = {str(detail["loc"][0]) for detail in error.errors()}
    sound = {key: value for key, value in plain.items() if key not in faulty}
    return Recipe.model_validate({"recipe": "unnamed", **sound}), faulty


def _check_sweep(root: Value, sweep: Sweep | None, problems: list[Problem]) -> Axes:
    """Check `deltas` and, unless it is faulty and None, `sweep`; return the axes."""
    wrong = check_deltas(root)
    problems += wrong
    if wrong:
        return {}
    problems += check_removals(root)
    if sweep is None:
        return {}
    axes = expand.chosen_axes(root, sweep, problems)
    wrong = expand.check_exclusions(axes, sweep, root)
    problems += wrong
    excess = expand.too_many(axes, sweep, root)
    problems += excess
    if not excess and not wrong and not expand.combinations(axes, sweep):
        problems.append(
            Problem(
                "sweep.exclude: leaves no variant at all",
                root.place_of("sweep", "exclude"),
                "remove a rule",
                Code.CONFLICT,
            )
        )
    return axes


def _check_variants_in_part(
    root: Value, kinds: dict[str, str] | None, rules: Sequence[Mapping[str, str]] | None, guard: CompileGuard
) -> list[Problem]:
    """Check base and deltas of a recipe that cannot be expanded: every value of an axis, in few combinations.

    Args:
        root: the recipe.
        kinds: its assets; None if they are faulty.
        rules: its exclusions; None if they are faulty.
        guard: measures the cost of compiling; beyond its limits, no further combination is checked.
    """
    base = root.get("base")
    if base is None or not isinstance(base.data, dict):
        return []
    checker, found = Checker(base, kinds), Findings()
    for merged in _bases_in_part(root, base, rules):
        problems: list[Problem] = []
        checker.base(merged, problems)
        found.add(problems)
        if found.total > _MAX_PROBLEMS or guard.excess(0):
            break
    return found.problems()


def _bases_in_part(root: Value, base: Value, rules: Sequence[Mapping[str, str]] | None) -> Iterator[Value]:
    """Yield the bases of few variants that have every value of an axis; without variants, the recipe's own base."""
    variant = None
    if rules is not None or not root.get("sweep", "exclude"):
        for variant in expand.covering(root, rules or ()):
            yield variant.base
    if variant is None:
        yield merge.expand_shorthands(base)


def _check_variants(
    root: Value, variants: Iterable[Variant], kinds: dict[str, str], found: Findings
) -> Iterator[tuple[Variant, Base | None]]:
    """Yield each variant with its checked base, or None in place of a base with problems."""
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
