"""The self-test of `recipe doctor`: describes the host, builds a golden recipe and compares every stage.

The digests are in `golden/`, next to the recipe; they are part of the release. A stage that differs is reported with a
reason, if a difference is to be expected on this host. Later stages are inconclusive then.
"""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypedDict

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import RecipeError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import host, layout
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.versions import host_versions
from recipe_runtime.dataset.manifest import lock_of
from recipe_runtime.dataset.manifest_types import FileRecord
from recipe_runtime.frames.engines import Engines
from recipe_runtime.loading import compiled
from recipe_runtime.verify.compare import compare_locks
from recipe_runtime.verify.excuses import own_excuse_of
from recipe_runtime.verify.verdict import Difference

GOLDEN = Path(__file__).parent / "golden"
RECIPE, LOCK, FILES = (GOLDEN / f"self_test.{kind}" for kind in ("yaml", "lock", "files"))

# In pipeline order, with a description of what is compared.
STAGES = {
    "plan": "plans compiled",
    "trace": "motion simulated",
    "observation": "depth, instances and classes",
    "labels": "boxes, masks and the rest",
    "shading": "colours",
    "encoding": "picture files",
    "annotate": "annotation files",
}
State = Literal["equal", "differs", "may differ", "not reached"]


class Fingerprint(TypedDict):
    """Properties of the host that the bytes or the speed of a build may depend on; no name of a host, user or path."""

    processor: str
    features: list[str]
    cores: int
    system: str
    gpus: list[str]
    versions: dict[str, str]


@dataclass(frozen=True)
class Check:
    """The result of one stage. `reason` is what differs, and why it may."""

    stage: str
    state: State
    reason: str = ""


@dataclass
class Examination:
    """The result of the self-test."""

    fingerprint: Fingerprint
    checks: list[Check] = field(default_factory=list)
    gpu: list[Check] = field(default_factory=list)  # the pixels on the first GPU; empty without a GPU

    @property
    def tiers(self) -> dict[str, str]:
        """Return whether this host keeps each promise: yes, no, or why it is unknown."""
        found = {"A": "yes" if all(c.state == "equal" for c in self.checks) else "no"}
        if any(c.state == "may differ" for c in self.checks) and all(c.state != "differs" for c in self.checks):
            found["A"] = "not promised here: " + next(c.reason for c in self.checks if c.state == "may differ")
        seen = [c.state for c in self.gpu if c.stage in ("observation", "labels", "shading")]
        found["B"] = "no CUDA GPU here" if not seen else "yes" if set(seen) == {"equal"} else "no"
        return found

    @property
    def healthy(self) -> bool:
        """Whether there is no unexcused difference, and tier A holds or is unknown."""
        return self.tiers["A"] != "no" and all(check.state != "differs" for check in (*self.checks, *self.gpu))


def examine(progress: Progress, engines: Engines | None = None, gpus: list[str] | None = None) -> Examination:
    """Describe this host, and run the self-test on the CPU and on the first GPU, if there is one."""
    gpus = _gpus() if gpus is None else gpus
    plan = compiled(RECIPE)
    found = Examination(fingerprint(gpus))
    found.checks = self_test(plan, progress, engines=engines)
    if gpus:
        found.gpu = self_test(plan, progress, engines=engines, device=gpus[0])
    return found


def fingerprint(gpus: list[str]) -> Fingerprint:
    """Describe this host; `gpus` are the names of its CUDA devices."""
    return {
        "processor": _processor(),
        "features": host.features(),
        "cores": len(os.sched_getaffinity(0)),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "gpus": gpus,
        "versions": host_versions(),
    }


def self_test(
    plan: DatasetPlan, progress: Progress, *, engines: Engines | None = None, device: str = "cpu"
) -> list[Check]:
    """Build the golden recipe, and compare it stage by stage."""
    golden = lockfile.read(LOCK)
    with tempfile.TemporaryDirectory(prefix="recipe-doctor-") as folder:
        root = Path(folder)
        try:
            made = build(
                plan,
                root / "made",
                BuildOptions(workers=0, cache=root / "cache", device=device, engines=engines, progress=progress),
            )
        except RecipeError as error:
            return [Check(stage, "not reached", str(error).splitlines()[0]) for stage in STAGES]
        lock = lock_of(made.manifest, golden.source, golden.files)
        differences = [d for d in compare_locks(plan, golden, lock, own_excuse_of) if d.stage != "recipe"]
        differences += [
            Difference(stage, f"{path} differs", own_excuse_of("texts" if stage == "annotate" else stage, golden))
            for stage, path in _other_files(made.manifest["files"])
        ]
    return _checks(differences)


def file_rows(files: Mapping[str, FileRecord]) -> dict[str, str]:
    """Return the SHA-256 of every compared file; README and manifest contain versions and are not compared."""
    return {
        path: row["sha256"]
        for path, row in sorted(files.items())
        if path not in (*layout.DESCRIPTIONS, layout.MANIFEST)
    }


def _other_files(files: Mapping[str, FileRecord]) -> list[tuple[str, str]]:
    """Return the stage and path of every file that differs from the golden one."""
    rows = (line.split("  ", 1) for line in FILES.read_text().splitlines())
    golden, made = {path: value for value, path in rows}, file_rows(files)
    other = [path for path in sorted({*golden, *made}) if golden.get(path) != made.get(path)]
    return [("encoding" if path.endswith((".png", ".npy")) else "annotate", path) for path in other]


def _checks(differences: list[Difference]) -> list[Check]:
    """Return the check of every stage; differences after the first stage that differs follow from it."""
    by_stage: dict[str, list[Difference]] = {}
    for difference in differences:
        by_stage.setdefault("plan" if difference.stage == "lockfile" else difference.stage, []).append(difference)
    checks: list[Check] = []
    for stage in STAGES:
        found = by_stage.get(stage, [])
        if checks and checks[-1].state != "equal":
            checks.append(Check(stage, "not reached", "it follows from the stage before"))
        elif not found:
            checks.append(Check(stage, "equal"))
        else:
            excuse = next((d.excuse for d in found if d.excuse), None)
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            state: State = "may differ" if excuse else "differs"
            checks.append(Check(stage, state, f"{found[0].message}{more}" + (f"; {excuse}" if excuse else "")))
    return checks


def _gpus() -> list[str]:
    if host.cannot_render_reason():
        return []
    from recipe_runtime.render.device.setup import cuda_devices

    return cuda_devices()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
