"""Encoders of arrays: PNG and TIFF through zlib-ng, `.npy`; readers of the PNG and TIFF files that others cannot read.

The bytes depend on the pixels and on the `zlib-ng` package's version only. Pixels
(`modalities.pixel_digest`) and files have separate digests, so that a change of the encoder is distinguished from
a change of the image.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray
from zlib_ng import zlib_ng

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_RGB = 2  # PNG colour type
_SUB = 1  # PNG filter type: each byte less the one a pixel to its left
_UP = 2  # PNG filter type: each byte less the one above it
_WINDOW, _MEMORY = 15, 9  # zlib's largest


def largest_file(width: int, height: int) -> int:
    """Return the most bytes that the file of a picture, a mask or depth may have; the decoding of more is refused."""
    return (1 << 16) + 16 * width * height


def photograph(pixels: NDArray[np.uint8]) -> bytes:
    """Encode a noisy camera image, uint8 [H, W, 3] RGB, as PNG.

    Noise leaves no repetitions: the image is filtered by differences to the left neighbour and Huffman coded without
    a search for matches.
    """
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"no photograph of {pixels.dtype} {pixels.shape}")
    return _file(pixels, 8, 2, _compressed(_filter_sub(np.ascontiguousarray(pixels)), 1, zlib_ng.Z_HUFFMAN_ONLY))


def png(pixels: NDArray[np.generic], level: int = 2) -> bytes:
    """Encode labels, depth or graphics as PNG: uint8 or uint16, [H, W, 3] (RGB) or [H, W] (grey).

    Rows are filtered by differences to the row above, which are mostly zero for labels and small for depth.
    """
    is_grey, is_wide = pixels.ndim == 2, pixels.dtype == np.uint16
    if not (is_wide or pixels.dtype == np.uint8) or not (is_grey or (pixels.ndim == 3 and pixels.shape[2] == 3)):
        raise ValueError(f"no PNG form for {pixels.dtype} {pixels.shape}")
    plain = np.ascontiguousarray(pixels.astype(">u2") if is_wide else pixels)
    rows = plain.reshape(pixels.shape[0], -1).view(np.uint8)
    body = _compressed(_filter_up(rows), level, zlib_ng.Z_DEFAULT_STRATEGY)
    return _file(pixels, 16 if is_wide else 8, 0 if is_grey else 2, body)


def wide_rgb(content: bytes, shape: tuple[int, ...]) -> NDArray[np.uint16] | None:
    """Return the pixels of a PNG with 16-bit RGB that `png` wrote, which Pillow reduces to 8 bits.

    Args:
        content: The file.
        shape: The largest height and width.

    Returns:
        uint16 [H, W, 3]; None if it is a PNG of another kind, or no PNG.

    Raises:
        ValueError: It is damaged, larger, or from another writer.
        zlib_ng.error: Its pixels are damaged.
    """
    if content[:8] != _SIGNATURE or content[24:26] != bytes((16, _RGB)):
        return None
    width, height = struct.unpack_from(">II", content, 16)
    body = content[41:-16]
    if not 0 < height <= shape[0] or not 0 < width <= shape[1]:
        raise ValueError(f"it has {width} x {height} pixels")
    if content != _file(np.empty((height, width), np.uint8), 16, _RGB, body):
        raise ValueError("it is not a PNG of this project")
    rows = np.frombuffer(_inflated(body, height * (1 + 6 * width)), np.uint8).reshape(height, -1)
    if (rows[:, 0] != _UP).any():
        raise ValueError("it is not a PNG of this project")
    plain = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    return plain.view(">u2").astype(np.uint16).reshape(height, width, 3)


def npy(array: NDArray[np.generic]) -> bytes:
    """Encode an array in NumPy's file format 1.0, little-endian and C-order, independent of the NumPy version."""
    plain = np.asarray(array, dtype=array.dtype.newbyteorder("<"), order="C")
    shape = "(" + "".join(f"{n}, " for n in plain.shape).rstrip(" ") + ")"
    head = f"{{'descr': '{plain.dtype.str}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + plain.tobytes()


def tiff(metres: NDArray[np.float32]) -> bytes:
    """Encode float32 [H, W] as TIFF 6.0: little-endian, one channel, one strip, deflated."""
    height, width = metres.shape
    body = zlib_ng.compress(np.ascontiguousarray(metres, dtype="<f4").tobytes(), 2)
    return _tiff_head(height, width, len(body)) + body


def metres_of_tiff(content: bytes, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the metres of a file that `tiff` wrote.

    Args:
        content: The file.
        shape: The largest height and width.

    Raises:
        ValueError: It is another file, or larger.
        zlib_ng.error: Its pixels are damaged.
    """
    width, height = struct.unpack_from(_TIFF_SIZES, content.ljust(_TIFF_HEAD))
    head = _tiff_head(height, width, max(0, len(content) - _TIFF_HEAD))
    if not content.startswith(head) or height > shape[0] or width > shape[1]:
        raise ValueError("it is not a TIFF of this project, or too large")
    metres = _inflated(content[len(head) :], 4 * width * height)
    return np.frombuffer(metres, "<f4").reshape(height, width)


def _inflated(body: bytes, size: int) -> bytes:
    """Return the `size` bytes that were deflated to a body; ValueError if it has others, or is damaged."""
    unpacker = zlib_ng.decompressobj()
    whole = unpacker.decompress(body, size + 1)
    if len(whole) != size or not unpacker.eof or unpacker.unused_data:
        raise ValueError("its pixels are damaged")
    return bytes(whole)


def _tiff_head(height: int, width: int, size: int) -> bytes:
    """Return all bytes of a TIFF before its `size` bytes of pixels."""
    short, long, tags = 3, 4, [(256, width), (257, height), (258, 32), (259, 8), (262, 1), (273, 0), (277, 1)]
    tags += [(278, height), (279, size), (339, 3)]
    start = 8 + 2 + 12 * len(tags) + 4
    head = struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<H", len(tags))
    for tag, value in tags:
        kind = short if tag in _SHORT_TAGS else long
        head += struct.pack("<HHII", tag, kind, 1, start if tag == _STRIP else value)
    return head + struct.pack("<I", 0)


_SHORT_TAGS, _STRIP = (258, 259, 262, 277, 339), 273  # TIFF tags of 16 bits; the tag of the strip's offset
_TIFF_SIZES, _TIFF_HEAD = "<18xI8xI", len(_tiff_head(0, 0, 0))  # where width and height are; bytes before the pixels


def _filter_sub(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width, step = pixels.shape
    rows = pixels.reshape(height, width * step)
    out = np.empty((height, 1 + width * step), np.uint8)
    out[:, 0] = _SUB
    out[:, 1 : 1 + step] = rows[:, :step]
    np.subtract(rows[:, step:], rows[:, :-step], out=out[:, 1 + step :])
    return out


def _filter_up(rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    out = np.empty((rows.shape[0], 1 + rows.shape[1]), np.uint8)
    out[:, 0] = _UP
    out[:1, 1:] = rows[:1]
    np.subtract(rows[1:], rows[:-1], out=out[1:, 1:])
    return out


def _compressed(rows: NDArray[np.uint8], level: int, strategy: int) -> bytes:
    packer = zlib_ng.compressobj(level, zlib_ng.DEFLATED, _WINDOW, _MEMORY, strategy)
    return bytes(packer.compress(rows.data) + packer.flush())


def _file(pixels: NDArray[np.generic], depth: int, kind: int, body: bytes) -> bytes:
    height, width = pixels.shape[:2]
    header = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    return b"".join([_SIGNATURE, *_chunk(b"IHDR", header), *_chunk(b"IDAT", body), *_chunk(b"IEND", b"")])


def _chunk(name: bytes, body: bytes) -> tuple[bytes, ...]:
    crc = zlib_ng.crc32(body, zlib_ng.crc32(name))
    return struct.pack(">I", len(body)), name, body, struct.pack(">I", crc)
