"""The files of one sensor of one variant of a dataset, compared with the manifest while an export reads them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan

from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.attacks.truth import FrameTruth, PatchRecord
from recipe_runtime.core import codecs, documents, layout
from recipe_runtime.core.files import read_inside, regular_file
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.dataset.tracks import field
from recipe_runtime.modalities.depth import NAME as DEPTH
from recipe_runtime.webdataset import decode


def _nothing(frame: int) -> None:
    """Take the number of a frame that is read."""


@dataclass(frozen=True)
class ExportSequence:
    """One sensor of one variant.

    Attributes:
        dataset: The dataset.
        variant: The plan of the variant.
        sensor: The plan of the sensor.
        number: Number of the sequence in the dataset, from 0.
        reads: Called with the number of each frame of which a picture is read.
    """

    dataset: Dataset
    variant: ScenarioPlan
    sensor: SensorPlan
    number: int
    reads: Callable[[int], None] = _nothing

    @property
    def name(self) -> str:
        """Its name, as in the dataset's MOTS annotations; without dots and commas."""
        return layout.sequence(self.variant.variant, self.sensor.name)

    @property
    def frames(self) -> range:
        """The frames that the sensor captures."""
        return self.sensor.frames(self.variant.scene.clock.frames)

    @property
    def length(self) -> int:
        """The number of frames from frame 0 to the last one that the sensor captures."""
        return self.frames[-1] + 1

    def labels(self) -> Iterator[LabelledFrame]:
        """Yield the labels of its frames."""
        try:
            yield from labels(self.dataset, self.variant, self.sensor)
        except (ValueError, OSError) as error:
            path = layout.labels_file(self.variant.variant, self.sensor.name)
            raise damaged_file(self.dataset, f"{path}: {error}") from None

    def file(self, modality: str, frame: int) -> tuple[str, bytes]:
        """Return path and content of a picture's file."""
        self.reads(frame)
        name = self.variant.variant, self.sensor.name
        path = layout.frame_file(*name, modality, frame, self.dataset.plan.forms)
        return path, picture_file(self.dataset, path, self.sensor)

    def pictures(self) -> Iterator[tuple[int, bytes]]:
        """Yield its RGB pictures, if it captures any."""
        for frame in self.frames if "rgb" in self.sensor.capture else ():
            yield frame, self.picture(frame)

    def picture(self, frame: int) -> bytes:
        """Return the RGB picture of a frame."""
        return self.file("rgb", frame)[1]

    def depth(self, frame: int) -> NDArray[np.float64]:
        """Return the depth of a frame, metres, [H, W]."""
        path, content = self.file(DEPTH, frame)
        try:
            metres = decode(f".{DEPTH}.{path.rpartition('.')[2]}", content)
        except ValueError as error:
            raise damaged_file(self.dataset, f"{path}: {error}") from None
        if metres.shape != (self.sensor.camera.height, self.sensor.camera.width):
            raise damaged_file(self.dataset, f"{path} differs in size from the sensor's pictures")
        if not (metres >= 0.0).all():
            raise damaged_file(self.dataset, f"{path} has negative distances")
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


def picture_file(dataset: Dataset, path: str, sensor: SensorPlan) -> bytes:
    """Return the content of a picture's file, after comparing it with the manifest.

    Raises:
        InputError: the file is missing, damaged, or larger than a picture of the sensor can be.
    """
    size, sha256 = dataset.files.get(path, (-1, ""))
    most = codecs.largest_file(sensor.camera.width, sensor.camera.height)
    found = regular_file(dataset.root, path)
    if found is None or found.st_size != size:
        raise damaged_file(dataset, f"{path} is missing, or not a regular file of {size:,} bytes")
    if size > most:
        raise damaged_file(dataset, f"{path} has {size:,} bytes, and a picture of this sensor has at most {most:,}")
    try:
        body = read_inside(dataset.root, path, size)
    except (OSError, ValueError) as error:
        raise RunError(f"{dataset.root / path} cannot be read: {error}") from None
    if hashlib.sha256(body).hexdigest() != sha256:
        raise damaged_file(dataset, f"{path} differs from its SHA-256 in the manifest")
    return body


def damaged_file(dataset: Dataset, what: str) -> InputError:
    """Return the error that a file of a dataset is damaged."""
    return InputError(
        f"{dataset.root}/{what}",
        help="repair the dataset, then export it",
        code=Code.INVALID_DATASET,
    )


def names_table(sequences: Sequence[ExportSequence]) -> Iterator[str]:
    """Yield the lines of `sequences.csv`, which has variant and sensor of each sequence by its number."""
    yield "sequence,variant,sensor\n"
    for sequence in sequences:
        yield f"{sequence.number:04d},{field(sequence.variant.variant)},{field(sequence.sensor.name)}\n"
