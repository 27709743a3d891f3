"""Lettering on shop signs: outlines of a typeface and, from some distance on, one quadrilateral per letter.

Such a letter has 4 x 6 dots. The integer part of u encodes its upper three rows, the integer part of v its lower
three; the fractions are the position in the letter. `Pattern.LETTER` therefore needs no table; it joins the dots to
strokes, and draws outlines as parts of a letter whose dots are all inked.
"""

from __future__ import annotations

import math

import numpy as np

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.facades import Facade
from recipe_runtime.meshes.mesh import Surface
from recipe_runtime.meshes.typefaces import Word

_INKED = 4095.5  # uv in the middle of a letter whose dots are all inked
_FAR = 70.0  # heights of a letter: the distance from which its dots suffice, where it is 9 pixels high

WORDS = (
    "CAFE", "BAKERY", "BOOKS", "PHARMACY", "MARKET", "FLOWERS", "OPTICS", "PIZZA", "SHOES", "BANK", "TOYS", "BARBER",
    "HOTEL", "BISTRO", "MUSIC", "TAILOR", "RADIO", "GALLERY", "TEA", "FISH", "WINE", "POST", "DELI", "CLOCKS",
)  # fmt: skip

FONT = {
    "A": "0110 1001 1001 1111 1001 1001", "B": "1110 1001 1110 1001 1001 1110", "C": "0111 1000 1000 1000 1000 0111",
    "D": "1110 1001 1001 1001 1001 1110", "E": "1111 1000 1110 1000 1000 1111", "F": "1111 1000 1110 1000 1000 1000",
    "G": "0111 1000 1011 1001 1001 0111", "H": "1001 1001 1111 1001 1001 1001", "I": "0110 0110 0110 0110 0110 0110",
    "K": "1001 1010 1100 1100 1010 1001", "L": "1000 1000 1000 1000 1000 1111", "M": "1001 1111 1111 1001 1001 1001",
    "N": "1001 1101 1101 1011 1011 1001", "O": "0110 1001 1001 1001 1001 0110", "P": "1110 1001 1001 1110 1000 1000",
    "R": "1110 1001 1001 1110 1010 1001", "S": "0111 1000 0110 0001 0001 1110", "T": "1111 0110 0110 0110 0110 0110",
    "U": "1001 1001 1001 1001 1001 0110", "W": "1001 1001 1001 1111 1111 1001", "X": "1001 1001 0110 0110 1001 1001",
    "Y": "1001 1001 1001 0110 0110 0110", "Z": "1111 0001 0010 0100 1000 1111",
}  # fmt: skip


def bits(letter: str) -> tuple[int, int]:
    """Return the dots of a letter's upper and lower half, 12 bits each, the first dot in the highest bit."""
    rows = FONT[letter].replace(" ", "")
    return int(rows[:12], 2), int(rows[12:], 2)


def write(
    b: Builder, surface: Surface, f: Facade, text: Word, middle: float, z: float, height: float, d: float
) -> None:
    """Add a text to a facade: its outlines near by, and a quadrilateral per letter further away.

    Args:
        b: The builder.
        surface: The surface of the letters, with `Pattern.LETTER`.
        f: The facade.
        text: The text, in a typeface.
        middle: u of its middle, metres.
        z: Height of its lower edge, metres.
        height: Height of the letters, metres.
        d: Distance from the facade, metres.
    """
    start, far = middle - text.length * height / 2, _FAR * height
    anchor = f.at(middle, d, z + height / 2)
    with b.level(0.0, far, anchor=anchor, casts=False):
        u, up = start + text.quads[..., 0] * height, z + text.quads[..., 1] * height
        x, y = f.at(0.0, d, 0.0)[:2]
        b.quads(
            surface, np.stack([x + u * f.right[0], y + u * f.right[1], up], axis=-1), np.full((len(u), 4, 2), _INKED)
        )
    quads, uvs = [], []
    for letter, left, right, tall in text.boxes:
        quads.append(f.face(start + left * height, start + right * height, z, z + tall * height, d))
        high, low = bits(letter)
        a, c, e = 0.004, 0.996, 0.25 if letter == "I" else 0.0  # the dots of an I are the two in the middle
        uvs.append([(high + a + e, low + a), (high + c - e, low + a), (high + c - e, low + c), (high + a + e, low + c)])
    with b.level(far, math.inf, anchor=anchor, casts=False):
        b.quads(surface, np.array(quads), np.array(uvs))
