"""Compiles a recipe file to a `DatasetPlan`: read, merge, check, expand, lower, estimate.

All problems are raised together, sorted by place. Nothing in a recipe is executed, no file outside its folder is read,
and what the variants have is counted (`lowering.caps`) before anything large is created.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from recipe_compiler import expand
from recipe_compiler.checks.check import Checker, check_deltas, check_removals
from recipe_compiler.checks.findings import Findings
from recipe_compiler.estimate import Cost, Memory, estimate
from recipe_compiler.estimate import TooLargeError as TooLargeError
from recipe_compiler.expand import Axes, Variant
from recipe_compiler.ir.errors import Code, InputError, Place, Problem, with_source
from recipe_compiler.ir.ground.path_planner import TooMuchWorkError
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering import asset_files, own_bodies, placement, plausibility
from recipe_compiler.lowering.caps import CAPS, Counts, place_of_variants
from recipe_compiler.lowering.lower import Lowering
from recipe_compiler.lowering.patches import texture_files
from recipe_compiler.schema.messages import nearest, translate
from recipe_compiler.schema.recipe import Base, Recipe
from recipe_compiler.schema.sweep import Sweep
from recipe_compiler.source import merge
from recipe_compiler.source.yaml_reader import Value, show

_CHECKED_SEPARATELY = {"base", "deltas"}
_CARLA_KEYS = {"carla", "spawn_actors"}  # of configurations of CARLA's data collector
_MAX_PROBLEMS = 1000  # of all variants; further variants are neither checked nor lowered


@dataclass(frozen=True)
class Compiled:
    """A compiled recipe: its plan, warnings, the digest of every file that was read, and the cost of building it."""

    plan: DatasetPlan
    warnings: tuple[Problem, ...]
    files: dict[str, str]  # path relative to the recipe's folder -> SHA-256 of its bytes
    cost: Cost
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
    memory: Memory | None = None,
) -> Compiled:
    """Compile a recipe file.

    Args:
        path: the recipe file.
        allow_large: compile even if the recipe exceeds the size limits.
        free_disk: bytes free where the dataset would be written, if known.
        memory: the memory of the host, if known.

    Returns:
        The compiled recipe.

    Raises:
        InputError: with all problems of the recipe.
        TooLargeError: the recipe exceeds a cap or a limit, and `allow_large` is not set.
    """
    sources = merge.read(path)
    try:
        compiled = _compile(path, sources, allow_large)
        compiled = dataclasses.replace(compiled, warnings=with_source(compiled.warnings, sources.lines))
        reasons = [] if allow_large else compiled.cost.over(free_disk, memory)
        if reasons and sources.root is not None:
            place = _place_of_size(sources.root, compiled.cost)
            raise TooLargeError(place, reasons, compiled.cost.variants, compiled.warnings)
    except InputError as error:
        error.with_source(sources.lines)
        raise
    return compiled


def _place_of_size(root: Value, cost: Cost) -> Place:
    """Return the place of the number that contributes most to the size of a recipe over the limits."""
    many = cost.variants * cost.variants > cost.frames
    return place_of_variants(root) if many else root.place_of("base", "clock", "frames")


def _compile(path: Path, sources: merge.Sources, allow_large: bool) -> Compiled:
    problems = list(sources.problems)
    root = sources.root
    yaml_places = {problem.place for problem in problems}  # a place with a YAML error gets no second problem
    if root is None:
        raise InputError(_sorted(problems))
    recipe, faulty = _check_recipe(root, problems)
    textures = texture_files.find(root, path.parent, sources)
    further = {**textures.files, **own_bodies.files(root, recipe.blueprints, path.parent, sources)}
    assets, asset_problems = asset_files.read(root, recipe.assets, path.parent, sources, further)
    asset_problems += [*textures.problems, *own_bodies.clashes(root, recipe.blueprints)]
    axes = _check_sweep(root, None if "sweep" in faulty else recipe.sweep, problems)
    if root.get("base") is None or len(problems) > len(sources.problems):
        kinds = None if "assets" in faulty else _kinds(recipe)
        rules = recipe.sweep.exclude if "sweep" not in faulty else None
        problems += [*asset_problems, *_check_variants_in_part(root, kinds, rules)]
        raise InputError(_sorted(sources.problems, _without_repeats(problems, yaml_places)))
    problems += asset_problems
    found = Findings()
    checked = _checked(root, recipe, axes, allow_large, bool(problems), found)
    problems += found.problems()
    if problems:
        raise InputError(_sorted(sources.problems, _without_repeats(problems, yaml_places)))
    made = own_bodies.made(recipe.blueprints, assets)
    lowering = Lowering(_instances(root, problems), assets, textures.read(assets), made, allow_large=allow_large)
    plans, warnings = _lowered(lowering, checked, root)
    plan = DatasetPlan(
        recipe=recipe.recipe,
        description=recipe.description,
        about=recipe.about,
        variants=tuple(plans),
        annotations=recipe.output.annotations,
        forms=recipe.output.forms,
    )
    clashes = expand.clashes(root, axes, recipe.sweep)
    warnings = _sorted(clashes, plausibility.of_weather(root), warnings)
    files, own = dict(sorted(sources.files.items())), tuple(assets.values())
    return Compiled(plan, tuple(warnings), files, estimate(plan), own, path.parent, lowering.towns)


def _checked(
    root: Value, recipe: Recipe, axes: Axes, allow_large: bool, is_faulty: bool, found: Findings
) -> list[tuple[Variant, Base]]:
    """Check all variants, and count what they have.

    Args:
        root: the recipe, as text with places.
        recipe: its model.
        axes: the axes of its sweep.
        allow_large: ignore the caps.
        is_faulty: whether the recipe has problems already, which are reported in place of an excess.
        found: receives the problems.

    Raises:
        TooLargeError: the variants exceed a cap, and the recipe has no problems.
    """
    checked: list[tuple[Variant, Base]] = []
    checker = Checker(root.map["base"], _kinds(recipe), _own_ids(root))
    changes = len(axes) + (len(recipe.sweep.draw.values) if recipe.sweep.draw else 0)
    counts = Counts(root, expand.count(axes, recipe.sweep), changes)
    for variant, base in _check_variants(root, expand.variants(root, axes, recipe.sweep, recipe.seed), checker, found):
        if base is None:
            continue
        checked.append((variant, base))
        try:
            if not allow_large:
                counts.add(variant, base, checker.values)
        except TooLargeError:
            if not is_faulty and not found.total:
                raise
            break
    return checked


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
    used |= own_bodies.named(sources.root, path.parent, sources)
    return str(name.data if name else ""), {*sources.files, *used}


def _lowered(
    lowering: Lowering, checked: Sequence[tuple[Variant, Base]], root: Value
) -> tuple[list[ScenarioPlan], list[Problem]]:
    """Lower all variants to plans.

    Returns:
        The plans, and the warnings.

    Raises:
        InputError: with the problems of all variants.
        TooLargeError: planning the routes of pedestrians takes more work than is allowed.
    """
    plans, wrong, warnings = [], Findings(), Findings()
    for variant, base in checked:
        try:
            plan = lowering.scenario(variant, base)
        except TooMuchWorkError:
            place = root.place_of("base", "actors" if root.get("base", "actors") else "traffic")
            reason = "planning the routes of its pedestrians takes too long"
            raise TooLargeError(place, [reason], len(checked)) from None
        except ValidationError as error:
            raise _beyond_plans(root, variant.name, error) from None
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


def _beyond_plans(root: Value, variant: str, error: ValidationError) -> InputError:
    """Return the error to raise if a variant, though valid, has a value that plans cannot hold."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, (error.title, *first["loc"])))
    message = f"the variant {variant} exceeds a limit of plans: {where}: {first['msg'].lower()}"
    return InputError(
        [Problem(message, root.key_place("base"), "choose smaller values, or fewer of them", Code.INPUT_LIMIT)]
    )


def _kinds(recipe: Recipe) -> dict[str, str]:
    """Asset name -> `mesh` or `image`."""
    return {name: "image" if asset.mesh is None else "mesh" for name, asset in recipe.assets.items()}


def _own_ids(root: Value) -> list[str]:
    """Return the ids of the recipe's own blueprints."""
    own = root.get("blueprints")
    return list(own.map) if own else []


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
    root: Value, kinds: dict[str, str] | None, rules: Sequence[Mapping[str, str]] | None
) -> list[Problem]:
    """Check base and deltas of a recipe that cannot be expanded: every value of an axis, in few combinations.

    Args:
        root: the recipe.
        kinds: its assets; None if they are faulty.
        rules: its exclusions; None if they are faulty.
    """
    base = root.get("base")
    if base is None or not isinstance(base.data, dict):
        return []
    checker, found = Checker(base, kinds, _own_ids(root)), Findings()
    for merged in _bases_in_part(root, base, rules):
        problems: list[Problem] = []
        checker.base(merged, problems)
        found.add(problems)
        if found.total > _MAX_PROBLEMS or checker.values > CAPS["values"].most:
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
    root: Value, variants: Iterable[Variant], checker: Checker, found: Findings
) -> Iterator[tuple[Variant, Base | None]]:
    """Yield each variant with its checked base, or None in place of a base with problems."""
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
