"""The gradient through motion blur, bloom, distortion, chromatic aberration and supersampling fits the renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.patches import PatchTexture
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse, Pose
from recipe_runtime.attacks.patch_view import PatchView
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.retexture.patched_frame import PatchedFrame

from tests.compiler.modelling import png
from tests.runtime.attacks.test_patch_view import OTHER, OWN, plan_of, scene_of
from tests.runtime.attacks.test_textures import FIRST, RECIPE, RENDERED
from tests.runtime.render.street import CAMERA, EYE, WEATHERS, parts_at
from tests.runtime.render.test_patches import FACE, Scene, file_of, of_colour, patch, with_patches

BENT = {"lens_k": 0.2, "lens_kcube": 0.05}
FRINGE = {"chromatic_aberration_intensity": 5.0, "chromatic_aberration_offset": 0.1}
BLUR = {"motion_blur_intensity": 3.0}
LENSES: dict[str, tuple[dict[str, float], dict[str, Any]]] = {  # of the camera, and of its response
    "supersampled": ({}, {"supersample": 2, "vignette_intensity": 0.8}),
    "bent": (BENT, {}),
    "fringed": ({}, {**FRINGE, "antialias": False}),
    "blurred": ({}, BLUR),
    "blooming": ({}, {"bloom_intensity": 2.0}),
    "all": (BENT, {"supersample": 3, "bloom_intensity": 2.0, "noise": 2.0, "gamma": 2.4, **FRINGE, **BLUR}),
}
TURNED = NeighbourFrame(from_pose(Pose(x=-0.2, y=-1.0, z=1.7, yaw=14, pitch=4)), parts_at(1), 1 / 30)


def seen_by(scene: Scene, plan: AppearancePlan, lens: str) -> PatchedFrame:
    camera, response = LENSES[lens]
    plan = plan.model_copy(update={"responses": {"street": CameraResponse(**response)}})
    seen = scene.see(CAMERA.model_copy(update=camera), EYE)
    return scene.renderer.patched_frame(seen, plan, "street", 0, 0.0, neighbour=TURNED)


def view_of(lens: str, weather: str = "noon", scene: Scene | None = None) -> PatchView:
    scene = scene or scene_of(OWN, OTHER)
    return PatchView(seen_by(scene, plan_of(OWN, weather), lens), "poster", OWN.shape[1], OWN.shape[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lens", "weather"), [*((lens, "rainy") for lens in LENSES), ("all", "noon"), ("all", "night")]
)
def test_the_map_has_the_renderers_bytes(lens: str, weather: str) -> None:
    """With the renderer's rounding, fewer than one in a thousand bytes differ, by one level."""
    scene = scene_of(OWN, OTHER)
    view = view_of(lens, weather, scene)
    other = seen_by(scene, plan_of(OTHER, weather), lens).render({})
    np.testing.assert_array_equal(view.render(OTHER), other)
    for texture in (OTHER, np.zeros_like(OWN), np.full_like(OWN, 255)):
        shown, expected = view.rounded(texture), view.render(texture)
        changed = (expected != view.picture).any(axis=-1).reshape(-1)
        assert changed[view.pixels].any() and changed.sum() == changed[view.pixels].sum()
        apart = np.abs(shown.astype(int) - expected)
        assert apart.max() <= 1 and (apart > 0).sum() <= 0.001 * 3 * len(view.pixels)
        assert np.abs(view.forward(texture) * 255 - expected).max() < 1.6


@pytest.mark.slow
@pytest.mark.parametrize("lens", LENSES)
def test_finite_differences_agree(lens: str) -> None:
    view, draw = view_of(lens, "rainy"), np.random.default_rng(1)
    x = np.clip(OTHER / 255.0, 0.02, 0.98)
    for _ in range(3):
        way, y = draw.normal(size=x.shape), draw.normal(size=view.picture.shape)
        step = 1e-7
        measured = ((view.forward(x + step * way) - view.forward(x - step * way)) * y).sum() / (2 * step)
        assert (view.backward(x, y) * way).sum() == pytest.approx(measured, rel=1e-4, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("lens", LENSES)
def test_finite_differences_of_the_renderer_agree(lens: str) -> None:
    """Steps of entire levels in half of the texture and one channel agree with the mean change of the bytes."""
    view = view_of(lens)
    y = np.broadcast_to(np.linspace(0.5, 1.5, CAMERA.width)[:, None], view.picture.shape)
    for half, channel in ((slice(0, 16), 0), (slice(16, 32), 1), (slice(0, 32), 2)):
        way = np.zeros(OWN.shape)
        way[:, half, channel] = 10.0
        low, high = ((120 + sign * way).astype(np.uint8) for sign in (-1, 1))
        measured = ((view.render(high).astype(float) - view.render(low)) * y).sum()
        slope = (view.backward(np.full(OWN.shape, 120 / 255), y) * way).sum()
        assert 2.0 * slope == pytest.approx(measured, rel=0.03) and slope > 300.0


@pytest.mark.slow
@pytest.mark.parametrize("lens", ["supersampled", "all"])
def test_a_texel_that_no_pixel_shows_has_no_gradient(lens: str) -> None:
    """A sticker hides a corner of the poster, whose gradient is 0 and whose changes have no effect."""
    over = FACE.model_copy(update={"corner": (5.0, 4.0, 3.2), "width": 1.2, "height": 0.9})
    sticker = patch(of_colour("#808080"), faces=(over,), name="sticker")
    plan = with_patches(WEATHERS["noon"], patch(PatchTexture(image=file_of(OWN))), sticker)
    view = PatchView(seen_by(scene_of(OWN), plan, lens), "poster", 32, 24)
    hidden = np.abs(view.backward(OWN, np.ones(view.picture.shape))).sum(axis=-1) == 0.0

    assert hidden[3:6, 3:8].all() and hidden.sum() < hidden.size / 4
    changed = OWN.copy()
    changed[hidden] = 255 - changed[hidden]
    np.testing.assert_array_equal(view.forward(changed), view.forward(OWN))


@pytest.mark.slow
def test_gradients_are_bytes() -> None:
    """Two renderers agree, also if one has rendered other frames before."""
    scene = scene_of(OWN, OTHER)
    views = [view_of("all", "rainy", scene), view_of("all", "rainy", scene), view_of("all", "rainy")]
    y = np.random.default_rng(2).normal(size=views[0].picture.shape)
    assert len({view.backward(OTHER, y).tobytes() for view in views}) == 1


@pytest.mark.slow
def test_a_frame_that_does_not_show_the_patch_has_no_gradient() -> None:
    scene = scene_of(OWN)
    response = CameraResponse(**LENSES["all"][1])
    plan = with_patches(WEATHERS["noon"], patch(PatchTexture(image=file_of(OWN))))
    plan = plan.model_copy(update={"responses": {"street": response}})
    seen = scene.see(pose=from_pose(Pose(x=5.0, y=-3.0, z=1.6, yaw=-90)))
    view = PatchView(scene.renderer.patched_frame(seen, plan, "street", 0, 0.0, neighbour=TURNED), "poster", 32, 24)
    np.testing.assert_array_equal(view.forward(OTHER), view.picture / 255.0)
    assert not len(view.pixels) and not view.backward(OTHER, np.ones(view.picture.shape)).any()


@pytest.mark.slow
def test_bloom_and_blur_reach_pixels_that_do_not_show_the_patch() -> None:
    """Without these rows, the gradient would lack the light that the effects spread beyond the patch."""
    plain, blooming, blurred = (len(view_of(lens).pixels) for lens in ("supersampled", "blooming", "blurred"))
    assert blooming > 2 * plain and blurred > plain


@pytest.mark.slow
def test_a_scenario_gives_views_through_its_cameras_lens(tmp_path: Path) -> None:
    """This includes motion blur, for which the view uses the neighbouring frame."""
    (tmp_path / "first.png").write_bytes(png(FIRST))
    text = RECIPE.format(image="first.png").replace(
        "fov: 70}", "fov: 70, lens_k: 0.1, supersample: 2, motion_blur_intensity: 4, bloom_intensity: 1}"
    )
    (tmp_path / "lens.yaml").write_text(text)
    scene = recipe_runtime.open(tmp_path / "lens.yaml", RENDERED)
    view = scene.patch_view(1, "poster")
    np.testing.assert_array_equal(view.render(FIRST), scene.render(1))
    assert np.abs(view.rounded(FIRST).astype(int) - scene.render(1)).max() <= 1
    body = scene.patch_view(1, "paint", size=(8, 8))
    assert np.abs(body.backward(np.full((8, 8, 3), 0.5), np.ones(body.picture.shape))).max() > 0.0


@pytest.mark.gpu
def test_a_gpu_gives_the_same_gradient() -> None:
    on_cpu, on_gpu = (Scene({file_of(OWN).sha256: OWN}, device=device) for device in ("cpu", "cuda:0"))
    views = [view_of("all", "rainy", scene) for scene in (on_cpu, on_gpu)]
    y = np.random.default_rng(2).normal(size=views[0].picture.shape)
    gradients = [view.backward(OTHER, y) for view in views]
    np.testing.assert_array_equal(gradients[0], gradients[1])
    np.testing.assert_array_equal(views[0].forward(OTHER), views[1].forward(OTHER))
