"""The report of `recipe build`: its JSON document, its lines on the terminal, and its message when interrupted."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from recipe_compiler.ir.plurals import count

from recipe_cli.console import say

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.ir.plan import DatasetPlan
    from recipe_runtime.build.pipeline import BuildResult
    from recipe_runtime.transfer.upload import Copied, Target

_MAX_SHOWN = 20


@dataclass(frozen=True)
class Outcome:
    """A finished build."""

    folder: Path
    result: BuildResult
    repair: bool
    reasons: list[str]  # why each stage ran, or did not
    target: Target | None
    copied: Copied | None
    lockfile_differences: list[str] | None  # None: there is no lockfile


def document(outcome: Outcome, *, explain: bool) -> dict[str, object]:
    """The JSON document of a build; `explain` adds why each stage ran."""
    result, target, copied = outcome.result, outcome.target, outcome.copied
    return (
        {"path": str(outcome.folder), "identity": result.identity, "built": result.built, "wall": round(result.wall, 3)}
        | {"seconds": {stage: round(s, 3) for stage, s in sorted(result.seconds.items())}}
        | ({"explain": _reasons(outcome)} if explain else {})
        | ({"url": target.url, **asdict(copied)} if target and copied else {})
        | ({"mended": list(result.repaired)} if outcome.repair else {})
        | {"resumed_shards": result.resumed, "shards": result.shards, "resumed_frames": result.resumed_frames}
        | {"made_frames": result.made_frames, "taken_frames": result.taken_frames}
        | {"lockfile_differences": outcome.lockfile_differences}
    )


def print_outcome(outcome: Outcome, compiled: Compiled, *, explain: bool) -> None:
    """Print a build's result for a person; `explain` first prints why each stage ran."""
    for reason in _reasons(outcome) if explain else ():
        say(reason)
    _print_result(outcome, compiled)
    target, copied = outcome.target, outcome.copied
    if target and copied:
        sent = f"{count(copied.sent, 'file')} sent, {copied.copied:,} copied there, {copied.kept:,} there already"
        say(f"{target.url}: {sent}")


def _reasons(outcome: Outcome) -> list[str]:
    return outcome.reasons if outcome.result.built else ["skip all stages: the dataset exists"]


def _print_result(outcome: Outcome, compiled: Compiled) -> None:
    out, result = outcome.folder, outcome.result
    for line in result.repaired[:_MAX_SHOWN]:
        say(f"repaired: {line}")
    if len(result.repaired) > _MAX_SHOWN:
        say(f"  ... and {len(result.repaired) - _MAX_SHOWN} more; --json lists all")
    if result.built:
        number, every = len(compiled.plan.variants), compiled.cost.variants  # --only-locked may leave some out
        what = count(every, "variant") if number == every else f"{number} of {count(every, 'variant')}"
        if number == every and not (result.taken_frames or result.resumed_frames):
            what = str(compiled.cost)  # all of it was this build's work
        say(f"{out}: {what}; {_done(result)}")
    elif outcome.repair:
        say(f"{out}: exists, and every file has the bytes that its manifest lists")
    else:
        say(f"{out}: exists (sizes checked; `recipe verify {out}` checks bytes, --repair repairs it)")
    say(f"look at {out / 'preview' / 'index.html'}")
    say(result.identity)


def interruption(plan: DatasetPlan, folder: Path, repair: bool, target: Target | None) -> tuple[str, str]:
    """Return what an interrupted build has kept, and how to continue."""
    from recipe_runtime.build.pipeline import kept_frames
    from recipe_runtime.dataset.manifest import is_whole
    from recipe_runtime.dataset.manifest_reader import read_or_none

    kept, manifest = kept_frames(plan, folder), read_or_none(folder)
    if kept:
        again = "run it again with --repair" if repair else "build again"  # a plain build goes by sizes alone
        return f"interrupted; {kept:,} of {count(_frames(plan), 'frame')} are kept", f"{again} to continue"
    if repair:  # it may have been stopped before or after the repaired dataset was put in place
        return "interrupted", "run it again with --repair to repair the rest"
    if manifest is not None and is_whole(manifest, plan, folder):
        return (
            f"interrupted; {folder} is complete",
            f"build again to continue copying it to {target.url}" if target else "",
        )
    return "interrupted; no frame was finished yet", "build again to start over"


def _frames(plan: DatasetPlan) -> int:
    return sum(len(s.frames(v.scene.clock.frames)) for v in plan.variants for s in v.rig.sensors)


def _done(result: BuildResult) -> str:
    """Return how many frames this build rendered, at what rate, and how many it reused."""
    made, seconds = result.made_frames, f"{result.wall:.1f} s"
    reused = (
        (result.taken_frames, "reused from the existing dataset"),
        (result.resumed_frames, "resumed from the stopped build"),
    )
    known = [f"{number:,} {origin}" for number, origin in reused if number]
    if not known:
        return f"{count(made, 'frame')} rendered in {seconds}, {made / max(result.wall, 1e-9):.1f} a second"
    own = f"{made:,} rendered" if made else "none rendered"
    total = count(made + result.taken_frames + result.resumed_frames, "frame")
    return f"{total}: {', '.join([own, *known])}; {seconds}"
