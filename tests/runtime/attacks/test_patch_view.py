"""Frames with other textures equal those of a recipe with these textures; the gradient fits the renderer."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.patches import PatchFace, PatchTexture
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse, Pose
from recipe_runtime.attacks.patch_view import PatchView
from recipe_runtime.attacks.textures import as_image
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import Values, vectors
from recipe_runtime.render.linear.mip_chain import MipChain
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.texture.mipmaps import mip_levels
from recipe_runtime.render.texture.surface_colours import srgb_to_linear

from tests.runtime.attacks.numpy_map import inverse_tone, linear_light, linearised, tone
from tests.runtime.render.street import WEATHERS
from tests.runtime.render.test_patches import FACE, Pixels, Scene, file_of, noise, of_colour, patch, with_patches

OWN, OTHER = noise(24, 32), noise(24, 32, 5)
ON_ROAD = PatchFace(
    part="static", corner=(4.0, 1.5, 0.0), right=(0.0, -1.0, 0.0), down=(-1.0, 0.0, 0.0), width=2, height=2, reach=0.02
)
LENSES: dict[str, dict[str, Any]] = {
    "plain": {},
    "noisy": {"noise": 2.0, "gamma": 2.4, "temp": 4500.0, "vignette_intensity": 0.8},
    "coarse": {"antialias": False},
    "lens": {"supersample": 2, "bloom_intensity": 0.7, "chromatic_aberration_intensity": 0.5},
}


def plan_of(texture: Pixels, weather: str, lens: str = "plain") -> AppearancePlan:
    """A poster on the wall, a bright sticker over its corner, and varnish on the road."""
    small = FACE.model_copy(update={"corner": (6.9, 4.0, 2.2), "width": 0.9, "height": 0.7})
    patches = (
        patch(PatchTexture(image=file_of(texture))),
        patch(of_colour("#ffd000"), faces=(small,), name="sticker", emission=40.0),
        patch(of_colour("#3060c0"), "road", (ON_ROAD,), name="road", gloss=0.6),
    )
    plan = WEATHERS[weather].model_copy(update={"responses": {"street": CameraResponse(**LENSES[lens])}})
    return with_patches(plan, *patches)


def scene_of(*textures: Pixels) -> Scene:
    return Scene({file_of(texture).sha256: texture for texture in textures})


def frame_of(scene: Scene, plan: AppearancePlan, frame: int = 0) -> PatchedFrame:
    return scene.renderer.patched_frame(scene.see(frame=frame), plan, "street", frame, frame / 30)


def view_of(weather: str, texture: Pixels = OWN, lens: str = "plain") -> PatchView:
    height, width = texture.shape[:2]
    return PatchView(frame_of(scene_of(texture), plan_of(texture, weather, lens)), "poster", width, height)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("weather", "lens"),
    [*((weather, "lens") for weather in WEATHERS), *(("rainy", lens) for lens in LENSES if lens != "lens")],
)
def test_a_frame_with_another_texture_has_the_bytes_of_a_recipe_with_it(weather: str, lens: str) -> None:
    """This includes textures of other sizes, several patches at once, and frames rendered in between."""
    scene = scene_of(OWN, OTHER)
    kept = [frame_of(scene, plan_of(OWN, weather, lens), number) for number in (0, 1, 2)]
    for number, frame in enumerate(kept):
        seen = scene.see(frame=number)
        want = scene.show(seen, plan_of(OTHER, weather, lens), number)
        np.testing.assert_array_equal(frame.render({"poster": OTHER}), want)
        before = scene.show(seen, plan_of(OWN, weather, lens), number)
        np.testing.assert_array_equal(frame.render({}), before)
        assert (before != want).any()
    large = noise(70, 45, 3)
    want = scene_of(large).show(scene_of(large).see(), plan_of(large, weather, lens))
    np.testing.assert_array_equal(kept[0].render({"poster": large}), want)
    grey = np.full((2, 2, 3), 128, np.uint8)
    plan = plan_of(OTHER, weather, lens)
    recoloured = tuple(
        p.model_copy(update={"texture": of_colour("#808080")}) if p.name == "road" else p for p in plan.patches
    )
    want = scene.show(scene.see(), plan.model_copy(update={"patches": recoloured}))
    np.testing.assert_array_equal(kept[0].render({"poster": OTHER, "road": grey}), want)


@pytest.mark.parametrize("lens", ["plain", "noisy", "coarse"])
@pytest.mark.parametrize("weather", WEATHERS)
def test_the_linear_map_has_the_renderers_bytes(weather: str, lens: str) -> None:
    """With the renderer's rounding, fewer than one in a thousand bytes differ, by one level."""
    view = view_of(weather, lens=lens)
    for texture in (OTHER, np.zeros_like(OWN), np.full_like(OWN, 255)):
        shown, expected = view.rounded(texture), view.render(texture)
        apart = np.abs(shown.astype(int) - expected)
        assert apart.max() <= 1 and (apart > 0).sum() <= 0.001 * 3 * len(view.pixels)
        unrounded = np.abs(view.forward(texture) * 255 - expected).max()
        assert unrounded < 1.6  # 8 bits of texture, mip levels and picture, and 4096 levels of light


@pytest.mark.parametrize("weather", WEATHERS)
def test_products_with_the_matrix_and_its_transpose_agree(weather: str) -> None:
    """<Ax, y> = <x, A'y> in exact arithmetic, and the products equal those computed from the entries."""
    taps = view_of(weather).taps
    a, t = taps.matrix, taps.transpose
    entries = sorted(zip(np.repeat(np.arange(a.shape[0]), np.diff(a.firsts)), a.columns, a.weights, strict=True))
    mirrored = sorted(zip(t.columns, np.repeat(np.arange(t.shape[0]), np.diff(t.firsts)), t.weights, strict=True))
    assert entries == mirrored and len(entries) > 200
    x = np.arange(a.width * 3, dtype=np.int64).reshape(-1, 3) * 7919 % 1009
    y = np.arange(a.shape[0] * 3, dtype=np.int64).reshape(-1, 3) * 104729 % 997
    left = sum(Fraction(float(w)) * int(x[c, 0]) * int(y[r, 0]) for r, c, w in entries)
    right = sum(Fraction(float(w)) * int(y[r, 0]) * int(x[c, 0]) for r, c, w in mirrored)
    assert left == right
    rows = np.zeros((a.shape[0], 3))
    np.add.at(rows, [r for r, _, _ in entries], x[[c for _, c, _ in entries]] * a.weights[:, None])
    np.testing.assert_allclose(taps.forward(x.astype(float)), rows, rtol=1e-12)
    ahead, back = (taps.forward(x.astype(float)) * y).sum(), (x * taps.backward(y.astype(float))).sum()
    assert ahead == pytest.approx(back, rel=1e-12)
    np.testing.assert_allclose(taps.forward(np.ones((a.width, 3))), 1.0, atol=1e-6)  # taps are a mean


@pytest.mark.parametrize("lens", ["plain", "noisy", "lens"])
@pytest.mark.parametrize("weather", ["rainy", "night"])
def test_the_kernels_have_the_bytes_of_numpy(weather: str, lens: str) -> None:
    """The forward values and the gradient of an independent implementation; a gradient must not change by a bit."""
    frame = frame_of(scene_of(OWN), plan_of(OWN, weather, lens))
    view, x = PatchView(frame, "poster", 31, 23), np.random.default_rng(3).uniform(0, 1, (23, 31, 3))
    y = np.random.default_rng(4).normal(size=view.picture.shape)
    values, gradient = linearised(frame, "poster", x, y.reshape(-1, 3)[view.pixels])
    assert view.forward(x).reshape(-1, 3)[view.pixels].tobytes() == values.tobytes()
    assert view.backward(x, y).tobytes() == gradient.tobytes() and np.abs(gradient).max() > 0.01


@given(st.integers(1, 40), st.integers(1, 9), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_textures_on_a_device_are_rounded_as_a_build_rounds(width: int, height: int, seed: int) -> None:
    """Texture and mip levels have the bytes of `mip_levels`; halves round up."""
    draw, chain = np.random.default_rng(seed), MipChain(width, height)
    image = draw.integers(0, 256, (height, width, 3)).astype(np.uint8)
    noise = draw.uniform(-0.5, 0.4999, image.shape)
    noise[draw.uniform(size=image.shape) < 0.3] = -0.5
    texture = np.clip((image + noise) / 255.0, 0.0, 1.0)
    expected = mip_levels(as_image("poster", texture))
    out = wp.empty(chain.texels + 2, dtype=wp.uint32, device="cpu")
    chain.round_into(vectors(texture, "cpu"), out, 1)
    np.testing.assert_array_equal(out.numpy()[1:-1], np.concatenate([level.reshape(-1) for level in expected]))


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_the_transpose_of_mip_levels(width: int, height: int, seed: int) -> None:
    chain, draw = MipChain(width, height), np.random.default_rng(seed)
    x = draw.integers(-9, 9, (height * width, 3)).astype(float)
    levels = chain.forward(x)
    y = draw.integers(-9, 9, levels.shape).astype(float)
    assert (levels * y).sum() == pytest.approx((x * chain.backward(y)).sum(), abs=1e-9)
    np.testing.assert_allclose(levels[-1], x.mean(axis=0), atol=1e-12)


@pytest.mark.parametrize("weather", WEATHERS)
def test_finite_differences_agree(weather: str) -> None:
    view, draw = view_of(weather, lens="noisy"), np.random.default_rng(1)
    x = np.clip(OTHER / 255.0, 0.02, 0.98)
    for _ in range(3):
        way, y = draw.normal(size=x.shape), draw.normal(size=view.picture.shape)
        step = 1e-7
        measured = ((view.forward(x + step * way) - view.forward(x - step * way)) * y).sum() / (2 * step)
        assert (view.backward(x, y) * way).sum() == pytest.approx(measured, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("weather", ["noon", "rainy"])
def test_finite_differences_of_the_renderer_agree(weather: str) -> None:
    """Steps of entire levels in one channel: the mean change of the renderer's bytes agrees with the gradient."""
    view = view_of(weather)
    low, high = np.full_like(OWN, 120), np.full_like(OWN, 120)
    low[..., 1], high[..., 1] = 110, 130
    measured = view.render(high).astype(float).sum() - view.render(low).astype(float).sum()
    slope = view.backward(np.full(OWN.shape, 120 / 255), np.ones(view.picture.shape))[..., 1].sum()
    assert slope * 20 == pytest.approx(measured, rel=0.03)


def test_a_texel_that_no_pixel_shows_has_no_gradient() -> None:
    """The sticker hides a corner of the poster, whose gradient is 0 and whose changes have no effect."""
    over = FACE.model_copy(update={"corner": (5.0, 4.0, 3.2), "width": 1.2, "height": 0.9})
    plan = with_patches(
        WEATHERS["noon"],
        patch(PatchTexture(image=file_of(OWN))),
        patch(of_colour("#808080"), faces=(over,), name="sticker"),
    )
    view = PatchView(frame_of(scene_of(OWN), plan), "poster", 32, 24)
    gradient = view.backward(OWN, np.ones(view.picture.shape))
    hidden = np.abs(gradient).sum(axis=-1) == 0.0

    assert hidden[3:6, 3:8].all() and hidden.sum() < hidden.size / 4
    changed = OWN.copy()
    changed[hidden] = 255 - changed[hidden]
    np.testing.assert_array_equal(view.forward(changed), view.forward(OWN))


@pytest.mark.parametrize("weather", WEATHERS)
def test_a_texture_of_the_walls_own_colour_gives_the_walls_bytes(weather: str) -> None:
    scene = scene_of(OWN)
    plan = with_patches(WEATHERS[weather], patch(PatchTexture(image=file_of(OWN))))
    wall = np.full((8, 8, 3), [0xC0, 0x80, 0x40], np.uint8)
    bare = scene.show(scene.see(), with_patches(WEATHERS[weather]))
    np.testing.assert_array_equal(frame_of(scene, plan).render({"poster": wall}), bare)


@pytest.mark.slow
def test_gradients_are_bytes() -> None:
    """Two renderers agree, also if one has rendered other frames before."""
    scene = scene_of(OWN)
    views = [PatchView(frame_of(scene, plan_of(OWN, "rainy")), "poster", 32, 24) for _ in range(2)]
    views.append(view_of("rainy"))
    y = np.random.default_rng(2).normal(size=views[0].picture.shape)
    assert len({view.backward(OTHER, y).tobytes() for view in views}) == 1


def test_wet_ground_that_reflects_the_patch_has_rows() -> None:
    view = view_of("rainy")
    ground = np.ones(view.picture.shape)
    seen = scene_of(OWN).see()
    ground[~np.isin(seen.semantic, (1, 2, 24))] = 0.0
    assert np.abs(view.backward(OWN, ground)).sum() > 0.0


def test_curves_and_their_derivatives() -> None:
    values = np.array(range(256)) / 255.0
    exact = np.array([srgb_to_linear(v) for v in range(256)])
    np.testing.assert_allclose(linear_light(values)[0], exact, atol=1e-12)
    between: Values = np.array(np.linspace(0.05, 0.99, 997), np.float64)
    np.testing.assert_allclose(linear_light(between)[0], ((between + 0.055) / 1.055) ** 2.4, atol=1e-8)
    for curve, points in ((linear_light, between), (tone, between * 3), (inverse_tone, between * 0.9)):
        step = 1e-6
        measured = (curve(points + step)[0] - curve(points - step)[0]) / (2 * step)
        np.testing.assert_allclose(curve(points)[1], measured, rtol=1e-5)
    np.testing.assert_allclose(inverse_tone(tone(between)[0])[0], between, rtol=1e-9)


@pytest.mark.parametrize("weather", ["noon", "rainy"])
def test_a_frame_that_does_not_show_the_patch_has_no_gradient(weather: str) -> None:
    scene = scene_of(OWN)
    plan = with_patches(WEATHERS[weather], patch(PatchTexture(image=file_of(OWN))))
    seen = scene.see(pose=from_pose(Pose(x=5.0, y=-3.0, z=1.6, yaw=-90)))
    frame = scene.renderer.patched_frame(seen, plan, "street", 0, 0.0)
    view = PatchView(frame, "poster", 32, 24)
    np.testing.assert_array_equal(view.render(OTHER), scene.show(seen, plan))
    np.testing.assert_array_equal(view.forward(OTHER), view.picture / 255.0)
    assert not view.backward(OTHER, np.ones(view.picture.shape)).any()


@pytest.mark.gpu
def test_a_gpu_gives_the_same_bytes() -> None:
    on_cpu, on_gpu = (Scene({file_of(OWN).sha256: OWN}, device=device) for device in ("cpu", "cuda:0"))
    for weather, lens in (("rainy", "plain"), ("night", "lens")):
        frames = [frame_of(scene, plan_of(OWN, weather, lens)) for scene in (on_cpu, on_gpu)]
        first, second = (frame.render({"poster": OTHER}) for frame in frames)
        np.testing.assert_array_equal(first, second)
    views = [PatchView(frame_of(scene, plan_of(OWN, "rainy")), "poster", 32, 24) for scene in (on_cpu, on_gpu)]
    gradients = [view.backward(OTHER, np.ones(view.picture.shape)) for view in views]
    np.testing.assert_array_equal(gradients[0], gradients[1])
