"""The arithmetic of insertion: area means, bilinear samples, exact least squares, and colour transforms."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.patches import TransferMethod
from recipe_runtime.insertion import color_transfer
from recipe_runtime.insertion.color_chart import COLORS, ChartPixels
from recipe_runtime.insertion.least_squares import least_squares
from recipe_runtime.insertion.warp import reduced, sampled, texture_size

from tests.runtime.insertion.images import bilinear, smooth

SMOOTH = smooth(40, 60, 1, 3)


@given(st.integers(1, 9), st.integers(1, 9), st.integers(1, 9), st.integers(1, 9), st.integers(0, 1000))
def test_a_reduced_image_has_the_mean_of_each_texels_area(h: int, w: int, height: int, width: int, seed: int) -> None:
    """Compared with repeated texels: enlarged by the target's size, the areas are integer numbers of texels."""
    height, width = min(h, height), min(w, width)
    image = np.random.default_rng(seed).integers(0, 256, (h, w, 3)).astype(np.uint8)
    large = np.repeat(np.repeat(image, height, 0), width, 1).astype(float)
    expected = large.reshape(height, h, width, w, 3).mean((1, 3))
    np.testing.assert_allclose(reduced(image, width, height), expected, atol=1e-9)


@given(st.lists(st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2)), min_size=1, max_size=20))
@settings(max_examples=50, deadline=None)
def test_samples_are_bilinear_between_texels_centres(points: list[tuple[float, float]]) -> None:
    u, v = np.array(points).T
    image = SMOOTH.astype(float)
    np.testing.assert_allclose(sampled(image, u, v), bilinear(image, u * 60 - 0.5, v * 40 - 0.5), atol=1e-9)


def test_a_texture_is_reduced_to_its_size_in_the_picture() -> None:
    """The size is the number of pixels across the texture in the picture, at most its number of texels."""
    for width, height in ((30, 20), (7, 33), (500, 400)):
        back = np.array([[1.0 / width, 0, 0], [0, 1.0 / height, 0], [0, 0, 1.0]])
        x, y = np.array([0.5, width - 0.5]), np.array([0.5, height - 0.5])
        found = texture_size((60, 40), back, x, y)
        assert abs(found[0] - min(width, 60)) <= 1 and abs(found[1] - min(height, 40)) <= 1
        assert found[0] <= 60 and found[1] <= 40


@given(st.integers(0, 10**6))
@settings(max_examples=30)
def test_least_squares_are_exact(seed: int) -> None:
    """The residual is orthogonal to every term, up to the rounding of the result, and numpy agrees."""
    random = np.random.default_rng(seed)
    rows = [[int(v) for v in row] for row in random.integers(-9, 10, (8, 3))]
    targets, weights = [int(v) for v in random.integers(-99, 100, 8)], [int(v) for v in random.integers(0, 4, 8)]
    found = least_squares(rows, targets, weights)
    matrix = np.array(rows) * np.sqrt(weights)[:, None]
    if np.linalg.matrix_rank(matrix) < 3:
        assert found is None
        return
    assert found is not None
    expected = np.linalg.lstsq(matrix, np.array(targets) * np.sqrt(weights), rcond=None)[0]
    np.testing.assert_allclose(found, expected, atol=1e-7)
    exact = [Fraction(v) for v in found]
    for term in range(3):
        gap: Fraction | int = sum(
            w * row[term] * (sum(a * b for a, b in zip(row, exact, strict=True)) - t)
            for row, t, w in zip(rows, targets, weights, strict=True)
        )
        assert abs(float(gap)) < 1e-9


def test_singular_systems_have_no_solution() -> None:
    assert least_squares([], []) is None
    assert least_squares([[1, 2], [2, 4]], [1, 2]) is None


def chart(change: NDArray[np.float64], hidden: tuple[int, ...] = ()) -> ChartPixels:
    """Return a chart whose colours are observed through an affine transform [3, 4] of linear light."""
    counts = np.zeros((24, 3, 256), np.int64)
    for cell, colour in enumerate(COLORS):
        linear = change @ np.array([*((np.array(colour) / 255) ** 2.2), 1.0])
        levels = np.rint(255 * np.clip(linear, 0, 1) ** (1 / 2.2)).astype(int)
        for channel in range(3):
            counts[cell, channel, levels[channel]] = 0 if cell in hidden else 5
    return ChartPixels(counts)


TEXTURE = np.array([[[250, 120, 30], [60, 60, 60], [20, 200, 90]]], float)
DIM = np.array([[0.5, 0.05, 0.0, 0.01], [0.02, 0.4, 0.02, 0.02], [0.0, 0.05, 0.3, 0.05]])


@pytest.mark.parametrize("hidden", [(), (0, 5, 12, 13, 20)])
def test_the_colour_matrix_is_recovered(hidden: tuple[int, ...]) -> None:
    """A change of light that is a matrix is recovered up to the rounding of levels, also with a hidden cell."""
    found = color_transfer.transfer("matrix", chart(DIM, hidden)).texture(TEXTURE)
    linear = (TEXTURE[0] / 255) ** 2.2 @ DIM[:, :3].T + DIM[:, 3]
    np.testing.assert_allclose(found[0], 255 * linear ** (1 / 2.2), atol=2.0)


def test_dapricots_ratio_is_to_the_placeholder_and_the_matrixs_to_its_prediction() -> None:
    green = np.array([[0, 144, 58], [0, 72, 29], [9, 8, 7]], np.uint8)
    for method in ("dapricot", "armory"):
        ratios = color_transfer.transfer(method, chart(DIM)).ratios(green)
        np.testing.assert_allclose(ratios, [[1.0], [0.5], [9 / 144]])
    seen = ((np.array([0, 144, 58]) / 255) ** 2.2 @ DIM[:, :3].T + DIM[:, 3]).max() ** (1 / 2.2) * 255
    np.testing.assert_allclose(color_transfer.transfer("matrix", chart(DIM)).ratios(green)[0], 144 / seen, rtol=0.02)


def test_reaps_lines_are_fitted_per_channel_without_outliers() -> None:
    counts = np.zeros((24, 3, 256), np.int64)
    for cell, colour in enumerate(COLORS):
        for channel, (a, b) in enumerate(((0.5, 10), (0.7, 0), (0.2, 90))):
            counts[cell, channel, int(np.rint(a * colour[channel] + b))] += 99
    counts[0, :, 255] += 12  # outliers: fewer than 1 %, far off
    lines = color_transfer.transfer("reap", ChartPixels(counts))
    np.testing.assert_allclose(lines.texture(np.full((1, 1, 3), 100.0))[0, 0], [60, 70, 110], atol=0.6)
    np.testing.assert_array_equal(lines.ratios(np.zeros((2, 3), np.uint8)), 1.0)


@pytest.mark.parametrize("method", ["dapricot", "matrix", "reap"])
def test_a_hidden_chart_does_not_change_the_brightness(method: TransferMethod) -> None:
    nothing = color_transfer.transfer(method, ChartPixels(np.zeros((24, 3, 256), np.int64)))
    np.testing.assert_array_equal(nothing.texture(TEXTURE), TEXTURE)
    assert nothing.reference == 144.0
