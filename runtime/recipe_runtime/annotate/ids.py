"""Ids of videos, images, tracks and annotations: digests of their names, so that they stay when a dataset is extended.

An id is a positive integer below 2^53, which JSON readers and pycocotools' float64 tables hold exactly. Two of n names
have one id with a probability of n^2 / 2^54: less than one in a million for 100,000 annotations.
`UniqueIds` detects it.
"""

from __future__ import annotations

import hashlib
import json

from recipe_compiler.ir.errors import InputError

ID_LIMIT = 1 << 53


def video_id(variant: str, sensor: str) -> int:
    """Return the id of a video."""
    return _id("video", variant, sensor)


def image_id(variant: str, sensor: str, frame: int) -> int:
    """Return the id of a frame, equal in every annotation file."""
    return _id("image", variant, sensor, frame)


def track_id(variant: str, actor: str) -> int:
    """Return the id of an actor's track: one in all sensors of a variant, another one in every other variant."""
    return _id("track", variant, actor)


def annotation_id(variant: str, sensor: str, frame: int, actor: str) -> int:
    """Return the id of an actor's annotation in a frame."""
    return _id("annotation", variant, sensor, frame, actor)


class UniqueIds:
    """The ids of one table of an annotation file."""

    def __init__(self, table: str) -> None:
        self._table = table
        self._seen: set[int] = set()

    def add(self, number: int) -> int:
        """Return the id.

        Raises:
            InputError: Another row of the table has it.
        """
        if number in self._seen:
            raise InputError(
                f"two {self._table} have the id {number}, which is a digest of their names",
                help="rename an axis value, a sensor or an actor",
            )
        self._seen.add(number)
        return number


def _id(*names: str | int) -> int:
    body = b"recipe/annotation-id/1\n" + json.dumps(names).encode()
    return 1 + int.from_bytes(hashlib.sha256(body).digest()[:8], "big") % (ID_LIMIT - 1)
