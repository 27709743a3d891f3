"""Comparison of two picture files: differing pixels are counted if possible, and headers are not trusted."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.errors import RunError
from recipe_runtime.annotate.records import FrameRecord, Video
from recipe_runtime.core import codecs
from recipe_runtime.frames.shot import Shot
from recipe_runtime.report.contact_sheets import contact_sheet
from recipe_runtime.report.difference import PixelDifference, first_difference, read_pixels, write_difference

from tests.runtime.fakes import NO_LABELS, sensor_plan

PIXELS = (np.arange(6 * 8 * 3) * 37 % 256).astype(np.uint8).reshape(6, 8, 3)


def png(image: Image.Image) -> bytes:
    body = io.BytesIO()
    image.save(body, "PNG")
    return body.getvalue()


def bomb(width: int, height: int) -> bytes:
    """Return a small PNG whose header states a large size."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")]
    rows = [struct.pack(">I", len(b)) + n + b + struct.pack(">I", zlib.crc32(n + b)) for n, b in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(rows)


def npy(array: NDArray[np.generic]) -> bytes:
    body = io.BytesIO()
    np.save(body, array)
    return body.getvalue()


def _header(text: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def _profile() -> bytes:
    """Return a PNG whose colour profile ends after its name."""
    body = codecs.photograph(np.zeros((2, 2, 3), np.uint8))
    chunk = b"iCCPabc\0"
    return body[:-12] + struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk)) + body[-12:]


STRANGE = {
    "smaller.png": codecs.png(PIXELS[:5]),
    "grey.png": codecs.png(PIXELS[..., 0]),
    "sixteen.png": codecs.png(PIXELS[..., 0].astype(np.uint16)),
    "palette.png": png(Image.fromarray(PIXELS).convert("P")),
    "large.png": bomb(200_000, 100_000),
    "cut.png": codecs.png(PIXELS)[:60],
    "text.png": b"no picture",
    "profile.png": _profile(),
    "bytes.npy": npy(PIXELS),
    "object.npy": b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }" + b" " * 58 + b"\n",
    "vast.npy": npy(np.zeros((1, 1), np.float32)).replace(b"(1, 1), }        ", b"(99999, 99999), }"),
    "solid.npy": npy(np.zeros((6, 8, 3), np.float32)),
    "zip.npy": b"PK\x03\x04junk",
    "header.npy": _header("(\n"),
    "shape.npy": _header("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999999, 9)}"),
    "deep.npy": _header("1" + "+1" * 3000),
}


@pytest.mark.parametrize("name", STRANGE)
def test_pictures_of_other_size_or_kind_have_no_count(tmp_path: Path, name: str) -> None:
    """NumPy and Pillow raise errors of a dozen types; none ends `recipe verify`."""
    there, ours = tmp_path / name, tmp_path / "ours.png"
    there.write_bytes(STRANGE[name])
    ours.write_bytes(codecs.png(PIXELS))
    assert first_difference(ours, there) is None
    for modality, pixels in (("rgb", PIXELS), ("depth", np.ones((6, 8), np.float32))):
        (written,) = write_difference(tmp_path / modality / "x", Shot("street", 0, modality, pixels), there)
        assert written.name == "x-rendered.png"


def test_depth_in_a_tiff_is_compared_by_its_values(tmp_path: Path) -> None:
    """Another compressor may have written it."""
    metres = np.arange(48, dtype=np.float32).reshape(6, 8)
    ours, there = tmp_path / "ours.tif", tmp_path / "there.tif"
    ours.write_bytes(codecs.tiff(metres))
    pixels = zlib.compress(metres.tobytes(), 9)
    there.write_bytes(codecs._tiff_head(6, 8, len(pixels)) + pixels)
    assert first_difference(there, ours) == PixelDifference(0)
    metres[2, 3] = 7.5
    there.write_bytes(codecs.tiff(metres))
    assert first_difference(there, ours) == PixelDifference(1, 3, 2, "7.5", "19.0")


def test_links_and_folders_are_not_read(tmp_path: Path) -> None:
    ours = tmp_path / "ours.png"
    ours.write_bytes(codecs.png(PIXELS))
    (tmp_path / "link.png").symlink_to(ours)
    (tmp_path / "folder.png").mkdir()
    for name in ("link.png", "folder.png", "missing.png"):
        assert first_difference(ours, tmp_path / name) is None


def test_depth_with_holes_is_drawn(tmp_path: Path) -> None:
    metres = np.full((6, 8), 7, np.float32)
    holes = metres.copy()
    holes[2, 3], holes[4, 5] = np.nan, np.inf
    (tmp_path / "d.npy").write_bytes(npy(holes))
    paths = write_difference(tmp_path / "x", Shot("street", 0, "depth", metres), tmp_path / "d.npy")
    with Image.open(paths[2]) as picture:
        red = np.argwhere((np.asarray(picture) == (255, 40, 40)).all(axis=-1))
    assert red.tolist() == [[2, 3], [4, 5]]


def test_an_unwritable_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match=r"cannot be written: .*; choose another folder for pictures"):
        write_difference(tmp_path / "file" / "x", Shot("street", 0, "rgb", PIXELS), None)


@pytest.mark.parametrize("body", [codecs.png(PIXELS)[:60], bomb(2_000, 2_000), codecs.png(PIXELS)], ids=len)
def test_sheets_refuse_what_is_not_the_picture_of_a_camera(tmp_path: Path, body: bytes) -> None:
    """A repair draws sheets from a stranger's pictures: one of 13,000 x 13,000 pixels took 4 GB."""
    path = tmp_path / "000000.png"
    path.write_bytes(body)
    record: FrameRecord = {**NO_LABELS, "digests": {"labels": ""}, "rgb": {}, "files": {}}
    video = Video("a", "", sensor_plan(), 10, (record,))
    with pytest.raises(RunError, match=r"000000.png is not the picture of its camera"):
        contact_sheet("tiny", [video], lambda video, frame: path)


def test_a_file_larger_than_a_picture_of_the_camera_is_not_decoded(tmp_path: Path) -> None:
    """Names of one forged file of 130 MB took minutes to decode, whatever the size of the camera's pictures."""
    path = tmp_path / "000000.png"
    whole = codecs.png(PIXELS)
    path.write_bytes(whole)
    assert read_pixels(path, PIXELS.shape) is not None
    assert read_pixels(path, (6, 7)) is None
    path.write_bytes(whole + b"\0" * codecs.largest_file(8, 6))
    assert read_pixels(path, PIXELS.shape) is None
