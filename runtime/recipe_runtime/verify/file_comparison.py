"""Compares the files of a dataset with those that this host writes for the same frames."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import layout
from recipe_runtime.core.documents import decode
from recipe_runtime.core.files import read_inside, regular_file
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.modalities import declared, pixel_digest
from recipe_runtime.report.difference import first_difference, read_pixels
from recipe_runtime.verify.documents import walk
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.motion_comparison import OtherMotion
from recipe_runtime.verify.verdict import Difference

_LONGER = 4  # how much longer than expected a JSON file may be to be read

Place: TypeAlias = tuple[str, str, int, str | None]
"""Variant, sensor, frame and modality of a file; the modality is None for copies of labels and for truth of patches."""


@dataclass(frozen=True)
class FileComparison:
    """Compares a dataset's files with those written here.

    Args:
        plan: the plan of both.
        lock: the digests with which the frames were compared; it lists the versions of their tools.
        dataset: the dataset.
        made: the folder of the files written here, with the dataset's paths.
        other: by scene, this host's motion where it may differ from the locked motion.
    """

    plan: DatasetPlan
    lock: Lockfile
    dataset: Dataset
    made: Path
    other: Mapping[str, OtherMotion]

    def differences(self) -> list[Difference]:
        """Return the difference of each file written here from the dataset's, by path."""
        paths = sorted(path.relative_to(self.made).as_posix() for path in self.made.rglob("*") if path.is_file())
        return [found for path in paths if (found := self._difference(path)) is not None]

    def _difference(self, path: str) -> Difference | None:
        """Return the difference of one file; if the pixels are equal, it is in the encoding.

        A picture that may show other motion is compared with the dataset's own digest of it.
        """
        made, there = self.made / path, self.dataset.root / path
        if regular_file(self.dataset.root, path) is None:
            return Difference("file", f"{path} is missing", path=path)
        size = made.stat().st_size
        with suppress(OSError, ValueError):  # it is larger
            if made.read_bytes() == read_inside(self.dataset.root, path, size):
                return None
        at = self._places[path]
        other = self.other.get(self.plan.named(at[0]).scene.digest)
        if other is not None and at[2] >= other.agreed:
            return self._unlisted_pixels(path, at)
        if path.endswith(".json"):
            return Difference("file", f"{path}: {self._unequal_fields(path)}", None, *at, path=path)
        unequal = first_difference(there, made)
        if unequal is None:
            return Difference("file", f"{path} is a different picture, or not a picture", None, *at, path)
        if not unequal.count:
            message = f"{path}: equal pixels, different encoding"
            return Difference("encoding", message, excuse_of("encoding", self.lock), *at, path)
        return Difference("file", f"{path}: {unequal}", None, *at, path, unequal.recorded, unequal.rendered)

    def _unequal_fields(self, path: str) -> str:
        """Return the first field in which the dataset's JSON file differs from the one written here, in words."""
        written = (self.made / path).read_bytes()
        try:
            recorded = decode(read_inside(self.dataset.root, path, _LONGER * len(written)), dict[str, object])
            fields = list(walk(recorded, decode(written, dict[str, object]), ""))
        except (OSError, ValueError, RecursionError) as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            return f"it is not the ground truth of patches: {reason}"
        if not fields:
            return "equal values in another form"
        more = f", and in {count(len(fields) - 1, 'more field')}" if len(fields) > 1 else ""
        return f"as recorded and as rendered it differs in {fields[0].lstrip('.')}{more}"

    def _unlisted_pixels(self, path: str, at: Place) -> Difference | None:
        """Return a difference if a picture's pixels do not have the digest in the dataset's manifest.

        A rounded form, such as depth in a PNG, is not compared: the digest is of the unrounded values.
        """
        name, sensor, frame, modality = at
        if modality is None or declared(modality).files[path.rpartition(".")[2]].tolerance > 0:
            return None
        row = (digests.bare(self.plan, "", {}).variants[name].frame_key(modality), sensor, modality, frame)
        camera = next(s.camera for s in self.plan.named(name).rig.sensors if s.name == sensor)
        pixels = read_pixels(self.dataset.root / path, (camera.height, camera.width))
        if pixels is not None and pixel_digest(modality, pixels) == self.dataset.lock.frames.get(row):
            return None
        return Difference("file", f"{path} does not hold the pixels whose digest the manifest has", None, *at, path)

    @cached_property
    def _places(self) -> dict[str, Place]:
        """The place of every file of a frame."""
        found: dict[str, Place] = {}
        for variant in self.plan.variants:
            for sensor in variant.rig.sensors:
                name = variant.variant, sensor.name
                for frame in sensor.frames(variant.scene.clock.frames):
                    copies = layout.label_copies(self.plan, variant.variant, sensor, frame).values()
                    found |= dict.fromkeys([*copies, layout.patches_file(*name, frame)], (*name, frame, None))
                    for modality in sensor.capture:
                        found[layout.frame_file(*name, modality, frame, self.plan.forms)] = (*name, frame, modality)
        return found
