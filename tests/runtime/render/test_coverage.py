"""Coverage of pixels by edges and thin lines, against the areas of the lines."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import CAMERA, EYE, PAINT, parts_at, quad, street

SMALL = CameraPlan(width=48, height=32, fov=90)
PIXEL = 10.0 / optics.focal_length(SMALL)  # metres on a plane at a distance of 10 m
STEPS = 40  # positions within a pixel


def coverage(renderer: Renderer, pose: Pose) -> NDArray[np.float64]:
    """Return the weight of all surfaces in each pixel, [H, W]."""
    seen = renderer.observe(SMALL, from_pose(pose), np.zeros((0, 3, 4)))
    points = renderer._camera._sampler.points(seen, antialias=True)
    shown = points.data.surfaces.numpy()[: points.count] >= 0
    pixels, weights = points.data.pixels.numpy()[: points.count], points.weights.numpy()[: points.count]
    covered = np.bincount(pixels[shown], weights[shown], SMALL.width * SMALL.height)
    return covered.astype(np.float64).reshape(SMALL.height, SMALL.width)


@pytest.mark.parametrize("width", [0.1, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("upright", [False, True])
def test_a_thin_line_has_its_width_and_does_not_flicker(width: float, upright: bool) -> None:
    """In a slow pan its mean coverage is its width, and no pixel along it differs by more than a sample."""
    long, thin = 4.0, 0.5 * width * PIXEL
    y, z = (thin, long) if upright else (long, thin)
    line = quad([[10, y, -z], [10, -y, -z], [10, -y, z], [10, y, z]], [[0, 0]] * 4, PAINT)
    renderer = Renderer([Body("line", 0, (("base", line),))])
    found = []
    for step in range(STEPS):
        moved = (step + 0.37) / STEPS * PIXEL
        picture = coverage(renderer, Pose(y=moved) if upright else Pose(z=moved))
        along = picture.sum(axis=1)[12:20] if upright else picture.sum(axis=0)[18:30]
        assert np.ptp(along) < 1e-6, "a line parallel to an axis is not dashed"
        found.append(along[0])
    assert np.mean(found) == pytest.approx(width, abs=0.01)
    assert np.abs(np.array(found) - width).max() < 0.2


def test_the_labelled_surface_of_a_pixel_is_in_the_picture() -> None:
    """A pixel's first sample is its centre, from which labels follow; its weight is at least a fifth."""
    renderer = Renderer(street())
    for frame in (0, 1, 2):
        seen = renderer.observe(CAMERA, EYE, parts_at(frame))
        points = renderer._camera._sampler.points(seen, antialias=True)
        first, weights = points.starts.numpy(), points.weights.numpy()
        np.testing.assert_array_equal(points.data.keys.numpy()[first], seen.keys.numpy())
        assert weights[first].min() > 0.19
        counts = points.groups.numpy() & 7
        assert counts.max() > 2
        totals = [weights[k : k + n].sum() for k, n in zip(first, counts, strict=True)]
        np.testing.assert_allclose(totals, 1.0, atol=1e-6)
