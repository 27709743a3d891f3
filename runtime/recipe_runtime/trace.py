"""The Trace: where every rigid part of every actor is at every frame, on an integer grid.

Positions are whole multiples of 2^-20 m, quaternions (x, y, z, w) of 2^-24, velocities of 2^-20 m/s. Snapping hides
lone ulps, and integers have one byte form; so a Trace has a digest, and from it onward every host agrees.
"""

from __future__ import annotations

import hashlib
import io
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.canonical import canonical_bytes, digest_array, digest_bytes

METRE = 1 << 20
UNIT = 1 << 24
_FORMAT = "recipe/trace/1"


@dataclass(frozen=True)
class Trace:
    """Motion of F frames, P rigid parts and A actors, in the world frame.

    `parts` names them `actor/part`, actors in plan order, each actor's base part first. `linear` and `angular` are
    the velocities of each actor's base.
    """

    actors: tuple[str, ...]
    parts: tuple[str, ...]
    positions: NDArray[np.int64]  # [F, P, 3], 2^-20 m
    rotations: NDArray[np.int32]  # [F, P, 4], x y z w, 2^-24
    linear: NDArray[np.int64]  # [F, A, 3], 2^-20 m/s
    angular: NDArray[np.int64]  # [F, A, 3], 2^-20 rad/s

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @cached_property
    def digest(self) -> str:
        """Identity of the motion: over the digest of every actor's."""
        return digest_bytes("trace/1", canonical_bytes([[a, self.actor_digest(a)] for a in self.actors]))

    def actor_parts(self, actor: str) -> list[int]:
        """Indices of an actor's parts, its base first."""
        return [i for i, part in enumerate(self.parts) if part.rpartition("/")[0] == actor]

    def base_part(self, actor: str) -> int:
        """Index of an actor's base part."""
        return self.actor_parts(actor)[0]

    def actor_digest(self, actor: str, frames: int | None = None) -> str:
        """Identity of one actor's motion over the first `frames` frames (all by default)."""
        rows, a = self.actor_parts(actor), self.actors.index(actor)
        chunks: tuple[NDArray[Any], ...] = (
            self.positions[:frames, rows],
            self.rotations[:frames, rows],
            self.linear[:frames, a],
            self.angular[:frames, a],
        )
        return digest_bytes("trace-actor/1", *(digest_array("trace-array/1", c).encode() for c in chunks))

    def to_bytes(self) -> bytes:
        """One byte form: a header line, four arrays, a checksum."""
        head = canonical_bytes(
            {"format": _FORMAT, "actors": list(self.actors), "parts": list(self.parts), "frames": self.frames}
        )
        body = head + b"\n" + b"".join(np.ascontiguousarray(a).tobytes() for a in self._arrays())
        return body + hashlib.sha256(body).digest()

    @classmethod
    def from_bytes(cls, data: bytes) -> Trace:
        """The inverse of `to_bytes`; ValueError if the bytes are damaged."""
        import json

        body, checksum = data[:-32], data[-32:]
        if hashlib.sha256(body).digest() != checksum:
            raise ValueError("the Trace is damaged: its checksum does not hold")
        stream = io.BytesIO(body)
        try:
            head = json.loads(stream.readline())
        except RecursionError:
            raise ValueError("the Trace's header is nested too deeply") from None
        if not isinstance(head, dict) or head.get("format") != _FORMAT:
            raise ValueError(f"not a Trace of format {_FORMAT}")
        f, (p, a) = head.get("frames"), (_count(head.get(names)) for names in ("parts", "actors"))
        if type(f) is not int or not 0 <= f <= len(data):
            raise ValueError(f"a Trace cannot have {str(f)[:40]} frames")
        if len(body) - stream.tell() != f * (p * (3 * 8 + 4 * 4) + a * 6 * 8):
            raise ValueError("the Trace's arrays are not as long as its header says")

        def read(dtype: str, *shape: int) -> NDArray[Any]:
            return np.frombuffer(stream.read(math.prod(shape) * np.dtype(dtype).itemsize), dtype).reshape(shape)

        return cls(
            actors=tuple(head["actors"]),
            parts=tuple(head["parts"]),
            positions=read("<i8", f, p, 3),
            rotations=read("<i4", f, p, 4),
            linear=read("<i8", f, a, 3),
            angular=read("<i8", f, a, 3),
        )

    def _arrays(self) -> tuple[NDArray[Any], ...]:
        return (
            self.positions.astype("<i8"),
            self.rotations.astype("<i4"),
            self.linear.astype("<i8"),
            self.angular.astype("<i8"),
        )


def _count(names: Any) -> int:
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError("the Trace's parts or actors are no list of names")
    return len(names)
