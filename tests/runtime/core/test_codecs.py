"""Encoded files contain exactly the given pixels, as read by Pillow and NumPy."""

import hashlib
import io
import zlib
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image
from recipe_runtime.core import codecs
from recipe_runtime.modalities.depth import from_carla, to_carla

Scalar = TypeVar("Scalar", bound=np.generic)
PINNED = ["ba7a692cf63fa9e2", "066bee1204be7dbd", "ae32eceb1716bb0d", "d49ceadc736ad0cc", "8a838b024e55f0c0"]


def noisy(shape: tuple[int, ...], top: int, dtype: type[Scalar]) -> NDArray[Scalar]:
    """Return random values from a small congruential generator."""
    values = np.arange(int(np.prod(shape)), dtype=np.uint64) * np.uint64(6364136223846793005) >> np.uint64(33)
    return (values % np.uint64(top + 1)).astype(dtype).reshape(shape)


@pytest.mark.parametrize(
    ("pixels", "mode"),
    [
        (noisy((7, 5, 3), 255, np.uint8), "RGB"),
        (noisy((1, 1, 3), 255, np.uint8), "RGB"),
        (noisy((7, 5), 255, np.uint8), "L"),
        (noisy((7, 5), 65535, np.uint16), "I;16"),
        (noisy((1, 9), 65535, np.uint16), "I;16"),
        (noisy((8, 6, 3), 255, np.uint8)[::2, ::-1], "RGB"),
    ],
)
def test_pillow_reads_what_was_written(pixels: NDArray[np.generic], mode: str) -> None:
    picture = Image.open(io.BytesIO(codecs.png(pixels)))
    picture.load()
    assert picture.mode == mode
    assert np.array_equal(np.asarray(picture), pixels)


def ramp(height: int, width: int) -> NDArray[np.uint8]:
    """Return depth as of ground with a wall on it."""
    rows = np.arange(height)[::-1, None] * 0.37 + np.arange(width) * 0.011 + 2.0
    rows[height // 4 : height // 2, width // 3 :] = 7.5
    return to_carla(rows.astype(np.float32))


def digests() -> list[str]:
    """Return digests of files of every kind."""
    labels, wide = noisy((480, 640), 28, np.uint8), noisy((48, 64), 15999, np.uint16)
    labels[:, 40:600] //= 8
    files = [codecs.photograph(noisy((480, 640, 3), 90, np.uint8)), codecs.png(ramp(480, 640))]
    files += [codecs.png(labels), codecs.png(wide), codecs.png(labels, level=6)]
    return [hashlib.sha256(file).hexdigest()[:16] for file in files]


def test_png_bytes_are_pinned() -> None:
    """Changing an encoder's bytes requires a new stage version."""
    assert digests() == PINNED


@pytest.mark.parametrize("shape", [(7, 5, 3), (1, 1, 3), (480, 640, 3)])
def test_pillow_reads_a_picture(shape: tuple[int, ...]) -> None:
    pixels = noisy(shape, 255, np.uint8)
    picture = Image.open(io.BytesIO(codecs.photograph(pixels)))
    picture.load()
    assert picture.mode == "RGB"
    assert np.array_equal(np.asarray(picture), pixels)


def test_a_noisy_picture_is_smaller_than_with_deflate_matching() -> None:
    steps = noisy((480, 640, 3), 15, np.uint8).cumsum(axis=1, dtype=np.uint8)
    assert len(codecs.photograph(steps)) < len(codecs.png(steps))


@pytest.mark.parametrize("pixels", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.uint16)])
def test_labels_are_not_encoded_as_a_picture(pixels: NDArray[np.uint8]) -> None:
    with pytest.raises(ValueError, match="no photograph"):
        codecs.photograph(pixels)


def test_arrays_of_other_shapes_or_types_are_refused() -> None:
    with pytest.raises(ValueError, match="float32"):
        codecs.png(np.zeros((4, 4), np.float32))


def test_carla_depth_is_carlas_formula_and_keeps_its_precision() -> None:
    metres = np.array([[0.0, 1e-4, 0.1, 1.0, 123.456, 999.99997, 1000.0, 5000.0, np.inf]], np.float32)
    pixels = to_carla(metres)
    r, g, b = (pixels[..., n].astype(np.float64) for n in range(3))
    carla = 1000.0 * (r + g * 256 + b * 256 * 256) / (256**3 - 1)
    clipped = np.minimum(metres.astype(np.float64), 1000.0)
    assert np.abs(carla - clipped).max() <= 0.5 * 1000.0 / (256**3 - 1) * (1 + 1e-9)
    assert np.array_equal(from_carla(pixels), carla.astype(np.float32))
    assert pixels[0, 6].tolist() == [255, 255, 255]


@pytest.mark.parametrize("array", [np.arange(6, dtype=np.float32).reshape(2, 3), np.zeros(3, ">u2")])
def test_numpy_reads_npy(array: NDArray[np.generic]) -> None:
    data = codecs.npy(array)
    assert data.index(b"\n") % 64 == 63
    loaded = np.load(io.BytesIO(data))
    assert loaded.dtype == array.dtype.newbyteorder("<")
    assert np.array_equal(loaded, array)


@pytest.mark.parametrize("shape", [(7, 5), (1, 1), (48, 64)])
def test_pillow_reads_the_metres_of_a_tiff(shape: tuple[int, int]) -> None:
    metres = noisy(shape, 1 << 20, np.uint32).astype(np.float32) / np.float32(7)
    picture = Image.open(io.BytesIO(codecs.tiff(metres)))
    picture.load()
    assert (picture.format, picture.mode) == ("TIFF", "F")
    assert np.array_equal(np.asarray(picture), metres)
    assert np.array_equal(codecs.metres_of_tiff(codecs.tiff(metres), shape), metres)


def test_a_tiff_that_another_compressor_wrote_has_the_same_metres() -> None:
    metres = noisy((48, 64), 1 << 20, np.uint32).astype(np.float32)
    pixels = zlib.compress(metres.tobytes(), 9)
    content = codecs._tiff_head(48, 64, len(pixels)) + pixels
    assert content != codecs.tiff(metres)
    assert np.array_equal(codecs.metres_of_tiff(content, (48, 64)), metres)


@given(st.binary(max_size=3), st.integers(0, 200), st.integers(0, 3))
def test_a_damaged_tiff_is_refused(insert: bytes, at: int, cut: int) -> None:
    metres = np.arange(12, dtype=np.float32).reshape(3, 4)
    content = codecs.tiff(metres)
    at = min(at, len(content) - cut)
    damaged = content[:at] + insert + content[at + cut :]
    try:
        found = codecs.metres_of_tiff(damaged, (3, 4))
    except Exception:
        return
    assert np.array_equal(found, metres)


def test_a_tiff_of_more_pixels_than_its_size_is_refused() -> None:
    pixels = zlib.compress(bytes(1 << 20), 9)
    with pytest.raises(ValueError, match="its pixels are damaged"):
        codecs.metres_of_tiff(codecs._tiff_head(1, 1, len(pixels)) + pixels, (1, 1))
    with pytest.raises(ValueError, match="too large"):
        codecs.metres_of_tiff(codecs.tiff(np.zeros((2, 3), np.float32)), (2, 2))
