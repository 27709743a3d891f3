"""`recipe build`: the dataset."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from recipe_cli import build_report
from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    RECIPES,
    WORKERS,
    LocalPath,
    compile_quietly,
    engines_for,
    output_option,
    replace_option,
    shown,
    unpacks,
    worker_count,
)
from recipe_cli.build_report import Outcome
from recipe_cli.console import held_notes, note, print_json, say, warn
from recipe_cli.host_limits import free_disk
from recipe_cli.lockfile_paths import lockfile_path, read_lockfile, source_of
from recipe_cli.places import check_default_folder, check_utf8, recipe_files
from recipe_cli.progress import Progress, interruptible
from recipe_cli.suggestions import url_with_one_slash

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.ir.lockfile import Lockfile
    from recipe_runtime.build.pipeline import BuildResult
    from recipe_runtime.build.recipe_files import RecipeFiles
    from recipe_runtime.build.resume import Runner
    from recipe_runtime.transfer.upload import Target


@dataclass(frozen=True)
class Request:
    """The arguments of one run of the command."""

    recipe: Path
    source: Path  # the recipe as the user wrote it; `recipe` is unpacked if it was a pack
    output: str | None
    locked: bool
    only_locked: bool
    ray: str | None
    repair: bool
    replace: bool
    device: str
    workers: int | None
    allow_large: bool


@dataclass(frozen=True)
class Inputs:
    """What a build needs, checked before any work."""

    compiled: Compiled
    folder: Path
    lock: tuple[Path, Lockfile] | None
    files: RecipeFiles | None  # None: the dataset does not contain its recipe
    target: Target | None


def _recipe_first(command: Callable[..., None]) -> Callable[..., None]:
    """Take the value of `--ray` for the recipe in `build --ray rain.yaml`, where it is not a cluster's address."""

    @functools.wraps(command)
    def ordered(recipe: Path | None, ray: str | None, **values: object) -> None:
        if recipe is None and ray is not None and Path(ray).suffix in (".yaml", ".yml", ".recipe"):
            recipe, ray = Path(ray), "local"
        if recipe is None:
            raise click.UsageError("Missing argument 'RECIPE'.")
        command(recipe=recipe, ray=ray, **values)

    return ordered


@click.command("build")
@click.argument("recipe", type=LocalPath(path_type=Path), required=False, metavar="RECIPE", shell_complete=RECIPES)
@output_option(
    click.STRING,
    "Where to put it; datasets/<recipe> by default. A URL, such as s3://bucket/name: built there, then copied.",
    metavar="DIR|URL",
)
@click.option("--locked", is_flag=True, help="Build nothing unless the recipe still compiles to its lockfile.")
@click.option(
    "--only-locked",
    "--frozen",
    "only_locked",
    is_flag=True,
    help="Build only the variants that the lockfile lists; leave out those added since.",
)
@click.option(
    "--ray",
    is_flag=False,
    flag_value="local",
    metavar="[ADDRESS]",
    help="Distribute the work on a Ray cluster: at ADDRESS, or started on this host.",
)
@click.option("--repair", is_flag=True, help="Hash every file of the existing dataset, and rebuild damaged ones.")
@replace_option("Replace the dataset of another recipe, finished or not.")
@click.option("--explain", is_flag=True, help="Print why each stage runs or is skipped.")
@DEVICE
@WORKERS
@ALLOW_LARGE
@JSON
@_recipe_first
@unpacks("recipe", keep="source")
def command(*, explain: bool, as_json: bool, **options: Any) -> None:
    """Build RECIPE's dataset, and check it against its lockfile if there is one."""
    request = Request(**options)
    inputs = _inputs(request)
    outcome = _build(request, inputs)
    if as_json:
        print_json(build_report.document(outcome, explain=explain))
    else:
        build_report.print_outcome(outcome, inputs.compiled, explain=explain)
    if outcome.lockfile_differences:
        for difference in outcome.lockfile_differences:
            say(difference, err=True)
        raise click.exceptions.Exit(1)


def _inputs(request: Request) -> Inputs:
    """Check the arguments, compile the recipe and read its lockfile.

    Raises:
        InputError: the arguments contradict each other, the recipe does not compile, it does not match a lockfile that
            it must match, or the URL cannot be reached or holds the dataset of another recipe.
    """
    recipe, output, target = request.recipe, request.output, None
    check_utf8(request.source)
    folder = _named_folder(request)
    workers = None if request.ray else worker_count(request.workers)  # a cluster's memory is not this host's
    free = free_disk(folder or Path())
    compiled = compile_quietly(recipe, allow_large=request.allow_large, free_disk=free, workers=workers)
    folder = folder or check_default_folder(Path("datasets")) / compiled.plan.recipe
    lock = read_lockfile(recipe, compiled.plan)
    files = _packed_files(recipe, compiled, lock)
    to_build = _compared(request, compiled, lock)
    if to_build.plan.digest != compiled.plan.digest:
        files = None  # a dataset contains no recipe of which it is a part
    if output and "://" in output:
        from recipe_runtime.transfer.upload import Target

        target = Target(output, folder)
        if not request.replace:
            target.check_replaceable(compiled.plan.recipe)
    return Inputs(to_build, folder, lock, files, target)


def _named_folder(request: Request) -> Path | None:
    """Return the folder that the command names; None if it names none, or a URL.

    Raises:
        InputError: the arguments contradict each other.
    """
    from recipe_compiler.ir.errors import InputError

    output = request.output
    if request.ray and request.device not in ("cpu", "cuda"):
        raise InputError(f"--device {request.device}: on a cluster, every worker has a GPU of its own; write cuda")
    if output is None:
        return None
    if "://" not in output:
        if url := url_with_one_slash(output):
            raise InputError(f"{shown(output)}: there is no folder of that name", help=f"did you mean {shown(url)}?")
        return Path(output)
    if request.repair:
        url = shown(output)
        raise InputError(
            f"--repair repairs a folder, not {url}; repair that, then build with --output {url} to copy it"
        )
    return None


def _packed_files(recipe: Path, compiled: Compiled, lock: tuple[Path, Lockfile] | None) -> RecipeFiles | None:
    """Return the files of the recipe for the dataset; None, with a note, if a pack does not allow their names."""
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.build.recipe_files import RecipeFiles

    try:
        return RecipeFiles(recipe.name, recipe_files(recipe, compiled), lock[1] if lock else None)
    except InputError as error:
        note(f"the dataset will not contain its recipe: {error}")
        return None


def _build(request: Request, inputs: Inputs) -> Outcome:
    """Build the dataset, copy it to a URL if one was given, and compare it with the lockfile."""
    from recipe_runtime.build.pipeline import BuildOptions, build

    compiled, target, reasons = inputs.compiled, inputs.target, list[str]()
    # 0: as many as the cluster has room for. Counting this host's raises before the work if there is no such device.
    workers = (request.workers or 0) if request.ray else worker_count(request.workers, request.device)
    kept = partial(build_report.interruption, compiled.plan, inputs.folder, request.repair, target)
    with interruptible(kept), held_notes() as notice, Progress() as progress, _runner(request.ray) as run:
        options = BuildOptions(
            workers=workers,
            progress=progress,
            device=request.device,
            engines=engines_for(compiled),
            explain=reasons.extend,
            run=run,
            repair=request.repair,
            source=request.source,
            replace=request.replace,
            recipe_files=inputs.files,
            notice=notice,
        )
        result = build(compiled.plan, inputs.folder, options)
        copied = target.put(progress, replace=request.replace, notice=notice) if target else None
    differences = _lockfile_differences(inputs.lock, request.recipe, compiled, result)
    return Outcome(inputs.folder, result, request.repair, reasons, target, copied, differences)


@contextmanager
def _runner(ray: str | None) -> Iterator[Runner]:
    """The runner of the build's jobs: processes of this host, or those of a Ray cluster."""
    from recipe_runtime.build import local

    if ray is None:
        yield local.run
        return
    from recipe_runtime.build.ray import joined

    with joined(None if ray == "local" else ray) as run:
        yield run


def _compared(request: Request, compiled: Compiled, lock: tuple[Path, Lockfile] | None) -> Compiled:
    """Compare a recipe with its lockfile before the work, and return what is to be built.

    With `--only-locked`, these are the variants that the lockfile lists.

    Raises:
        InputError: the recipe must match its lockfile and does not, or there is none.
    """
    from recipe_compiler.ir.errors import Code, InputError, Problem
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.verify.compare import compare_files, compare_plans, text_note

    plan, must_match = compiled.plan, request.locked or request.only_locked
    if lock is None:
        if must_match:
            place = lockfile_path(request.recipe, plan.recipe)
            raise InputError(f"{place}: there is no lockfile; `recipe lock` writes it")
        return compiled
    path, known = lock
    if text := text_note(known, plan.digest, compiled.files):
        note(text)
    differences = [] if request.only_locked else compare_files(plan, known, compiled.files)
    if request.only_locked:
        by_name = {v.variant: v for v in plan.variants}
        variants = tuple(by_name[name] for name in known.variants if name in by_name)
        others = {name: getattr(plan, name) for name in DatasetPlan.model_fields}
        plan = DatasetPlan.model_validate(others | {"variants": variants})  # a copy would keep the digest
    differences += compare_plans(plan, known)
    if differences and must_match:
        remedy = "`recipe lock --update` locks the recipe's current content"
        raise InputError(
            [Problem(f"{path}: {difference}", help=remedy, code=Code.OUTDATED_LOCKFILE) for difference in differences]
        )
    if differences:
        remedy = "the current recipe is built, and the exit code is 1; --locked refuses this"
        what = f"{path} is outdated: {differences[0].message}"
        warn(Problem(what, help=remedy, code=Code.OUTDATED_LOCKFILE))
    files = known.files if request.only_locked and not request.locked else compiled.files
    return replace(compiled, plan=plan, files=files)


def _lockfile_differences(
    locked: tuple[Path, Lockfile] | None, recipe: Path, compiled: Compiled, result: BuildResult
) -> list[str] | None:
    """The differences from the lockfile, in the order of the stages; None if there is no lockfile."""
    from recipe_runtime.cache.store import Store
    from recipe_runtime.dataset.reader import lock_of
    from recipe_runtime.verify.compare import compare_locks
    from recipe_runtime.verify.motion_comparison import body_differences

    if locked is None:
        return None
    path, lock = locked
    made = lock_of(result.manifest, source_of(recipe, path), compiled.files)
    found = compare_locks(compiled.plan, lock, made)
    if result.built:
        found += body_differences(compiled.plan, lock, Store().kept_trace)
    return [f"{path.name}: {difference}" for difference in found]
