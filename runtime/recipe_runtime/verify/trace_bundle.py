"""Files of Traces next to lockfiles, for hosts whose own simulation differs.

    lockfiles/<recipe>.traces
        recipe-traces 1
        SCENE-DIGEST TRACE-DIGEST COMPRESSED-BYTES RAW-BYTES     one line per Trace, then its zlib-compressed bytes
        ...

The file is not trusted. A Trace is accepted only if it has the digest in the lockfile, and sizes are limited before
anything is unpacked.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core.files import host_errors, write_atomic
from recipe_runtime.core.trace import Trace

SUFFIX = ".traces"
MAX_BYTES = 1 << 30  # limit of the file, and of a Trace
_HEAD = b"recipe-traces 1\n"
# Bytes of a Trace: of its header, and for each actor of the names of its parts, and of a frame.
_MAX_HEADER, _MAX_NAMES, _MAX_POSE = 1 << 20, 1 << 13, 1 << 10
_MAX_LINE = 400


def beside(lockfile: Path) -> Path:
    """Return the path of the traces of a lockfile."""
    return lockfile.with_suffix(SUFFIX)


def dumps(traces: Mapping[str, Trace]) -> bytes:
    """Return the content of a file of traces.

    Args:
        traces: Traces by scene digest.
    """
    pieces = [_HEAD]
    for scene, trace in sorted(traces.items()):
        raw = trace.to_bytes()
        packed = zlib.compress(raw, 9)
        pieces += [f"{scene} {trace.digest} {len(packed)} {len(raw)}\n".encode(), packed]
    return b"".join(pieces)


def write(path: Path, traces: Mapping[str, Trace]) -> bool:
    """Write a file of traces in place of any file, unless that has this content; return whether it was written."""
    body = dumps(traces)
    if path.is_file() and path.stat().st_size == len(body) and path.read_bytes() == body:
        return False
    with host_errors(str(path), "free some space or allow writing"):
        write_atomic(path, body)
    return True


def check_replaceable(path: Path, *, replace: bool = False) -> None:
    """Check that a file of traces can be written.

    Raises:
        InputError: the path is a folder, or exists, is not a file of traces, and `replace` is not set.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder", help="move it away", code=Code.OUTPUT_IN_THE_WAY)
    if replace or not path.is_file():
        return
    with path.open("rb") as file:
        if file.read(len(_HEAD)) != _HEAD:
            raise InputError(
                f"{path} exists already and is not a file of traces",
                help="move it away, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )


def read(path: Path, locked: Mapping[str, str], limits: Mapping[str, int]) -> dict[str, Trace]:
    """Read the traces next to a lockfile.

    Args:
        path: the file.
        locked: the digest of each scene's Trace, as the lockfile has it.
        limits: the most bytes of each scene's Trace (`size_limits`). Traces of other scenes are skipped.

    Returns:
        The traces by scene; none if there is no file.

    Raises:
        InputError: the file is damaged, or holds a Trace that is not the locked one.
    """
    if not path.exists():
        return {}
    try:
        body = read_regular(path, MAX_BYTES)
        if len(body) > MAX_BYTES or not body.startswith(_HEAD):
            raise ValueError("it is not a file of traces, or too large")
        return _entries(body, locked, limits)
    except (OSError, ValueError, KeyError, zlib.error, TypeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(
            f"{path}: cannot be used: {reason}",
            help="lock the recipe again, with traces",
            code=Code.INVALID_LOCKFILE,
        ) from None


def size_limits(plan: DatasetPlan) -> dict[str, int]:
    """Return the maximal size in bytes of each scene's Trace."""
    scenes = {variant.scene.digest: variant.scene for variant in plan.variants}
    return {
        digest: min(MAX_BYTES, _MAX_HEADER + len(scene.actors) * (_MAX_NAMES + _MAX_POSE * scene.clock.frames))
        for digest, scene in scenes.items()
    }


def _entries(body: bytes, locked: Mapping[str, str], limits: Mapping[str, int]) -> dict[str, Trace]:
    found: dict[str, Trace] = {}
    seen, at = set[str](), len(_HEAD)
    while at < len(body):
        end = body.index(b"\n", at, at + _MAX_LINE)
        scene, digest, packed, raw = body[at:end].decode("ascii").split(" ")
        at = end + 1 + int(packed)
        if locked.get(scene) != digest:
            raise ValueError(f"it holds a Trace of scene {scene[:16]} that is not the lockfile's")
        if scene in seen or int(raw) > limits.get(scene, MAX_BYTES):
            raise ValueError(f"it holds scene {scene[:16]} twice, or more motion than the scene has")
        seen.add(scene)
        if scene not in limits:  # the recipe was changed after it was locked
            continue
        trace = _unpacked(memoryview(body)[end + 1 : at], int(raw))
        if trace.digest != digest:
            raise ValueError(f"the Trace of scene {scene[:16]} is not what its digest says")
        found[scene] = trace
    return found


def _unpacked(packed: memoryview, size: int) -> Trace:
    """Unpack a Trace; more bytes than `size` are refused before they are unpacked."""
    if not 0 < size <= MAX_BYTES:
        raise ValueError(f"a Trace cannot have {size} bytes")
    unpacker = zlib.decompressobj()
    raw = unpacker.decompress(packed, size + 1)
    if len(raw) != size or not unpacker.eof or unpacker.unused_data:
        raise ValueError("a Trace does not have the stated size")
    return Trace.from_bytes(raw)
