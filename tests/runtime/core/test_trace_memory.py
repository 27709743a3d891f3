"""A Trace is read from its file in chunks: memory does not grow with the number of frames, and digests are equal."""

from __future__ import annotations

import hashlib
import io
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import canonical_bytes, digest_array, digest_bytes
from recipe_runtime.cache.store import Store
from recipe_runtime.core import trace as trace_module
from recipe_runtime.core.trace import Trace, TraceWriter, frame_bytes
from recipe_runtime.core.transforms import part_transforms

from tests.runtime.fakes import scene_plan, simulate


def _peak(folder: Path, frames: int) -> int:
    command = [sys.executable, "-m", "tests.runtime.memory_probe", str(folder), str(frames)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3])
    return int(done.stdout)


@pytest.mark.slow
def test_memory_does_not_grow_with_frames(tmp_path: Path) -> None:
    """2,400 frames of 400 actors are 80 MiB, which had taken five times as much memory in every process."""
    few, many = _peak(tmp_path / "few", 100), _peak(tmp_path / "many", 2400)
    assert many < 1.1 * few, (few, many)


def _random(frames: int, sizes: list[int], seed: int) -> Trace:
    """Return a random Trace of actors with the given numbers of parts."""
    random = np.random.default_rng(seed)
    actors = tuple(f"a{n}" for n in range(len(sizes)))
    parts = tuple(f"{actor}/p{k}" for actor, size in zip(actors, sizes, strict=True) for k in range(size))

    def numbers(*shape: int) -> NDArray[np.int64]:
        return random.integers(-(1 << 30), 1 << 30, shape)

    return Trace(
        actors,
        parts,
        numbers(frames, len(parts), 3),
        numbers(frames, len(parts), 4).astype(np.int32),
        numbers(frames, len(actors), 3),
        numbers(frames, len(actors), 3),
    )


def _written(trace: Trace) -> Trace:
    """Return the same Trace, written frame by frame."""
    writer = TraceWriter(trace.actors, trace.parts, trace.frames)
    for k in reversed(range(trace.frames)):
        writer.write(k, frame_bytes(trace.positions[k], trace.rotations[k], trace.linear[k], trace.angular[k]))
    made = writer.trace()
    writer.close()
    return made


def _whole_digest(trace: Trace, actor: str, end: int) -> str:
    """Return an actor's digest by its definition, over complete arrays."""
    rows, a = trace.actor_parts(actor), trace.actors.index(actor)
    arrays = trace.positions[:end, rows], trace.rotations[:end, rows], trace.linear[:end, a], trace.angular[:end, a]
    return digest_bytes("trace-actor/1", *(digest_array("trace-array/1", array).encode() for array in arrays))


def _whole_bytes(trace: Trace) -> bytes:
    head = {"format": "recipe/trace/1", "actors": list(trace.actors), "parts": list(trace.parts)}
    arrays = trace.positions, trace.rotations, trace.linear, trace.angular
    body = canonical_bytes({**head, "frames": trace.frames}) + b"\n" + b"".join(array.tobytes() for array in arrays)
    return body + hashlib.sha256(body).digest()


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 9), st.lists(st.integers(1, 3), max_size=4), st.integers(1, 4000), st.integers(0, 99))
def test_chunks_of_any_size_give_the_same_bytes_and_digests(
    frames: int, sizes: list[int], chunk: int, seed: int
) -> None:
    trace, before = _random(frames, sizes, seed), trace_module._CHUNK
    data, ends = _whole_bytes(trace), list(range(frames + 1))
    wanted = {actor: [_whole_digest(trace, actor, end) for end in ends] for actor in trace.actors}
    trace_module._CHUNK = chunk
    try:
        file = io.BytesIO(data)
        for made in (trace, _written(trace), Trace.from_bytes(data), pickle.loads(pickle.dumps(trace))):
            assert made.to_bytes() == data
            assert made.prefix_digests(ends) == wanted
            assert made.digest == digest_bytes(
                "trace/1", canonical_bytes([[actor, wanted[actor][-1]] for actor in trace.actors])
            )
        assert trace_module._holds(file, len(data))
    finally:
        trace_module._CHUNK = before


@pytest.mark.parametrize("at", [0, 40, -1, -40])
def test_a_damaged_file_is_detected(tmp_path: Path, at: int) -> None:
    data = bytearray(_whole_bytes(_random(4, [2, 1], 0)))
    path = tmp_path / "trace"
    path.write_bytes(b"a line\n" + data)
    with path.open("rb") as file:
        file.readline()
        assert Trace.from_file(file).to_bytes() == data
    data[at] ^= 4
    path.write_bytes(data)
    with path.open("rb") as file, pytest.raises(ValueError, match="damaged"):
        Trace.from_file(file)


def test_a_trace_of_the_store_is_memory_mapped_and_read_only(tmp_path: Path) -> None:
    scene = scene_plan()
    trace = Store(tmp_path).trace(scene, lambda: simulate(scene))
    assert trace.mapping is not None
    assert not trace.positions.flags.writeable
    assert trace.to_bytes() == simulate(scene).to_bytes()


def test_many_frames_at_once_equal_single_frames() -> None:
    trace = _random(5, [2], 1)
    some = part_transforms(trace, slice(1, 4))
    assert (some == np.stack([part_transforms(trace, k) for k in (1, 2, 3)])).all()
