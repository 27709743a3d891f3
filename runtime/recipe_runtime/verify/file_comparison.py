"""Compares the files of a dataset with those that this host writes for the same frames."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import layout
from recipe_runtime.core.files import read_inside, regular_file
from recipe_runtime.core.modalities import pixel_digest
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.json_stream import loads
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.report.difference import first_difference, read_pixels
from recipe_runtime.verify.documents import walk
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.motion_comparison import OtherMotion
from recipe_runtime.verify.verdict import Difference

_LONGER = 4  # how much longer than expected a JSON file may be to be read

Picture: TypeAlias = "tuple[str, str, int, str] | tuple[()]"  # variant, sensor, frame, modality; () for other files


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
        at = self._picture(path)
        if path.endswith(".json") and not self._is_excused(path, at):
            return Difference("file", f"{path}: {self._unequal_fields(path)}", path=path)
        if self._is_excused(path, at):
            return self._unlisted_pixels(path, at)
        unequal = first_difference(there, made)
        if unequal is not None and not unequal.count:
            message = f"{path}: equal pixels, different encoding"
            found = Difference("encoding", message, excuse_of("encoding", self.lock), *at)
        elif unequal is None:
            found = Difference("file", f"{path} is a different picture, or not a picture", None, *at)
        else:
            found = Difference("file", f"{path}: {unequal}", None, *at)
            found = replace(found, recorded=unequal.recorded, rendered=unequal.rendered)
        return replace(found, path=path)

    def _unequal_fields(self, path: str) -> str:
        """Return the first field in which the dataset's JSON file differs from the one written here, in words."""
        written = (self.made / path).read_bytes()
        try:
            recorded = loads(read_inside(self.dataset.root, path, _LONGER * len(written)), _LONGER * len(written))
            fields = list(walk(recorded, loads(written, len(written)), ""))
        except (OSError, ValueError, RecursionError) as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            return f"it is not the ground truth of patches: {reason}"
        if not fields:
            return "equal values in another form"
        more = f", and in {count(len(fields) - 1, 'more field')}" if len(fields) > 1 else ""
        first = "the whole document" if fields[0].startswith(":") else fields[0].lstrip(".")
        return f"as recorded and as rendered it differs in {first}{more}"

    def _is_excused(self, path: str, at: Picture) -> bool:
        """Return whether a file shows motion that may differ on this host."""
        for variant in self.plan.variants:
            other = self.other.get(variant.scene.digest)
            if other is not None and at:
                if variant.variant == at[0]:
                    return at[2] >= other.agreed
            elif other is not None:
                frames = range(other.agreed, variant.scene.clock.frames)
                sensors = variant.rig.sensors
                copies = (layout.label_copies(self.plan, variant.variant, s, k) for s in sensors for k in frames)
                if any(path in files.values() for files in copies):
                    return True
                patches = (layout.patches_file(variant.variant, s.name, k) for s in sensors for k in frames)
                if path in patches:
                    return True
        return False

    def _unlisted_pixels(self, path: str, at: Picture) -> Difference | None:
        """Return a difference if a picture's pixels do not have the digest in the dataset's manifest.

        Depth in a PNG is rounded, and the digest is of the unrounded depth, so it is not compared.
        """
        if not at or (at[3] == "depth" and not path.endswith(".npy")):
            return None
        name, sensor, frame, modality = at
        row = (digests.bare(self.plan, "", {}).variants[name].frame_key(modality), sensor, modality, frame)
        camera = next(s.camera for s in self.plan.named(name).rig.sensors if s.name == sensor)
        pixels = read_pixels(self.dataset.root / path, (camera.height, camera.width))
        if pixels is not None and pixel_digest(modality, pixels) == self.dataset.lock.frames.get(row):
            return None
        return Difference(
            "file", f"{path} does not hold the pixels whose digest the manifest has", None, *at, path=path
        )

    def _picture(self, path: str) -> Picture:
        """Return variant, sensor, frame and modality of a picture's path; an empty tuple for other files."""
        for variant in self.plan.variants:
            for sensor in variant.rig.sensors:
                for modality in sensor.capture:
                    head = layout.frame_file(variant.variant, sensor.name, modality, 0, self.plan.depth)
                    folder, _, name = head.rpartition("/")
                    if path.rpartition("/")[0] == folder and path.endswith(name.partition(".")[2]):
                        return variant.variant, sensor.name, int(Path(path).stem), modality
        return ()
