"""The camera's Bayer sensor: mosaic, demosaicking and noise follow independent formulas, and reuse changes no byte."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import PatchTexture
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse
from recipe_runtime.attacks.textures import differentiable_patch
from recipe_runtime.render.camera import exposure
from recipe_runtime.render.camera.bayer_kernels import develop_mosaic, measure
from recipe_runtime.render.camera.develop_kernels import LEVELS
from recipe_runtime.render.camera.responses import response_of
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.renderer import Renderer

from tests.runtime.attacks.test_patch_view import scene_of
from tests.runtime.render.street import CAMERA, EYE, WEATHERS, parts_at, street
from tests.runtime.render.test_patches import file_of, patch, with_patches

Light = NDArray[np.float64]
WIDE, HIGH = CAMERA.width, CAMERA.height

# Malvar, He and Cutler (2004), figure 2, in eighths: green at red or blue; red at green in a row of red; the same in a
# column of red, transposed; red at blue. Blue follows by symmetry.
GREEN = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
ROW = np.array([[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]) / 8
OPPOSITE = np.array([[0, 0, -1.5, 0, 0], [0, 2, 0, 2, 0], [-1.5, 0, 6, 0, -1.5], [0, 2, 0, 2, 0], [0, 0, -1.5, 0, 0]])
BELL = np.outer([0.2, 0.6, 0.2], [0.2, 0.6, 0.2])


def filtered(image: Light, kernel: Light) -> Light:
    """Correlate an image, mirrored at its border, with a kernel."""
    reach = len(kernel) // 2
    wide = np.pad(image, reach, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(wide, kernel.shape)
    total: Light = (windows * kernel).sum(axis=(-2, -1))
    return total


def mosaic_of(light: Light) -> Light:
    """Return what the sensor measures of light [H, W, 3], without noise."""
    soft = [filtered(light[..., c], BELL) for c in range(3)]
    y, x = np.indices(light.shape[:2])
    measured: Light = np.choose((y & 1) + (x & 1), soft)
    return measured


def demosaicked(mosaic: Light) -> Light:
    """Return the light [H, W, 3] that the paper's filters estimate from a mosaic RGGB."""
    y, x = np.indices(mosaic.shape)
    green, row, opposite = (filtered(mosaic, k) for k in (GREEN, ROW, OPPOSITE / 8))
    column = filtered(mosaic, ROW.T)
    even_y, even_x = y % 2 == 0, x % 2 == 0
    is_green = even_y != even_x
    red = np.where(is_green, np.where(even_y, row, column), np.where(even_y, mosaic, opposite))
    blue = np.where(is_green, np.where(even_y, column, row), np.where(even_y, opposite, mosaic))
    return np.stack([red, np.where(is_green, mosaic, green), blue], axis=-1)


def tone(x: Light) -> Light:
    x = np.maximum(x, 0.0)
    shown: Light = np.minimum(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 1.0)
    return shown


def developed(light: Light, noise: float) -> tuple[Light, Light, NDArray[np.uint8]]:
    """Return the mosaic [H, W], the tone-mapped light and the bytes [H, W, 3] of light [H, W, 3]."""
    response = response_of(CameraResponse(noise=noise, sensor="bayer"), 1.0, 77, CAMERA)
    pixels = WIDE * HIGH
    mosaic, shown = wp.empty(pixels, dtype=wp.float32), wp.empty(pixels, dtype=wp.vec3f)
    out = wp.empty(pixels * 3, dtype=wp.uint8)
    fallen: wp.array[wp.vec3f] = wp.array(light.reshape(-1, 3).astype(np.float32), dtype=wp.vec3f)
    deviates: wp.array[wp.float32] = wp.array(exposure.deviates(), dtype=wp.float32)
    table: wp.array[wp.uint8] = wp.array(exposure.tone_table(int(LEVELS), 2.2), dtype=wp.uint8)
    launch(measure, pixels, "cpu", light=fallen, response=response, deviates=deviates, out_mosaic=mosaic)
    written = {"tone_table": table, "out_rgb": out, "out_light": shown}
    launch(develop_mosaic, pixels, "cpu", mosaic=mosaic, response=response, **written)
    shape = HIGH, WIDE, 3
    return mosaic.numpy().reshape(HIGH, WIDE), shown.numpy().reshape(shape), out.numpy().reshape(shape)


def having(weather: str, **settings: float | str | None) -> AppearancePlan:
    response = CameraResponse.model_validate({"sensor": "bayer", **settings})
    return WEATHERS[weather].model_copy(update={"responses": {"street": response}})


def test_mosaic_and_demosaicking_follow_the_paper() -> None:
    light = np.random.default_rng(3).uniform(0.0, 2.0, (HIGH, WIDE, 3))
    mosaic, shown, _ = developed(light, 0.0)
    np.testing.assert_allclose(mosaic, mosaic_of(light), atol=2e-6)
    np.testing.assert_allclose(shown, tone(demosaicked(mosaic_of(light))), atol=2e-5)


def test_a_flat_colour_keeps_its_bytes() -> None:
    """Without noise, neither mosaic nor border shows on a surface of one colour."""
    colour = np.array([0.7, 0.3, 0.1])
    _, _, picture = developed(np.broadcast_to(colour, (HIGH, WIDE, 3)), 0.0)
    table = exposure.tone_table(int(LEVELS), 2.2)
    expected = [int(table[int(v * (LEVELS - 1) + 0.5)]) for v in tone(colour)]
    assert np.abs(picture.astype(int) - expected).max() <= 1


@pytest.mark.parametrize("grey", [0.0, 0.05, 0.4, 2.0])
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_the_variance_of_the_noise_is_that_of_read_and_shot_noise(grey: float, noise: float) -> None:
    mosaic, _, _ = developed(np.full((HIGH, WIDE, 3), grey), noise)
    apart = mosaic - grey
    expected = noise * noise * (1e-6 + 1e-4 * grey)
    assert float(np.mean(apart * apart)) == pytest.approx(expected, rel=0.06)  # of 6144 pixels: 3.3 deviations
    assert abs(float(np.mean(apart))) < 4.0 * np.sqrt(expected / apart.size)
    assert abs(np.mean(apart[:, 1:] * apart[:, :-1])) < 0.06 * expected


def test_demosaicking_correlates_the_noise_of_neighbours() -> None:
    """This is what distinguishes a developed picture from one with independent noise in each value."""
    _, shown, _ = developed(np.full((HIGH, WIDE, 3), 0.4), 3.0)
    red = shown[..., 0] - shown[..., 0].mean()
    assert np.mean(red[:, 1:] * red[:, :-1]) > 0.2 * np.mean(red * red)


def test_a_pixel_saturates() -> None:
    mosaic, _, picture = developed(np.full((HIGH, WIDE, 3), 50.0), 1.0)
    assert float(mosaic.max()) == float(mosaic.min()) == np.float32(7.2)
    assert picture.min() == 255


@pytest.mark.parametrize("weather", ["noon", "rainy"])
def test_reuse_changes_no_byte(weather: str) -> None:
    """A changed pixel changes its neighbours, also those whose own light a static camera reuses."""
    keeping, plan = Renderer(street()), having(weather)
    for frame in (0, 1, 2, 12):
        alone = Renderer(street(), reuse=NO_REUSE)
        kept, fresh = (
            r.shade(r.observe(CAMERA, EYE, parts_at(frame)), plan, "street", frame, frame / 30)
            for r in (keeping, alone)
        )
        np.testing.assert_array_equal(kept, fresh)


def test_a_grey_edge_is_softer_and_has_coloured_fringes_beside_it_only() -> None:
    light = np.full((HIGH, WIDE, 3), 0.05)
    light[:, WIDE // 2 :] = 0.8
    _, shown, _ = developed(light, 0.0)
    row, whole = shown[HIGH // 2], float(tone(light)[0, -1, 1] - tone(light)[0, 0, 1])
    assert np.abs(np.diff(row[:, 1])).max() < 0.7 * whole
    apart = np.abs(row[:, 0] - row[:, 2])
    near = slice(WIDE // 2 - 4, WIDE // 2 + 4)
    assert apart[near].max() > 0.01 and np.delete(apart, near).max() < 1e-5


def test_the_picture_is_otherwise_the_same() -> None:
    """A channel, an exposure or a vignette that is lost would change the mean of a picture."""
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    plain, bayer = (
        renderer.shade(seen, having("noon", sensor=s, noise=0.0), "street", 0, 0.0).astype(float)
        for s in (None, "bayer")
    )
    assert 0.0 < np.abs(bayer - plain).mean() < 6.0
    assert np.abs(bayer.mean(axis=(0, 1)) - plain.mean(axis=(0, 1))).max() < 1.5


def test_other_textures_render_as_in_a_build_and_gradients_are_refused() -> None:
    own, other = (np.full((24, 32, 3), level, np.uint8) for level in (40, 220))

    def plan(image: NDArray[np.uint8]) -> AppearancePlan:
        responses = having("noon").responses
        appearance = with_patches(WEATHERS["noon"], patch(PatchTexture(image=file_of(image))))
        return appearance.model_copy(update={"responses": responses})

    with pytest.raises(InputError, match=r"no gradient in the pictures of street.*sensor: bayer"):
        differentiable_patch(plan(own), "street", "poster")
    scene = scene_of(own, other)
    seen = scene.see(CAMERA, EYE)
    renderer = scene.renderer
    frame = renderer.patched_frame(seen, plan(own), "street", 0, 0.0)
    expected = renderer.shade(seen, plan(other), "street", 0, 0.0)
    np.testing.assert_array_equal(frame.render({"poster": other}), expected)
    assert (frame.render({}) != expected).any()
