"""The result of a comparison: differences, each at a stage, and the verdict that follows from them.

A difference is FAIL if this host promises equal bytes. It is INCONCLUSIVE, with the reason, if `excuses` has an excuse
for it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Literal

from recipe_compiler.ir.plurals import count, form

from recipe_runtime.verify.sampling import Bound

Verdict = Literal["PASS", "FAIL", "INCONCLUSIVE"]

# In pipeline order: the first stage that differs is part of the verdict. `recipe diff` also reports `tools`.
ORDER = ("lockfile", "recipe", "plan", "trace", "observation", "labels", "shading", "encoding", "file")


@dataclass(frozen=True)
class Difference:
    """One difference, and the stage at which it occurs.

    `recipe verify` fills all fields, `recipe diff` only the stage and the message.
    """

    stage: str
    message: str
    excuse: str | None = None  # why this host need not agree; None if it must
    variant: str | None = None
    sensor: str | None = None
    frame: int | None = None
    modality: str | None = None
    path: str | None = None  # path of the dataset's file that differs
    recorded: str | None = None  # a digest or a pixel value, from the lockfile or dataset
    rendered: str | None = None  # the same, as rendered on this host

    def __str__(self) -> str:
        return f"{self.stage}: {self.message}" + (f" ({self.excuse})" if self.excuse else "")


@dataclass
class Report:
    """What was compared, the differences, and the verdict."""

    name: str
    identity: str
    nonce: int
    bound: Bound
    differences: list[Difference] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    files: int | None = None  # number of files hashed, if nothing was rendered
    notes: list[str] = field(default_factory=list)  # remarks for the user that do not affect the verdict
    resumed: int = 0  # number of compared frames that an interrupted run had rendered

    @property
    def stage(self) -> str | None:
        """The first stage that differs, or None."""
        return min((d.stage for d in self.differences), key=ORDER.index, default=None)

    @property
    def verdict(self) -> Verdict:
        """FAIL if there is an unexcused difference, INCONCLUSIVE if there are only excused ones, else PASS."""
        if any(d.excuse is None for d in self.differences):
            return "FAIL"
        return "INCONCLUSIVE" if self.differences else "PASS"

    @property
    def extent(self) -> str:
        """How much was compared, and what it proves; the bound is stated only if nothing differs."""
        if self.files is not None:
            hashed = f"{count(self.files, 'file')} hashed, no frame rendered"
            return f"{hashed}; the identity covers pixels and labels, which were not compared with the files"
        resumed = f"; {self.resumed:,} were rendered by the run that was stopped" if self.resumed else ""
        if self.verdict == "PASS":
            return f"{self.bound}{resumed}"
        if self.bound.checked == 0:
            return f"none of {count(self.bound.total, 'frame')} compared, because what precedes rendering differs"
        frames = {(d.variant, d.sensor, d.frame) for d in self.differences if d.frame is not None}
        which = f"{len(frames)} of them {form(len(frames), 'differs', 'differ')}"
        if not frames:
            files = len({d.path for d in self.differences if d.path is not None})
            which = "no rendered frame differs"
            which += f", but {count(files, 'file')} of the dataset {form(files, 'does', 'do')}" if files else ""
        return f"{self.bound.checked} of {count(self.bound.total, 'frame')} compared, {which}{resumed}"

    def document(self) -> dict[str, object]:
        """The report in `recipe verify --json`."""
        below = round(self.bound.differing, 6) if self.verdict == "PASS" and self.files is None else None
        return {
            "name": self.name,
            "identity": self.identity,
            "verdict": self.verdict,
            "stage": self.stage,
            "nonce": self.nonce,
            "checked": self.bound.checked,
            "total": self.bound.total,
            "confidence": self.bound.confidence,
            "differing_below": below,
            "differences": [asdict(difference) for difference in self.differences],
            "pictures": self.pictures,
            "notes": self.notes,
            "resumed_frames": self.resumed,
        }
