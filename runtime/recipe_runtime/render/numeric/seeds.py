"""Keys of the noise in pictures."""

from __future__ import annotations

import hashlib


def noise_key(seed: int, name: str, frame: int) -> int:
    """A 32-bit key of a seed, a name and a frame."""
    digest = hashlib.sha256(f"{seed}/{name}/{frame}".encode()).digest()
    return int.from_bytes(digest[:4], "little")
