"""Lettering on shop signs, one quadrilateral per letter.

A letter has 4 x 6 dots. The integer part of u encodes its upper three rows, the integer part of v its lower three; the
fractions are the position in the letter. `Pattern.LETTER` therefore needs no table; it joins the dots to strokes.
"""

from __future__ import annotations

import numpy as np

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.facades import Facade
from recipe_runtime.meshes.mesh import Surface

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


def write(b: Builder, surface: Surface, f: Facade, text: str, middle: float, z: float, height: float, d: float) -> None:
    """Add a text to a facade.

    Args:
        b: The builder.
        surface: The surface of the letters.
        f: The facade.
        text: The text.
        middle: u of its middle, metres.
        z: Height of its lower edge, metres.
        height: Height of the letters, metres.
        d: Distance from the facade, metres.
    """
    wide, gap = 0.68 * height, 0.2 * height
    start = middle - (len(text) * (wide + gap) - gap) / 2
    quads, uvs = [], []
    for n, letter in enumerate(text):
        u = start + n * (wide + gap)
        quads.append(f.face(u, u + wide, z, z + height, d))
        high, low = bits(letter)
        a, c = 0.004, 0.996
        uvs.append([(high + a, low + a), (high + c, low + a), (high + c, low + c), (high + a, low + c)])
    b.quads(surface, np.array(quads), np.array(uvs))


def length(text: str, height: float) -> float:
    """Return the length in metres of a text of that height."""
    return len(text) * 0.88 * height
