"""Patterns are filtered: each shows approximately its mean over the pixel, whatever the pixel's size."""

# mypy: ignore-errors

import numpy as np
import pytest
from recipe_runtime.meshes.lettering import FONT, WORDS, bits
from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.texture.patterns import detail_of

wp.set_module_options(OPTIONS)


@wp.kernel
def look(
    pattern: wp.int32,
    places: wp.array[wp.vec3f],
    unit: wp.float32,
    foot: wp.float32,
    found: wp.array[wp.vec3f],
):
    """Return tone, second and wear of a wall at x = 0 seen head-on; one unit of its uv is `unit` metres."""
    i = wp.tid()
    p = places[i]
    uv = wp.vec2f(p[1] / unit, p[2] / unit)
    out = wp.vec3f(1.0, 0.0, 0.0)
    d = detail_of(pattern, uv, p, out, wp.vec3f(-1.0, 0.0, 0.0), wp.vec2f(foot, foot), wp.uint32(7))
    found[i] = wp.vec3f(d.tone, d.second, d.wear)


UNITS = {
    Pattern.WINDOW: 1.5,
    Pattern.CURTAIN_WALL: 2.0,
    Pattern.SHOP_WINDOW: 2.5,
    Pattern.POSTER: 4.0,
    Pattern.FACADE: 3.2,
    Pattern.LANES: 3.5,
    Pattern.FOLIAGE: 1.0e6,  # its uv are fractions of the sky
}
EVEN = {Pattern.PLAIN, Pattern.METAL, Pattern.SKIN, Pattern.RUBBER, Pattern.GLASS, Pattern.LAMP}
EVEN |= {Pattern.SIGNAL, Pattern.IMAGE}
VEHICLES = {Pattern.CAR_PAINT, Pattern.CABIN, Pattern.NUMBER_PLATE, Pattern.HEADLIGHT, Pattern.TAILLIGHT}
VEHICLES |= {Pattern.LENS, Pattern.BRAKELIGHT, Pattern.INDICATOR, Pattern.REVERSELIGHT}  # in the frame of a vehicle
DRAWN = {Pattern.LETTER, Pattern.NICHE} | VEHICLES  # over one face only
PATTERNS = [p for p in Pattern if p not in EVEN | DRAWN]


def details(pattern: Pattern, y: np.ndarray, z: np.ndarray, foot: float) -> np.ndarray:
    """Return the details [..., 3] of `look`."""
    places = np.stack([np.zeros_like(y), y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    found = wp.zeros(len(places), dtype=wp.vec3f, device="cpu")
    points = wp.array(places, dtype=wp.vec3f, device="cpu")
    unit = UNITS.get(pattern, 1.0)
    launch(look, len(places), "cpu", pattern=int(pattern), places=points, unit=unit, foot=foot, found=found)
    return found.numpy().reshape(*y.shape, 3).astype(np.float64)


def grid(count: int, step: float, low: float = 1.7) -> tuple[np.ndarray, np.ndarray]:
    y, z = np.meshgrid(np.arange(count) * step, low + np.arange(count) * step, indexing="ij")
    return y, z


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda p: p.name)
def test_a_pattern_has_features(pattern: Pattern) -> None:
    assert details(pattern, *grid(100, 0.021), foot=0.001).std((0, 1)).max() > 0.015


@pytest.mark.parametrize("foot", [0.02, 0.1, 0.5, 2.5, 12.0])
@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda p: p.name)
def test_a_pattern_does_not_flicker_at_any_distance(pattern: Pattern, foot: float) -> None:
    """A shift by half a pixel hardly changes it: no moire, and no flicker when the camera moves."""
    y, z = grid(60, 1.37 * foot)
    here, aside = (details(pattern, y + shift, z, foot) for shift in (0.0, 0.5 * foot))
    change = np.abs(here - aside)
    assert change.mean() < 0.12
    assert (change.max(-1) > 0.6).mean() < 0.06  # edges of drawn shapes, which cross few pixels


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda p: p.name)
def test_a_pattern_fades_to_its_mean(pattern: Pattern) -> None:
    """A wide pixel has the mean of the narrow pixels within it."""
    near = details(pattern, *grid(400, 0.173), foot=0.002).mean((0, 1))
    far = details(pattern, *grid(8, 8.65), foot=30.0).mean((0, 1))
    assert np.abs(near - far).max() < 0.06


def test_a_letter_shows_its_dots() -> None:
    """At the centre of each dot, the pattern is dark where the font has a dot, in rows from the top."""
    for letter, rows in FONT.items():
        high, low = bits(letter)
        y, z = np.meshgrid(high + (np.arange(4) + 0.5) / 4, low + (np.arange(6)[::-1] + 0.5) / 6, indexing="xy")
        inked = details(Pattern.LETTER, y, z, 0.001)[..., 1] > 0.5
        assert ["".join("1" if dot else "0" for dot in row) for row in inked] == rows.split(), letter


def test_the_font_has_every_letter_of_the_shop_signs() -> None:
    assert {letter for word in (*WORDS, "BUS", "NEWS") for letter in word} <= set(FONT)
