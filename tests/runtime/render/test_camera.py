"""Camera settings: each one follows its formula, and only lens distortion changes labels."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse
from recipe_runtime.render.camera import exposure
from recipe_runtime.render.camera.develop_kernels import LEVELS
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.renderer import Renderer

from tests.runtime.render.street import CAMERA, EYE, WEATHERS, parts_at, street

Picture = NDArray[np.uint8]
Setting: TypeAlias = float | str
WIDE, HIGH = CAMERA.width, CAMERA.height
SMOOTH: dict[str, Setting] = {"antialias": True}


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(street())


def having(weather: str = "noon", /, **settings: Setting) -> AppearancePlan:
    response = CameraResponse.model_validate({"noise": 0.0, "antialias": False, **settings})
    return WEATHERS[weather].model_copy(update={"responses": {"street": response}})


def shot(renderer: Renderer, weather: str = "noon", /, **settings: Setting) -> Picture:
    seen = renderer.observe(CAMERA, EYE, parts_at())
    return renderer.shade(seen, having(weather, **settings), "street", 0, 0.0)


def linear(picture: Picture) -> NDArray[np.float64]:
    """Return the linear display light of sRGB levels."""
    v = picture / 255.0
    light: NDArray[np.float64] = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    return light


def light(picture: Picture) -> NDArray[np.float64]:
    """Invert the tone curve by bisection: return the light of a picture before tone mapping."""
    y, low, high = linear(picture), np.zeros(picture.shape), np.full(picture.shape, 7.5)
    for _ in range(40):
        x = (low + high) / 2.0
        above = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14) > y
        low, high = np.where(above, low, x), np.where(above, x, high)
    middle: NDArray[np.float64] = (low + high) / 2.0
    return middle


def from_centre() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pixels' offsets from the centre, in image widths."""
    y, x = np.mgrid[0:HIGH, 0:WIDE]
    return (x + 0.5 - WIDE / 2) / WIDE, (y + 0.5 - HIGH / 2) / WIDE


def assert_gain(changed: Picture, plain: Picture, gain: ArrayLike) -> None:
    """Assert that light is multiplied by `gain`, within the precision of eight bits."""
    middle = (plain > 70) & (plain < 200) & (changed > 70) & (changed < 235)
    wanted = np.broadcast_to(np.asarray(gain, float), plain.shape)[middle]
    assert middle.sum() > 300
    assert np.abs(light(changed)[middle] / light(plain)[middle] - wanted).max() < 0.05 * wanted.max()
    assert abs(float(np.mean(light(changed)[middle] / light(plain)[middle] / wanted)) - 1.0) < 0.004


@pytest.mark.slow
def test_vignette_follows_its_formula(renderer: Renderer) -> None:
    x, y = from_centre()
    none, full = shot(renderer, vignette_intensity=0.0), shot(renderer, vignette_intensity=1.0)
    assert_gain(full, none, (1.0 - 0.8 * (x * x + y * y))[..., None])


@pytest.mark.parametrize("multiplier, falloff", [(0.4, 5.0), (0.7, 2.0), (0.9, 0.5)])
def test_lens_circle_follows_its_formula(renderer: Renderer, multiplier: float, falloff: float) -> None:
    x, y = from_centre()
    square = (x * x + y * y) / (0.25 + 0.25 * (HIGH / WIDE) ** 2)
    none = shot(renderer, vignette_intensity=0.0)
    rim = {"lens_circle_multiplier": multiplier, "lens_circle_falloff": falloff}
    assert_gain(shot(renderer, vignette_intensity=0.0, **rim), none, (1.0 - multiplier * square**falloff)[..., None])


def test_a_strong_lens_circle_is_black_in_the_corners(renderer: Renderer) -> None:
    picture = shot(renderer, lens_circle_multiplier=10.0, lens_circle_falloff=1.0)
    assert picture[0, 0].max() == 0 and picture[HIGH // 2, WIDE // 2].max() > 20


def test_exposure_compensation_is_in_stops(renderer: Renderer) -> None:
    assert_gain(shot(renderer, exposure_compensation=-1.0), shot(renderer), 0.5)


@pytest.mark.slow
def test_manual_exposure_depends_on_shutter_iso_and_aperture(renderer: Renderer) -> None:
    sunny: dict[str, Setting] = {"exposure_mode": "manual", "shutter_speed": 100.0, "fstop": 16.0}
    base = shot(renderer, **sunny)
    assert_gain(base, shot(renderer), 1.0)  # the sunny 16 rule
    for change, gain in (({"shutter_speed": 200.0}, 0.5), ({"fstop": 16.0 * 2**0.5}, 0.5), ({"iso": 50.0}, 0.5)):
        assert_gain(shot(renderer, **{**sunny, **change}), base, gain)
    day, night = (shot(renderer, weather, **sunny).mean() for weather in ("noon", "night"))
    assert night < 0.05 * day


def test_gamma_is_a_power_of_the_encoded_value(renderer: Renderer) -> None:
    base, bright, dark = (shot(renderer, gamma=g).astype(float) for g in (2.2, 3.0, 1.6))
    for picture, gamma in ((bright, 3.0), (dark, 1.6)):
        wanted = 255.0 * (base / 255.0) ** (2.2 / gamma)
        assert np.abs(picture - wanted)[base > 20].max() < 2.0
    assert (bright >= base).all() and (base >= dark).all()


@pytest.mark.slow
def test_white_balance_is_a_gain_of_each_channel(renderer: Renderer) -> None:
    base = shot(renderer)
    for name, value in (("temp", 5200.0), ("temp", 8000.0), ("tint", 0.4), ("tint", -0.4)):
        gains = exposure.white(CameraResponse.model_validate({name: value}))
        assert_gain(shot(renderer, **{name: value}), base, gains)


def test_white_balance_makes_light_of_its_temperature_white() -> None:
    """Reference: chromaticities of black bodies from the CIE's tables (Wyszecki and Stiles, 1(3.3.4))."""
    for kelvin, x, y in ((2856.0, 0.4475, 0.4074), (5000.0, 0.3451, 0.3516), (10000.0, 0.2807, 0.2884)):
        xyz = np.array([x / y, 1.0, (1.0 - x - y) / y])
        rgb = np.array([[3.2405, -1.5371, -0.4985], [-0.9693, 1.876, 0.0416], [0.0556, -0.204, 1.0572]]) @ xyz
        gains = np.array(exposure.white(CameraResponse(temp=kelvin)))
        shown = rgb * gains
        reference = np.array([[3.2405, -1.5371, -0.4985], [-0.9693, 1.876, 0.0416], [0.0556, -0.204, 1.0572]]) @ (
            np.array([0.3135 / 0.3237, 1.0, (1.0 - 0.3135 - 0.3237) / 0.3237])
        )
        assert np.abs(shown / shown[1] / (reference / reference[1]) - 1.0).max() < 0.03
        assert gains @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0)


def test_noise_is_proportional_to_the_root_of_iso(renderer: Renderer) -> None:
    clean = shot(renderer, "foggy").astype(float)
    patch = (clean > 60) & (clean < 190)

    def deviation(**settings: float) -> float:
        noisy = shot(renderer, "foggy", **settings)
        return float((linear(noisy) - linear(clean.astype(np.uint8)))[patch].std())

    base = deviation(noise=2.0)
    assert deviation(noise=4.0) == pytest.approx(2.0 * base, rel=0.05)
    assert deviation(noise=2.0, iso=400.0) == pytest.approx(2.0 * base, rel=0.05)
    assert deviation(noise=0.0, iso=400.0) == 0.0
    noisy = linear(shot(renderer, "foggy", noise=4.0)) - linear(clean.astype(np.uint8))
    assert abs(float(noisy[patch].mean())) < 0.05 * float(noisy[patch].std())


@pytest.mark.slow
def test_supersampling_reduces_the_error(renderer: Renderer) -> None:
    """Reference: a picture of eight times the width and height without antialiasing, averaged in display light."""
    fine = CAMERA.model_copy(update={"width": 8 * WIDE, "height": 8 * HIGH})
    seen = renderer.observe(fine, EYE, parts_at())
    large = renderer.shade(seen, having(antialias=False), "street", 0, 0.0)
    truth = linear(large).reshape(HIGH, 8, WIDE, 8, 3).mean(axis=(1, 3))
    errors = []
    for settings in ({}, SMOOTH, {**SMOOTH, "supersample": 2}, {**SMOOTH, "supersample": 4}):
        errors.append(float(np.sqrt(np.mean((linear(shot(renderer, **settings)) - truth) ** 2))))
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[3] < 0.35 * errors[0]


def test_the_hdr_image_of_one_sample_per_pixel_gives_the_plain_picture(renderer: Renderer) -> None:
    """Effects of negligible strength use the HDR image and change a level by at most 1, by rounding."""
    plain = shot(renderer).astype(int)
    for effect in ("bloom_intensity", "chromatic_aberration_intensity"):
        assert np.abs(shot(renderer, **{effect: 1e-6}) - plain).max() <= 1


def test_bloom_spreads_light_around_bright_pixels_and_preserves_the_sum(renderer: Renderer) -> None:
    dark, lit, strong = (shot(renderer, "night", bloom_intensity=b, vignette_intensity=0.0) for b in (0.0, 1.0, 4.0))
    near = linear(dark).max(axis=2) < 0.02
    assert linear(dark)[near].mean() < linear(lit)[near].mean() < linear(strong)[near].mean()
    assert light(strong).mean() == pytest.approx(light(dark).mean(), rel=0.1)


def test_chromatic_aberration_shifts_red_and_blue_towards_the_corners(renderer: Renderer) -> None:
    plain, parted = shot(renderer), shot(renderer, chromatic_aberration_intensity=4.0)
    changed = plain.astype(int) != parted
    assert changed[..., 1].mean() < 0.02  # green is not shifted; only rounding differs
    assert changed[..., 0].mean() > 0.1 and changed[..., 2].mean() > 0.1
    middle = (slice(HIGH // 2 - 8, HIGH // 2 + 8), slice(WIDE // 2 - 8, WIDE // 2 + 8))
    offset = shot(renderer, chromatic_aberration_intensity=4.0, chromatic_aberration_offset=0.5)
    assert np.abs(offset[middle].astype(int) - plain[middle]).max() <= 1
    assert (offset != plain).any()


SETTINGS: list[dict[str, Setting]] = [
    {
        "vignette_intensity": 0.9,
        "lens_circle_multiplier": 2.0,
        "noise": 3.0,
        "iso": 800.0,
        "gamma": 2.6,
        "temp": 4000.0,
    },
    {"supersample": 2, "bloom_intensity": 1.0, "chromatic_aberration_intensity": 2.0},
    {"motion_blur_intensity": 1.0, "shutter_speed": 20.0, "noise": 1.0},
]


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: next(iter(s)))
def test_camera_settings_change_no_label_and_no_other_picture(renderer: Renderer, settings: dict[str, Setting]) -> None:
    fresh = renderer.observe(CAMERA, EYE, parts_at(5))
    labels = fresh.depth.tobytes(), fresh.instance.tobytes(), fresh.semantic.tobytes(), fresh.objects
    before = renderer.shade(fresh, having(), "street", 5, 0.2)
    neighbour = NeighbourFrame(EYE, parts_at(4), 1 / 30)
    changed = renderer.shade(fresh, having(**settings), "street", 5, 0.2, neighbour=neighbour)
    assert (changed != before).any()
    assert (fresh.depth.tobytes(), fresh.instance.tobytes(), fresh.semantic.tobytes(), fresh.objects) == labels
    assert renderer.shade(fresh, having(), "street", 5, 0.2).tobytes() == before.tobytes()
    alone = Renderer(street())
    again = alone.shade(
        alone.observe(CAMERA, EYE, parts_at(5)), having(**settings), "street", 5, 0.2, neighbour=neighbour
    )
    assert again.tobytes() == changed.tobytes()


def test_the_tone_table_is_srgb_by_default() -> None:
    table = exposure.tone_table(int(LEVELS), 2.2)
    assert table[0] == 0 and table[-1] == 255 and (np.diff(table.astype(int)) >= 0).all()
    assert table[int(0.5 * (int(LEVELS) - 1))] == 187  # IEC 61966-2-1: 0.735


def test_noise_is_normal_and_independent_per_channel(renderer: Renderer) -> None:
    """Each channel takes its own bits of one hash per pixel; the channels must not correlate."""
    deviates = exposure.deviates().astype(float)
    assert abs(deviates.mean()) < 1e-6 and deviates.std() == pytest.approx(1.0, abs=1e-6)
    assert (np.diff(deviates) > 0).all()
    assert np.interp([-1.0, 0.0, 1.0], deviates, np.linspace(0, 1, len(deviates))) == pytest.approx(
        [0.1587, 0.5, 0.8413], abs=2e-3
    )
    clean = linear(shot(renderer, "foggy"))
    patch = ((clean > 0.05) & (clean < 0.5)).all(axis=2)
    noise = (linear(shot(renderer, "foggy", noise=8.0)) - clean)[patch]
    assert len(noise) > 1000
    correlation = np.corrcoef(noise.T)
    assert np.abs(correlation - np.eye(3)).max() < 4.0 / np.sqrt(len(noise))
