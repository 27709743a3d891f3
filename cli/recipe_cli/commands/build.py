"""`recipe build`: the dataset."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    RECIPES,
    REPLACE,
    WORKERS,
    LocalPath,
    compile_quietly,
    engines_for,
    shown,
    unpacks,
    worker_count,
)
from recipe_cli.console import fail, print_json, say, warn
from recipe_cli.places import free_disk, lockfile_path, read_lockfile, recipe_files, source_of
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.ir.lockfile import Lockfile
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.build.pipeline import BuildResult, Runner
    from recipe_runtime.transfer.upload import Target


_MOST_SHOWN = 20


def _recipe_first(command: Callable[..., None]) -> Callable[..., None]:
    """`build --ray rain.yaml` means a recipe, not a cluster of that name."""

    @functools.wraps(command)
    def ordered(recipe: Path | None, ray: str | None, **values: Any) -> None:
        if recipe is None and ray is not None and Path(ray).suffix in (".yaml", ".yml", ".recipe"):
            recipe, ray = Path(ray), "local"
        if recipe is None:
            raise click.UsageError("Missing argument 'RECIPE'.")
        command(recipe=recipe, ray=ray, **values)

    return ordered


@click.command("build")
@click.argument("recipe", type=LocalPath(path_type=Path), required=False, metavar="RECIPE", shell_complete=RECIPES)
@click.option(
    "--out",
    metavar="DIR|URL",
    help="Where to put it; datasets/<recipe> by default. A URL, such as s3://bucket/name: built there, then copied.",
)
@click.option("--locked", is_flag=True, help="Build nothing unless the recipe still compiles to its lockfile.")
@click.option("--frozen", is_flag=True, help="Build the variants of the lockfile, and none that came later.")
@click.option(
    "--ray",
    is_flag=False,
    flag_value="local",
    metavar="[ADDRESS]",
    help="Share the work out on a Ray cluster: at ADDRESS, or one of this host's own.",
)
@click.option(
    "--repair", is_flag=True, help="Hash every file of the dataset that is there, and make again what is damaged."
)
@REPLACE
@click.option("--explain", is_flag=True, help="Say why each stage runs, or does not.")
@DEVICE
@WORKERS
@ALLOW_LARGE
@JSON
@_recipe_first
@unpacks("recipe", keep="source")
def command(
    recipe: Path,
    source: Path,
    out: str | None,
    locked: bool,
    frozen: bool,
    ray: str | None,
    repair: bool,
    replace: bool,
    explain: bool,
    device: str,
    workers: int | None,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Build RECIPE's dataset, and check it against its lockfile if there is one."""
    from recipe_compiler.ir.errors import Code, InputError, Problem

    if ray and device not in ("cpu", "cuda"):
        raise InputError(f"--device {device}: on a cluster, every worker has a GPU of its own; write cuda")
    folder = Path(out) if out and "://" not in out else None
    if repair and out and folder is None:
        url = shown(out)
        raise InputError(f"--repair mends a folder, not {url}; repair that, then build with --out {url} to copy it")
    here = None if ray else worker_count(workers)  # a cluster's memory is not this host's
    compiled = compile_quietly(recipe, allow_large=allow_large, free_disk=free_disk(folder or Path()), workers=here)
    folder = folder or Path("datasets") / compiled.plan.recipe
    lock = read_lockfile(recipe, compiled.plan)
    _note_text(compiled, lock)
    from recipe_runtime.build.recipe_files import RecipeFiles

    files = RecipeFiles(recipe.name, recipe_files(recipe, compiled), lock[1] if lock else None)
    if locked or frozen:
        plan = _agreed(recipe, compiled, lock, frozen)
        compiled = dataclasses.replace(
            compiled, plan=plan, files=compiled.files if locked or lock is None else lock[1].files
        )
    elif lock is not None:
        _warn_if_outdated(compiled, *lock)
    target = _target(out, compiled.plan, replace) if out and "://" in out else None
    from recipe_runtime.build.pipeline import build

    reasons: list[str] = []
    # On a cluster, as many as it has room for; here, one a core. Says before the work if there is no such device.
    hands = (workers or 0) if ray else worker_count(workers, device)
    try:
        with Progress() as progress, _runner(ray) as run:
            result = build(
                compiled.plan,
                folder,
                workers=hands,
                progress=progress,
                device=device,
                engines=engines_for(compiled),
                explain=reasons.extend,
                run=run,
                repair=repair,
                source=source,
                replace=replace,
                recipe_files=files,
            )
            copied = target.put(result.path, progress, replace=replace) if target else None
    except KeyboardInterrupt:
        what, remedy = _interrupted(compiled.plan, folder, repair, target)
        fail([Problem(what, help=remedy, code=Code.INTERRUPTED)])
        raise click.exceptions.Exit(130) from None
    differences = _against(lock, recipe, compiled, result)
    if as_json:
        print_json(
            {"path": str(folder), "identity": result.identity, "built": result.built, "wall": round(result.wall, 3)}
            | {"seconds": {stage: round(s, 3) for stage, s in sorted(result.seconds.items())}}
            | ({"explain": reasons} if explain else {})
            | ({"url": target.url, **asdict(copied)} if target and copied else {})
            | ({"mended": list(result.mended)} if repair else {})
            | {"resumed_shards": result.resumed, "shards": result.shards, "resumed_frames": result.resumed_frames}
            | {"made_frames": result.made_frames, "taken_frames": result.taken_frames}
            | {"lockfile_differences": differences}
        )
    else:
        for reason in reasons if explain else ():
            say(reason)
        _say(compiled, folder, result, repair)
        if target and copied:
            told = f"{count(copied.sent, 'file')} sent, {copied.copied:,} copied there, {copied.kept:,} there already"
            say(f"{target.url}: {told}")
    if differences:
        for difference in differences:
            say(difference, err=True)
        raise click.exceptions.Exit(1)


def _target(url: str, plan: DatasetPlan, replace: bool) -> Target:
    """Where a URL leads; says before the work if that is nowhere, or holds another recipe's dataset."""
    from recipe_runtime.transfer.upload import Target

    target = Target(url)
    if not replace:
        target.check_replaceable(plan.recipe)
    return target


@contextmanager
def _runner(ray: str | None) -> Iterator[Runner]:
    """What does the work: processes of this host, or a cluster's."""
    from recipe_runtime.build import local

    if ray is None:
        yield local.run
        return
    from recipe_runtime.build.ray import joined

    with joined(None if ray == "local" else ray) as run:
        yield run


def _agreed(recipe: Path, compiled: Compiled, lock: tuple[Path, Lockfile] | None, frozen: bool) -> DatasetPlan:
    """The plan as far as the lockfile knows it; InputError if a locked variant is another now, or there is no lockfile.

    Unless `frozen`, the whole plan must be the lockfile's.
    """
    from recipe_compiler.ir.errors import Code, InputError, Problem
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.verify.compare import compare_files, compare_plans

    if lock is None:
        raise InputError(
            f"{lockfile_path(recipe, compiled.plan.recipe)}: there is no lockfile; `recipe lock` writes it"
        )
    path, known = lock
    plan, differences = compiled.plan, [] if frozen else compare_files(compiled.plan, known, compiled.files)
    if frozen:
        by_name = {v.variant: v for v in plan.variants}
        variants = tuple(by_name[name] for name in known.variants if name in by_name)
        plan = DatasetPlan.model_validate(
            {n: getattr(plan, n) for n in DatasetPlan.model_fields} | {"variants": variants}
        )
    differences += compare_plans(plan, known)
    if differences:
        remedy = "`recipe lock --update` locks what the recipe says now"
        raise InputError(
            [Problem(f"{path}: {difference}", help=remedy, code=Code.OUTDATED_LOCKFILE) for difference in differences]
        )
    return plan


def _warn_if_outdated(compiled: Compiled, path: Path, known: Lockfile) -> None:
    """Say before the work that its end will differ from the lockfile."""
    from recipe_compiler.ir.errors import Code, Problem
    from recipe_runtime.verify.compare import compare_files, compare_plans

    found = compare_files(compiled.plan, known, compiled.files) or compare_plans(compiled.plan, known)
    if found:
        remedy = "this builds what the recipe says now, and ends with exit code 1; --locked refuses to"
        warn(Problem(f"{path} is outdated: {found[0].message}", help=remedy, code=Code.OUTDATED_LOCKFILE))


def _note_text(compiled: Compiled, lock: tuple[Path, Lockfile] | None) -> None:
    """Say in one line that the recipe's text is not the locked one, where that changes nothing."""
    from recipe_runtime.verify.compare import text_note

    note = text_note(lock[1], compiled.plan.digest, compiled.files) if lock else None
    if note:
        say(f"note: {note}", err=True)


def _against(
    locked: tuple[Path, Lockfile] | None, recipe: Path, compiled: Compiled, result: BuildResult
) -> list[str] | None:
    """What differs from the lockfile, in the order of the stages; None if there is no lockfile."""
    from recipe_runtime.dataset.reader import lock_of
    from recipe_runtime.verify.compare import compare_locks

    if locked is None:
        return None
    path, lock = locked
    made = lock_of(result.manifest, source_of(recipe, path), compiled.files)
    return [f"{path.name}: {difference}" for difference in compare_locks(compiled.plan, lock, made)]


def _interrupted(plan: DatasetPlan, folder: Path, repair: bool, target: Target | None) -> tuple[str, str]:
    """What an interrupted build leaves behind, and how to go on."""
    from recipe_runtime.build.pipeline import kept_frames
    from recipe_runtime.build.workspace import read_manifest
    from recipe_runtime.dataset.manifest import is_whole

    kept, manifest = kept_frames(plan, folder), read_manifest(folder)
    if kept:
        again = "run it again with --repair" if repair else "build again"  # a plain build goes by sizes alone
        return f"interrupted; {kept:,} of {count(_frames(plan), 'frame')} are kept", f"{again} to go on"
    if repair:  # it may have been stopped before the mended dataset was put in place, or after
        return "interrupted", "run it again with --repair to mend what is still damaged"
    if manifest is not None and is_whole(manifest, plan, folder):
        return f"interrupted; {folder} is whole", f"build again to go on copying it to {target.url}" if target else ""
    return "interrupted; no frame was finished yet", "build again to start over"


def _frames(plan: DatasetPlan) -> int:
    return sum(v.scene.clock.frames * len(v.rig.sensors) for v in plan.variants)


def _say(compiled: Compiled, out: Path, result: BuildResult, repair: bool) -> None:
    for line in result.mended[:_MOST_SHOWN]:
        say(f"mended: {line}")
    if len(result.mended) > _MOST_SHOWN:
        say(f"  ... and {len(result.mended) - _MOST_SHOWN} more; --json lists all")
    if result.built:
        number, every = len(compiled.plan.variants), compiled.cost.variants  # a frozen build may leave some out
        what = count(every, "variant") if number == every else f"{number} of {count(every, 'variant')}"
        if number == every and not (result.taken_frames or result.resumed_frames):
            what = str(compiled.cost)  # all of it was this build's work
        say(f"{out}: {what}; {_done(result)}")
    elif repair:
        say(f"{out}: there already, and every file has the bytes that its manifest says")
    else:
        say(f"{out}: there already (sizes checked; `recipe verify {out}` checks bytes, --repair mends them)")
    say(f"look at {out / 'preview' / 'contact_sheet.png'}")
    say(result.identity)


def _done(result: BuildResult) -> str:
    """What this build did for how many frames, and what others had done; a rate is of its own work alone."""
    made, seconds = result.made_frames, f"{result.wall:.1f} s"
    others = (
        (result.taken_frames, "taken over from the dataset that was there"),
        (result.resumed_frames, "taken up from the stopped build"),
    )
    known = [f"{number:,} {whence}" for number, whence in others if number]
    if not known:
        return f"{count(made, 'frame')} rendered in {seconds}, {made / max(result.wall, 1e-9):.1f} a second"
    own = f"{made:,} rendered" if made else "none rendered"
    total = count(made + result.taken_frames + result.resumed_frames, "frame")
    return f"{total}: {', '.join([own, *known])}; {seconds}"
