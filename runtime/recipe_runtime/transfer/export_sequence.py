"""The files of one sensor of one variant of a dataset, compared with the manifest while an export reads them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import PatchPlan
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan

from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.attacks.truth import FrameTruth, PatchRecord
from recipe_runtime.core import documents, layout
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.modalities.depth import NAME as DEPTH
from recipe_runtime.transfer.shards import damaged_file, picture_file
from recipe_runtime.webdataset import decode

Entry = tuple[str, bytes | Iterable[str]]  # a file's path and content


@dataclass(frozen=True)
class ExportSequence:
    """One sensor of one variant, and the patch to export, if any; `number` counts the dataset's sequences from 0."""

    dataset: Dataset
    variant: ScenarioPlan
    sensor: SensorPlan
    number: int
    patch_name: str | None = None  # None: the variant's first patch

    @property
    def patch_plan(self) -> PatchPlan | None:
        """The patch to export; None if the variant does not have it."""
        patches = self.variant.appearance.patches
        return next((patch for patch in patches if self.patch_name in (None, patch.name)), None)

    @property
    def frames(self) -> range:
        """The frames that the sensor captures."""
        return self.sensor.frames(self.variant.scene.clock.frames)

    def labels(self) -> Iterator[LabelledFrame]:
        """Yield the labels of its frames."""
        try:
            yield from labels(self.dataset, self.variant, self.sensor)
        except (ValueError, OSError) as error:
            path = layout.labels_file(self.variant.variant, self.sensor.name)
            raise damaged_file(self.dataset, f"{path}: {error}") from None

    def pictures(self) -> Iterator[tuple[int, bytes]]:
        """Yield its RGB pictures, if it captures any."""
        for frame in self.frames if "rgb" in self.sensor.capture else ():
            yield frame, self.picture(frame)

    def picture(self, frame: int) -> bytes:
        """Return the RGB picture of a frame."""
        return picture_file(self.dataset, self._path("rgb", frame), self.sensor)

    def depth(self, frame: int) -> NDArray[np.float64]:
        """Return the depth of a frame, metres, [H, W]."""
        path = self._path(DEPTH, frame)
        content = picture_file(self.dataset, path, self.sensor)
        try:
            metres = decode(f".{DEPTH}.{path.rpartition('.')[2]}", content)
        except ValueError as error:
            raise damaged_file(self.dataset, f"{path}: {error}") from None
        if metres.shape != (self.sensor.camera.height, self.sensor.camera.width):
            raise damaged_file(self.dataset, f"{path} differs in size from the sensor's pictures")
        if not (np.isfinite(metres).all() and (metres >= 0.0).all()):
            raise damaged_file(self.dataset, f"{path} has distances that are negative or not finite")
        return cast("NDArray[np.float64]", metres.astype(np.float64))

    def patch(self, frame: int, name: str) -> PatchRecord:
        """Return the ground truth of a patch in a frame."""
        path = layout.patches_file(self.variant.variant, self.sensor.name, frame)
        content = picture_file(self.dataset, path, self.sensor)
        try:
            found = [record for record in documents.decode(content, FrameTruth)["patches"] if record["name"] == name]
            usable = len(found) == 1 and (found[0]["depth"] is None) == (found[0]["area"] == 0)
        except ValueError:
            usable = False
        if not usable:
            raise damaged_file(self.dataset, f"{path} is not the ground truth of the patch {name}")
        return found[0]

    def _path(self, modality: str, frame: int) -> str:
        return layout.frame_file(self.variant.variant, self.sensor.name, modality, frame, self.dataset.plan.forms)
