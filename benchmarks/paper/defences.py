"""Two defences of the paper, as baselines: background subtraction, and masks of pixels with unusual statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]  # [H, W, 3], sRGB
Mask = NDArray[np.bool_]  # [H, W]
Subtractor = Callable[[Picture], Mask]  # called frame by frame; returns True where the frame shows foreground

_WINDOW = 9  # pixels: side of the square over which differences are averaged


class RunningGaussian:
    """A background model of one Gaussian per pixel and channel, updated frame by frame.

    Args:
        rate: Weight of a new frame in the model.
        deviations: Distance from the mean, in standard deviations, from which a pixel is foreground.
    """

    def __init__(self, rate: float = 0.05, deviations: float = 4.0) -> None:
        self._rate, self._deviations = rate, deviations
        self._mean: NDArray[np.float64] | None = None
        self._variance: NDArray[np.float64] = np.zeros((0, 0, 0))

    def __call__(self, picture: Picture) -> Mask:
        """Return the foreground of a frame, and update the model with it."""
        levels = picture.astype(np.float64)
        if self._mean is None:
            self._mean, self._variance = levels, np.full(levels.shape, 15.0)
        difference = levels - self._mean
        squared = difference * difference
        foreground: Mask = np.asarray((squared > self._deviations**2 * self._variance).any(axis=2), np.bool_)
        self._mean = self._mean + self._rate * difference
        self._variance = np.maximum(self._variance + self._rate * (squared - self._variance), 4.0)
        return foreground


def opencv_subtractors() -> dict[str, Subtractor]:
    """Return OpenCV's background subtractors with their default settings.

    Raises:
        ModuleNotFoundError: OpenCV is not installed.
    """
    cv2 = _opencv()
    models = {"OpenCV MOG2": cv2.createBackgroundSubtractorMOG2(), "OpenCV KNN": cv2.createBackgroundSubtractorKNN()}

    def foreground_of(model: Any) -> Subtractor:
        return lambda picture: np.asarray(model.apply(picture) == 255, np.bool_)  # 127 is shadow

    return {name: foreground_of(model) for name, model in models.items()}


def stabilised(subtractor: Subtractor) -> Subtractor:
    """Return a subtractor whose frames are first shifted onto the first one, as measured by phase correlation.

    The mask is shifted back. Pixels that the shifted frame does not show are foreground.

    Raises:
        ModuleNotFoundError: OpenCV is not installed.
    """
    cv2 = _opencv()
    first: NDArray[np.float32] | None = None

    def foreground(picture: Picture) -> Mask:
        nonlocal first
        grey: NDArray[np.float32] = picture.mean(axis=2, dtype=np.float32)
        first, size = grey if first is None else first, grey.shape[::-1]
        (x, y), _ = cv2.phaseCorrelate(first, grey, cv2.createHanningWindow(size, cv2.CV_32F))
        there, back = (np.array([[1, 0, sign * x], [0, 1, sign * y]], np.float32) for sign in (-1, 1))
        mask = subtractor(cv2.warpAffine(picture, there, size, borderMode=cv2.BORDER_REPLICATE)).astype(np.uint8)
        return np.asarray(cv2.warpAffine(mask, back, size, flags=cv2.INTER_NEAREST, borderValue=1) > 0, np.bool_)

    return foreground


def _opencv() -> ModuleType:
    try:
        return import_module("cv2")
    except ImportError:
        raise ModuleNotFoundError("OpenCV is not installed; `make paper` installs it") from None


@dataclass(frozen=True)
class Removal:
    """The shares of pixels, 0 to 1, that a background subtractor removes from a video as background."""

    patch: float  # of the patch: 1 is best
    target: float  # of the person who walks in front of it: 0 is best


def removal(
    pictures: Sequence[Picture], patches: Sequence[Mask], targets: Sequence[Mask], subtractor: Subtractor, warmup: int
) -> Removal:
    """Run a background subtractor over a video and count the pixels that it classifies as background.

    Args:
        pictures: The frames, in order.
        patches: The pixels of each frame that show the patch.
        targets: The pixels of each frame that show the person.
        subtractor: A new background model.
        warmup: Number of frames that the model is updated with before pixels are counted.
    """
    removed, total = np.zeros(2), np.zeros(2)
    for number, picture in enumerate(pictures):
        background = ~subtractor(picture)
        if number >= warmup:
            shown = patches[number], targets[number]
            removed += [int((background & mask).sum()) for mask in shown]
            total += [int(mask.sum()) for mask in shown]
    patch, target = removed / np.maximum(total, 1)
    return Removal(float(patch), float(target))


def statistics(picture: Picture) -> dict[str, NDArray[np.float64]]:
    """Return three statistics of each pixel, [H, W] each, which are high on adversarial patches.

    - colour: distance of its chromaticity from the picture's median;
    - frequency: mean difference of neighbouring pixels around it, in levels;
    - saturation: difference of its largest and its smallest channel, in levels.
    """
    levels = picture.astype(np.float64)
    chromaticity = levels[..., :2] / np.maximum(levels.sum(axis=2, keepdims=True), 1)
    colour = np.abs(chromaticity - np.median(chromaticity, axis=(0, 1))).sum(axis=2)
    grey = levels.mean(axis=2)
    steps = np.abs(np.diff(grey, axis=0, append=grey[-1:])) + np.abs(np.diff(grey, axis=1, append=grey[:, -1:]))
    return {"colour": colour, "frequency": _mean_around(steps), "saturation": levels.max(axis=2) - levels.min(axis=2)}


def thresholds(clean: Sequence[Picture], quantile: float) -> dict[str, float]:
    """Return a quantile of each statistic over the pixels of clean pictures."""
    found = [statistics(picture) for picture in clean]
    return {name: float(np.quantile([row[name] for row in found], quantile)) for name in found[0]}


def flagged(picture: Picture, limits: Mapping[str, float]) -> dict[str, Mask]:
    """Return for each statistic the pixels that exceed its limit."""
    return {name: values > limits[name] for name, values in statistics(picture).items()}


def _mean_around(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of the square window around each pixel; edges are repeated."""
    padded = np.pad(values, _WINDOW // 2, mode="edge")
    for axis in (0, 1):
        padded = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW, axis=axis).mean(axis=-1)
    return padded
