"""PNG images to 8-bit sRGB. Sizes are read from the header and bounded before anything is decoded.

Only PNG is supported, because all decoders return the same pixels; those of a JPEG depend on the decoder. All chunks
without pixels are dropped before decoding, so text, profiles and animations cost nothing.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recipe_compiler.ir.assets.geometry import AssetError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
MAX_PIXELS = 16 << 20
MAX_SIDE = 8192
_READ = {b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"}
_PALETTE = 3  # colour type of images whose pixels are indices of a palette
_OTHER_FORMATS = {b"\xff\xd8\xff": "a JPEG", b"GIF8": "a GIF", b"RIFF": "a WebP", b"BM": "a BMP", b"<": "text or XML"}

Pixels = NDArray[np.uint8]  # [H, W, 3] sRGB


class _Parts(NamedTuple):
    """The contents of the chunks that determine the pixels; a palette or a transparency may be absent."""

    header: bytes
    palette: bytes | None
    clear: bytes | None
    packed: bytes


def size(content: bytes) -> tuple[int, int]:
    """Return width and height from the header.

    Raises:
        AssetError: it is not a PNG image, or too large.
    """
    if not content.startswith(SIGNATURE):
        kind = next((name for head, name in _OTHER_FORMATS.items() if content.startswith(head)), "something else")
        raise AssetError(f"is not a PNG image but {kind}; save it as an 8-bit PNG, which decodes the same everywhere")
    if len(content) < 33 or content[8:16] != b"\0\0\0\rIHDR":
        raise AssetError("is truncated or damaged: it has no header; save it again")
    width, height, depth = struct.unpack(">IIB", content[16:25])
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= MAX_PIXELS):
        most = f"{MAX_SIDE} per side and {MAX_PIXELS >> 20} Mpx"
        raise AssetError(f"its header states {width} x {height} pixels, not 1 to {most}; make it smaller")
    if depth > 8:
        raise AssetError(f"has {depth} bits a channel; save it with 8")
    return width, height


def decode(content: bytes, *, opaque: bool = True) -> Pixels:
    """Return the pixels [H, W, 3], without alpha.

    Raises:
        AssetError: the image is damaged or, with `opaque`, partly transparent.
    """
    from PIL import Image, PngImagePlugin

    width, height = size(content)
    parts = _parts(content)
    _check_length(content, parts.packed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with PngImagePlugin.PngImageFile(io.BytesIO(_plain(parts))) as file:
                colours = 1 + int(np.asarray(file).max()) if file.mode == "P" else 0  # that the palette must have
                clear = file.mode in ("RGBA", "LA", "PA") or "transparency" in file.info
                pixels = np.asarray(file.convert("RGBA" if clear else "RGB"), np.uint8)
    except (OSError, ValueError, SyntaxError, EOFError, zlib.error, struct.error, Warning) as error:
        reason = str(error).splitlines()[0][:80] if str(error) else type(error).__name__
        raise AssetError(f"is truncated or damaged: {reason}; save it again") from None
    except Image.DecompressionBombError:
        raise AssetError("it has more pixels than its header states; save it again") from None
    if pixels.shape[:2] != (height, width):
        raise AssetError("is damaged: its pixels do not match its header; save it again")
    if 3 * colours > len(parts.palette or b""):
        raise AssetError("is damaged: a pixel has a colour beyond its palette; save it again")
    if clear and opaque and int(pixels[..., 3].min()) < 255:
        raise AssetError("is partly transparent; flatten it on a background")
    return np.ascontiguousarray(pixels[..., :3])


# Adam7: where each pass of an interlaced image starts, and its stride, across and down.
_PASSES = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def _check_length(content: bytes, packed: bytes) -> None:
    """Raise AssetError unless the data decompress to exactly the size that the header implies.

    The decoder leaves missing rows undefined, and this decompresses only as much as it needs.
    """
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", content[16:29])
    if colour not in _CHANNELS:
        raise AssetError("is damaged: the colour type in its header is invalid; save it again")
    passes = _PASSES if interlaced else ((0, 1, 0, 1),)
    length = 0
    for x, across, y, down in passes:
        columns, rows = max(0, -(-(width - x) // across)), max(0, -(-(height - y) // down))
        length += rows * (1 + (columns * depth * _CHANNELS[colour] + 7) // 8) if columns else 0
    try:
        found = len(zlib.decompressobj().decompress(packed, length + 1))
    except zlib.error:
        found = -1
    if found != length:
        raise AssetError(f"is truncated or damaged: its pixels need {length} bytes of data; save it again")


def _parts(content: bytes) -> _Parts:
    """Return the contents of the chunks that determine the pixels.

    Raises:
        AssetError: a chunk is missing, repeated, or not at its place.
    """
    header, found, packed = b"", dict[bytes, bytes](), list[bytes]()
    for kind, body in _chunks(content):
        if kind == b"IHDR":
            header = body
        elif kind == b"IDAT":
            packed.append(body)
        elif kind in (b"PLTE", b"tRNS"):
            if packed or kind in found:
                raise AssetError(
                    f"is damaged: its {kind.decode()} chunk is repeated, or after the pixels; save it again"
                )
            found[kind] = body
    palette = found.get(b"PLTE")
    if header[9] == _PALETTE and (not palette or len(palette) % 3):
        raise AssetError("is damaged: it has no valid palette; save it again")
    return _Parts(header, palette, found.get(b"tRNS"), b"".join(packed))


def _plain(parts: _Parts) -> bytes:
    """Return the image with one chunk of pixels, and no chunk without pixels."""
    depth, colour, clear = parts.header[8], parts.header[9], parts.clear
    if clear is not None and len(clear) == 2 and colour == 0 and depth in (2, 4):
        # the decoder scales the pixels to 8 bits, but not the value that is transparent
        clear = struct.pack(">H", (clear[1] & ((1 << depth) - 1)) * 255 // ((1 << depth) - 1))
    rows = (
        (b"IHDR", parts.header),
        (b"PLTE", parts.palette),
        (b"tRNS", clear),
        (b"IDAT", parts.packed),
        (b"IEND", b""),
    )
    chunks = ((kind + body, len(body)) for kind, body in rows if body is not None)
    return SIGNATURE + b"".join(struct.pack(">I", n) + text + struct.pack(">I", zlib.crc32(text)) for text, n in chunks)


def _chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of the chunks that `_parts` reads."""
    at, kind = len(SIGNATURE), b""
    while kind != b"IEND":
        if at + 12 > len(content):
            raise AssetError("is truncated: its last chunk is missing; save it again")
        length, kind = struct.unpack_from(">I4s", content, at)
        end = at + 12 + length
        if end > len(content):
            raise AssetError(f"is truncated: a chunk of {length} bytes exceeds the file; save it again")
        if kind == b"IHDR" and at != len(SIGNATURE):
            raise AssetError("is damaged: it has two headers; save it again")
        if kind in _READ:
            if zlib.crc32(content[at + 4 : end - 4]) != struct.unpack_from(">I", content, end - 4)[0]:
                raise AssetError("is damaged: the checksum of a chunk is wrong; save it again")
            yield kind, content[at + 8 : end - 4]
        at = end
