"""Traces beside a lockfile: motion that a host can start from where its own simulation would be another.

    lockfiles/<recipe>.traces
        recipe-traces 1
        SCENE-DIGEST TRACE-DIGEST COMPRESSED-BYTES RAW-BYTES     a line a trace, then its bytes, zlib-compressed
        ...

A Trace is believed for its digest's sake alone: the lockfile says which it must have. The file is a stranger's until
then, so sizes are bounded before anything is unpacked.
"""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import InputError

from recipe_runtime.core.files import host_errors, write_atomic
from recipe_runtime.core.trace import Trace

SUFFIX = ".traces"
MOST_BYTES = 1 << 30  # of the file, and of a Trace
_HEAD = b"recipe-traces 1\n"
_MOST_LINE = 400
_PIECE = 1 << 16


def beside(lockfile: Path) -> Path:
    """Where the traces of a lockfile lie."""
    return lockfile.with_suffix(SUFFIX)


def dumps(traces: Mapping[str, Trace]) -> bytes:
    """Traces by scene digest, as one file's bytes."""
    pieces = [_HEAD]
    for scene, trace in sorted(traces.items()):
        size, packed = _packed(trace)
        pieces += [f"{scene} {trace.digest} {len(packed)} {size}\n".encode(), packed]
    return b"".join(pieces)


def _packed(trace: Trace) -> tuple[int, bytes]:
    """The size of a Trace's byte form, and that form compressed, of which no more than a piece is in memory."""
    packer, size, packed = zlib.compressobj(9), 0, []
    for piece in trace.pieces():
        size += len(piece)
        packed.append(packer.compress(piece))
    return size, b"".join([*packed, packer.flush()])


def write(path: Path, traces: Mapping[str, Trace], *, replace: bool = False) -> bool:
    """Write them unless the file says the same already; whether it was written.

    Raises:
        InputError: what is there is not a file of traces, and not `replace`.
    """
    body = dumps(traces)
    if path.is_file() and path.read_bytes() == body:
        return False
    if path.is_file() and not replace:
        with path.open("rb") as file:
            if file.read(len(_HEAD)) != _HEAD:
                raise InputError(f"{path} is there already and is not a file of traces; move it away, or add --replace")
    with host_errors(str(path), "free some space or allow writing"):
        write_atomic(path, body)
    return True


def read(path: Path, locked: Mapping[str, str]) -> dict[str, Trace]:
    """The traces that a lockfile's `trace` rows vouch for, by scene; none if there is no file.

    InputError if the file is damaged, or holds a Trace that is not the locked one.
    """
    if not path.exists():
        return {}
    try:
        body = read_regular(path, MOST_BYTES)
        if len(body) > MOST_BYTES or not body.startswith(_HEAD):
            raise ValueError("it is not a file of traces, or too large")
        return dict(_entries(body, locked))
    except (OSError, ValueError, KeyError, zlib.error, TypeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(
            f"{path}: cannot be used: {reason}; `recipe lock --update --with-traces` writes it again"
        ) from None


def _entries(body: bytes, locked: Mapping[str, str]) -> list[tuple[str, Trace]]:
    found, at = [], len(_HEAD)
    while at < len(body):
        end = body.index(b"\n", at, at + _MOST_LINE)
        scene, digest, packed, raw = body[at:end].decode("ascii").split(" ")
        at = end + 1 + int(packed)
        if locked.get(scene) != digest:
            raise ValueError(f"it holds a Trace of scene {scene[:16]} that is not the lockfile's")
        trace = _unpacked(memoryview(body)[end + 1 : at], int(raw))
        if trace.digest != digest:
            raise ValueError(f"the Trace of scene {scene[:16]} is not what its digest says")
        found.append((scene, trace))
    return found


def _unpacked(packed: memoryview, size: int) -> Trace:
    """A Trace of so many bytes and no more, in a temporary file: another size is refused before it fills the disk."""
    if not 0 < size <= MOST_BYTES:
        raise ValueError(f"a Trace of {size} bytes is none")
    unpacker, left = zlib.decompressobj(), size
    with tempfile.TemporaryFile() as file:
        for start in range(0, len(packed), _PIECE):
            rest: memoryview | bytes = packed[start : start + _PIECE]
            while rest or not unpacker.eof:
                piece = unpacker.decompress(rest, _PIECE)
                rest, left = unpacker.unconsumed_tail, left - len(piece)
                if left < 0 or unpacker.unused_data:
                    raise ValueError(_SIZE)
                if not piece:
                    break
                file.write(piece)
        if left or not unpacker.eof:
            raise ValueError(_SIZE)
        file.seek(0)
        return Trace.from_file(file)


_SIZE = "a Trace does not have the size that is told"
