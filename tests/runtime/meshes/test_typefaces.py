"""Typefaces of shop signs: every word can be written, letters fill their boxes and keep apart, and typefaces differ."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.facades import Facade
from recipe_runtime.meshes.lettering import FONT, WORDS, write
from recipe_runtime.meshes.mesh import Pattern, Surface
from recipe_runtime.meshes.typefaces import TYPEFACES, Typeface, word

faces = pytest.mark.parametrize("face", TYPEFACES, ids=range(len(TYPEFACES)))


def area(quads: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed areas of the two triangles of quadrilaterals, positive if counter-clockwise."""
    corners = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    x, y = corners[..., 0], corners[..., 1]
    return np.asarray(0.5 * (x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y).sum(1))


@faces
@pytest.mark.parametrize("text", [*WORDS, "BUS", "NEWS"])
def test_letters_fill_their_boxes_and_keep_apart(text: str, face: Typeface) -> None:
    """All outlines face the viewer, capitals have height 1, and upright letters stay in their boxes but for serifs."""
    written = word(text, face)
    assert (area(written.quads) > -1e-12).all()
    assert written.quads[..., 1].min() == pytest.approx(0.0, abs=0.02)
    assert written.quads[..., 1].max() == pytest.approx(1.0, abs=0.02)
    upright = written.quads[..., 0] - face.slant * written.quads[..., 1]
    assert upright.min() > -face.serif - 0.01
    assert upright.max() < written.length + face.serif + 0.01
    for (_, _, right, _), (_, left, _, _) in zip(written.boxes, written.boxes[1:], strict=False):
        assert left - right == pytest.approx(face.gap)


def test_typefaces_differ() -> None:
    """A word's length or amount of ink tells any two typefaces apart."""
    measures = [(w.length, area(w.quads).sum()) for w in (word("BAKERY", face) for face in TYPEFACES)]
    for n, one in enumerate(measures):
        for other in measures[:n]:
            assert max(abs(a / b - 1.0) for a, b in zip(one, other, strict=True)) > 0.1


def test_each_distance_has_one_version_of_a_sign() -> None:
    """Outlines near by and dots further away: the versions adjoin, and neither is shown twice."""
    b = Builder()
    write(b, Surface("sign", Pattern.LETTER, 3), Facade((0.0, 0.0), (0, 1), (1, 0), 4.0, 1), word("TEA", TYPEFACES[0]),
          2.0, 3.0, 0.3, 0.1)  # fmt: skip
    mesh = b.mesh()
    near, far = mesh.levels
    assert near.near == 0.0 and near.far == far.near and far.far == math.inf
    assert near.anchor == far.anchor == (0.1, 2.0, 3.15)
    assert mesh.level is not None and np.bincount(mesh.level)[1] == 2 * len("TEA")


def test_the_typefaces_have_every_letter_of_the_dots() -> None:
    for letter in FONT:
        assert len(word(letter, TYPEFACES[0]).quads)
