"""`recipe verify`: re-render sample frames and compare them, byte for byte."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    WORKERS,
    LocalPath,
    PlaceOrUrl,
    Share,
    compile_quietly,
    dataset_at,
    engines_for,
    opened,
    shown,
    worker_count,
)
from recipe_cli.console import COLOURS, Styled, fail, print_json, row, say, state
from recipe_cli.host_limits import check_bytes, check_cost
from recipe_cli.lockfile_paths import FOLDER, check_lockfile_is_of, lockfile_path, recipe_of
from recipe_cli.places import check_default_folder
from recipe_cli.progress import Progress, interruptible
from recipe_cli.suggestions import check_exists

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem
    from recipe_runtime.verify.verdict import Report
    from recipe_runtime.verify.verify import Options

_EXIT = {"PASS": 0, "FAIL": 1, "INCONCLUSIVE": 3}
_MAX_SHOWN = 20


@click.command("verify")
@click.argument("targets", nargs=-1, type=PlaceOrUrl(path_type=Path))
@click.option("--nonce", type=click.IntRange(0, 2**53 - 1), help="Draw the sample of an earlier run again.")
@click.option(
    "--confidence",
    type=Share(0.5, 0.9999),
    default=0.95,
    show_default=True,
    help="Confidence that a smaller fraction of frames than --bound differs.",
)
@click.option(
    "--bound",
    type=Share(0.0001, 0.9),
    default=0.05,
    show_default=True,
    help="Fraction of differing frames that the sample must detect.",
)
@click.option("--frames", type=click.IntRange(1), help="Check this many frames, whatever the bound.")
@click.option("--all", "everything", is_flag=True, help="Check every frame.")
@click.option("--integrity", is_flag=True, help="Hash the files of dataset folders, and render nothing.")
@click.option(
    "--against",
    type=PlaceOrUrl(path_type=Path, file_okay=False),
    metavar="DATASET",
    help="Compare this dataset, a folder or a URL, with the recipe given.",
)
@click.option(
    "--pictures",
    type=LocalPath(path_type=Path, file_okay=False),
    default=Path("differences"),
    show_default=True,
    help="Folder for pictures of differing frames.",
)
@DEVICE
@WORKERS
@ALLOW_LARGE
@JSON
def command(
    targets: tuple[Path | str, ...],
    nonce: int | None,
    confidence: float,
    bound: float,
    frames: int | None,
    everything: bool,
    integrity: bool,
    against: Path | str | None,
    pictures: Path,
    device: str,
    allow_large: bool,
    workers: int | None,
    as_json: bool,
) -> None:
    """Re-render sample frames of TARGETS and compare bytes.

    A target is a recipe (with its lockfile), a pack, a lockfile (with its recipe), or a dataset, as a folder or a URL
    (s3://bucket/name); without any, all lockfiles. With --against, the dataset is compared with the recipe and its
    lockfile; if there is no lockfile, with the digests in the dataset's manifest. Exit code 0: PASS, 1: FAIL, 2: a
    target cannot be read, 3: INCONCLUSIVE. Several targets: 1 if one fails, else 2 if one cannot be read, else 3 if
    one is inconclusive, else 0.
    """
    from recipe_compiler.ir.errors import InputError, RunError
    from recipe_runtime.core.host import fresh_nonce
    from recipe_runtime.verify.verify import Options

    _check_options(targets, against, integrity=integrity, everything=everything, frames=frames)
    options = Options(
        nonce=fresh_nonce() if nonce is None else nonce,
        confidence=confidence,
        bound=bound,
        count=frames,
        everything=everything,
        workers=worker_count(workers, device),
        device=device,
        pictures=_checked_pictures(pictures),
        allow_large=allow_large,
    )

    def check(target: Path | str) -> Report:
        if integrity:
            return _integrity(target, options)
        check_exists(target)
        with opened(target) if isinstance(target, Path) else nullcontext(target) as place:
            return _verify(place, options, against)

    again = "; with --all, it is resumed" if everything else f"; --nonce {options.nonce} draws this sample again"
    with interruptible(lambda: ("interrupted", f"verify again{'' if integrity else again}")):
        verdicts, problems, stopped = _each(targets or _all_lockfiles(), check, as_json)
    if problems and "FAIL" not in verdicts:
        raise (RunError if stopped else InputError)(problems)
    if problems:
        fail(problems)
    elif as_json:
        print_json(state().partial["reports"])
    raise click.exceptions.Exit(min((_EXIT[verdict] for verdict in verdicts), key=(1, 3, 0).index))


def _check_options(
    targets: Sequence[Path | str], against: Path | str | None, *, integrity: bool, everything: bool, frames: int | None
) -> None:
    """InputError for options that contradict each other or the targets."""
    from recipe_compiler.ir.errors import InputError

    if everything and frames is not None:
        raise InputError("--all checks every frame, and --frames a number of them; give one of the two")
    if against is not None and (len(targets) != 1 or _is_dataset(targets[0]) or integrity):
        raise InputError("--against compares a dataset with one recipe or lockfile; name that one")


def _checked_pictures(folder: Path) -> Path | None:
    """Return the folder for pictures; None if it is the default and in a dataset, to which nothing is added.

    Raises:
        InputError: it is the default and a symbolic link.
    """
    if click.get_current_context().get_parameter_source("pictures") is not ParameterSource.DEFAULT:
        return folder
    return None if Path("manifest.json").exists() else check_default_folder(folder, "--pictures")


def _each(
    targets: Sequence[Path | str], check: Callable[[Path | str], Report], as_json: bool
) -> tuple[list[str], list[Problem], bool]:
    """Check each target; each report is printed or kept.

    Returns:
        The verdicts, the problems of the targets that cannot be checked, and whether the host failed at one of them.
    """
    from recipe_compiler.ir.errors import InputError, RunError

    verdicts: list[str] = []
    problems: list[Problem] = []
    unread: list[Problem] = []  # the warnings of targets without a report
    run, stopped = state(), False
    for target in targets:
        try:
            report = check(target)
        except (InputError, RunError) as error:
            problems += error.problems
            stopped = stopped or isinstance(error, RunError)
            unread, run.warnings = [*unread, *run.warnings], []
            continue
        verdicts.append(report.verdict)
        warnings, run.warnings = [row(warning) for warning in run.warnings], []
        run.partial.setdefault("reports", []).append({**report.document(), "warnings": warnings})
        if not as_json:
            _say(target, report)
    run.warnings = unread
    return verdicts, problems, stopped


def _recipe_of(path: Path) -> Path:
    """Return the recipe that a lockfile names.

    Raises:
        InputError: it does not exist.
    """
    from recipe_compiler.ir import lockfile
    from recipe_compiler.ir.errors import Code, InputError

    recipe = recipe_of(path, lockfile.read_source(path))
    if not recipe.exists():
        remedy = "if it was renamed: `recipe verify NEW.yaml`, then `recipe lock NEW.yaml --update`"
        raise InputError(f"{path} names {recipe}, which does not exist", help=remedy, code=Code.FILE_NOT_FOUND)
    return recipe


def _all_lockfiles() -> list[Path]:
    from recipe_compiler.ir.errors import InputError

    found = sorted(Path(FOLDER).glob("*.lock"))
    if not found:
        raise InputError(f"there is no {FOLDER}/*.lock here; name a recipe, a lockfile or a dataset folder")
    return found


def _is_dataset(target: Path | str) -> bool:
    """Return whether a target is the folder or the URL of a dataset."""
    return not isinstance(target, Path) or target.is_dir()


def _integrity(target: Path | str, options: Options) -> Report:
    """Compare the digests of a dataset's files with its manifest."""
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.dataset import reader
    from recipe_runtime.verify.verify import verify_files

    if not _is_dataset(target):
        raise InputError(f"{target}: --integrity hashes the files of a dataset folder; name one")
    with Progress() as progress, dataset_at(target, progress) as folder:
        dataset = reader.read(folder, shown(target))
        check_bytes(dataset, allow_large=options.allow_large)
        return verify_files(dataset, options, progress)


def _verify(target: Path | str, options: Options, against: Path | str | None) -> Report:
    from recipe_compiler.ir import lockfile
    from recipe_runtime.cache.store import default_cache
    from recipe_runtime.dataset import reader
    from recipe_runtime.verify import trace_bundle
    from recipe_runtime.verify.verify import verify

    allow_large, options = options.allow_large, replace(options, cache=default_cache())
    with Progress() as progress, ExitStack() as stack:
        if not isinstance(target, Path) or target.is_dir():
            folder = reader.read(stack.enter_context(dataset_at(target, progress)), shown(target))
            remedy = "pass --allow-large if that is meant, or hash the files alone (--integrity)"
            check_cost(folder.plan, shown(target), remedy, allow_large=allow_large)
            return verify(folder.plan, folder.lock, options, progress, dataset=folder)
        held = None
        if against is not None:
            held = reader.read(stack.enter_context(dataset_at(against, progress)), shown(against))
        if target.suffix == ".lock":
            path, compiled = target, compile_quietly(_recipe_of(target), allow_large=allow_large)
            lock = lockfile.read(path)
        else:
            compiled = compile_quietly(target, allow_large=allow_large)
            path = lockfile_path(target, compiled.plan.recipe)
            lock = held.lock if held is not None and not path.exists() else lockfile.read(path)
            if held is None or lock is not held.lock:
                check_lockfile_is_of(target, compiled.plan, path, lock)
        held_traces = trace_bundle.read(trace_bundle.beside(path), lock.traces, trace_bundle.size_limits(compiled.plan))
        return verify(
            compiled.plan,
            lock,
            options,
            progress,
            files=None if held is not None and lock is held.lock else compiled.files,  # a dataset's own lists none
            dataset=held,
            traces=held_traces,
            engines=engines_for(compiled),
        )


def _say(target: Path | str, report: Report) -> None:
    stage = f" at {report.stage}" if report.stage else ""
    say(Styled(report.verdict, COLOURS[report.verdict]), f"{stage}  {shown(target)}")
    say(f"  {report.identity}")
    for difference in report.differences[:_MAX_SHOWN]:
        say(f"  {difference}")
    if len(report.differences) > _MAX_SHOWN:
        say(f"  ... and {len(report.differences) - _MAX_SHOWN} more; --json lists all")
    for note in report.notes:
        say(f"  note: {note}")
    for picture in report.pictures:
        say(f"  see {picture}")
    say(f"  {report.extent}" + ("" if report.files is not None else f" (nonce {report.nonce})"))
