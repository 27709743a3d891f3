"""The headers of a ZIP file of uncompressed entries without dates, in the canonical form of packs."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import BinaryIO

Row = tuple[str, int, int]
"""An entry: its name in ASCII, its size in bytes, and the CRC-32 of its content."""

_VERSION = 20  # of the format, 2.0
_UNIX = 3
_DATE = 0x21  # 1980-01-01
_MODE = 0o100644 << 16  # a regular file
_LOCAL = struct.Struct("<4s5H3I2H")
_CENTRAL = struct.Struct("<4s4B4H3I5H2I")
_END = struct.Struct("<4s4H2IH")
_SIZES_AT = 14  # of CRC-32 and sizes in a local header


def row_of(name: str, body: bytes) -> Row:
    """Return the row of an entry."""
    return name, len(body), zlib.crc32(body)


def local_header(row: Row) -> bytes:
    """Return the bytes before the content of an entry."""
    name, size, crc = row
    return _LOCAL.pack(b"PK\3\4", _VERSION, 0, 0, 0, _DATE, crc, size, size, len(name), 0) + name.encode("ascii")


def directory(rows: Sequence[Row]) -> bytes:
    """Return the bytes after the last entry: the central directory and its end record."""
    parts, at = [], 0
    for row in rows:
        name, size, crc = row
        parts.append(
            _CENTRAL.pack(
                b"PK\1\2",
                _VERSION,
                _UNIX,
                _VERSION,
                0,
                0,
                0,
                0,
                _DATE,
                crc,
                size,
                size,
                len(name),
                0,
                0,
                0,
                0,
                _MODE,
                at,
            )
        )
        parts.append(name.encode("ascii"))
        at += len(local_header(row)) + size
    length = sum(map(len, parts))
    return b"".join([*parts, _END.pack(b"PK\5\6", 0, 0, len(rows), len(rows), length, at, 0)])


def read_entry(file: BinaryIO, name: str, limit: int) -> tuple[Row, bytes]:
    """Read the next entry of a file.

    Args:
        file: the file, at the header of the entry.
        name: the name that the entry must have.
        limit: the largest size in bytes.

    Raises:
        ValueError: there is no such entry, it is larger, or its header or content has other bytes.
    """
    head = file.read(_LOCAL.size + len(name))
    if len(head) < _LOCAL.size or not head.startswith(b"PK\3\4"):
        raise ValueError(f"{name!r} is missing, or not at its place")
    crc, _, size = struct.unpack_from("<3I", head, _SIZES_AT)
    if head != local_header((name, size, crc)):
        raise ValueError("its bytes are not the canonical form of its content")
    if size > limit:
        raise ValueError(f"{name!r} has {size:,} bytes, and at most {limit:,} are read")
    body = file.read(size)
    if row_of(name, body) != (name, size, crc):
        raise ValueError(f"the content of {name!r} is damaged")
    return (name, size, crc), body
