"""STL, binary and text: triangles without material, each with its own corners."""

from __future__ import annotations

import itertools
import re
from array import array

import numpy as np

from recipe_compiler.ir.assets.geometry import MAX_TRIANGLES, AssetError, Floats, Raw, check_count

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)")
SLOT = "body"


def read(content: bytes) -> list[Raw]:
    """Return the triangles, visible from both sides; the file's normals are ignored."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + _FACET.itemsize * count:
        check_count(count, "triangles", MAX_TRIANGLES)
        corners: Floats = np.frombuffer(content, _FACET, count, 84)["corners"].astype(np.float64).reshape(-1, 3)
    elif content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        corners = _text(content)
    elif len(content) < 84:
        raise AssetError("is not an STL file: it is shorter than a header of 84 bytes; export it again")
    else:
        expected = 84 + _FACET.itemsize * count
        raise AssetError(
            f"its header states {count} triangles ({expected} bytes), but it has {len(content)} bytes; export it again"
        )
    triangles = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
    return [Raw(SLOT, corners, triangles, both_sides=True)]


def _text(content: bytes) -> Floats:
    lower = content.lower()
    count = lower.count(b"endfacet")
    check_count(count, "triangles", MAX_TRIANGLES)
    numbers = array("d")
    for row in itertools.islice(_VERTEX.finditer(lower), 3 * count + 1):
        numbers.extend([number(word) for word in row.groups()])
    if len(numbers) != 9 * count or b"endsolid" not in lower:
        raise AssetError(
            f"is truncated or damaged: it has not three corners for each of {count} triangles; export it again"
        )
    return np.array(numbers, np.float64).reshape(-1, 3)


def number(word: bytes) -> float:
    """Parse a number, correctly rounded.

    Raises:
        AssetError: the word is not a number.
    """
    try:
        if b"_" not in word:
            return float(word)
    except ValueError:
        pass
    raise AssetError(f"{word[:20].decode('ascii', 'replace')!r} is not a number; export it again")
