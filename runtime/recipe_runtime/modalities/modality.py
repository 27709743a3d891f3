"""What a modality declares: its arrays, their files, and a picture of them for people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import codecs
from recipe_runtime.core.interfaces import LabelPass, Observed

Array = NDArray[np.generic]


def _unchanged(array: Array) -> Array:
    return array


def _no_line(dataset: DatasetPlan) -> str:
    return ""


@dataclass(frozen=True)
class FileForm:
    """How a modality's arrays are stored in files with one ending.

    Attributes:
        dtype: Type of the stored array, such as `uint8`.
        bands: The channels of the stored array as kwcoco names them, separated by `|`. One: the array is [H, W],
            otherwise [H, W, bands].
        encode: Stored array -> the bytes of a file.
        store: Array of the modality -> stored array; the same array by default.
        load: The inverse of `store`.
        tolerance: How much a value that `load` returns may differ from the one that was stored, because of rounding.
    """

    dtype: str
    bands: str
    encode: Callable[[Array], bytes] = codecs.png
    store: Callable[[Array], Array] = _unchanged
    load: Callable[[Array], Array] = _unchanged
    tolerance: float = 0.0

    def fits(self, stored: Array) -> bool:
        """Return whether an array has the type and the channels of a stored one; floats must be finite."""
        count = len(self.bands.split("|"))
        channels = 1 if stored.ndim == 2 else stored.shape[2] if stored.ndim == 3 else 0
        is_alike = stored.dtype == self.dtype and channels == count and (stored.ndim == 2) == (count == 1)
        return is_alike and (stored.dtype.kind != "f" or bool(np.isfinite(stored).all()))


@dataclass(frozen=True)
class Screen:
    """How a page colours the PNG files of a modality, which a browser reads with 8 bits a channel.

    Attributes:
        kind: `picture`: as it is; `palette`: its grey value is the index of a colour; `value`: its channels are parts
            of a number, which a colour map shows; `masks`: the page draws the masks of the labels instead.
        colours: Of a palette, red, green and blue, 0 to 255.
        names: Of a palette's colours.
        weights: Of a value: what 1 of red, green and blue, each 0 to 255, counts in `unit`.
        unit: Of a value.
    """

    kind: Literal["picture", "palette", "value", "masks"] = "picture"
    colours: Sequence[tuple[int, int, int]] = ()
    names: Sequence[str] = ()
    weights: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unit: str = ""


@dataclass(frozen=True)
class Modality:
    """All that the runtime knows of a modality; `MODALITY` in its module.

    Attributes:
        name: Its name in the registry, `recipe_compiler.ir.modalities`.
        dtype: Type of its arrays, which are hashed.
        files: The forms of its files, by the endings of file names; those of the registry, and those of copies.
        picture: Array -> picture for people, uint8 [H, W, 3]. No digest covers it.
        channels: Values of a pixel. 1: its arrays are [H, W], otherwise [H, W, channels].
        screen: How a page colours its PNG files.
        card: Dataset of which a sensor captures it -> line of the dataset's card, or nothing.
        seen: Observation -> array, of a label that every observation has.
        draw: Launches the kernels that compute a label which not every observation has. The arguments are
            `render.raster.surfaces.VisibleSurfaces` and the array to write, [H * W * channels], row by row.
    """

    name: str
    dtype: str
    files: Mapping[str, FileForm]
    picture: Callable[[Array], NDArray[np.uint8]]
    channels: int = 1
    screen: Screen = Screen()
    card: Callable[[DatasetPlan], str] = _no_line
    seen: Callable[[Observed], Array] | None = None
    draw: Callable[..., None] | None = None

    @property
    def label_pass(self) -> LabelPass | None:
        """The pass that computes it from the visible surfaces; None if every observation has it, or none."""
        return None if self.draw is None else LabelPass(self.name, self.dtype, self.channels, self.draw)

    def label(self, observed: Observed) -> Array:
        """Return its array of an observation; valid as long as the observation.

        Raises:
            ValueError: It is no label.
        """
        if self.seen is not None:
            return self.seen(observed)
        if self.label_pass is None:
            raise ValueError(f"{self.name} depends on the appearance")
        return observed.drawn(self.label_pass)

    def encoded(self, array: Array, ending: str) -> bytes:
        """Return the file of an array in the form with this ending."""
        form = self.files[ending]
        return form.encode(form.store(array))
