"""Images on surfaces: exact colours up close, mean light far away, and no flicker in between."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, FilePlan, Looks, Pose, TexturePlan
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Mesh, Pattern, Surface
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.render.scene.geometry import upload
from recipe_runtime.render.texture import mipmaps
from recipe_runtime.render.texture.mipmaps import ImageAtlases, mip_levels
from recipe_runtime.render.texture.surface_colours import srgb_to_linear

from tests.runtime.render.street import appearance, quad

NOBODY = np.zeros((0, 3, 4))
FACE = Surface("face", Pattern.IMAGE, 20)
Pixels = NDArray[np.uint8]


def board(width: float, height: float, repeats: float = 1.0) -> Mesh:
    """Return a board at x = 0 that faces -x, its centre at a height of 10 m; u is 0 at the viewer's left."""
    w, low, high, n = width / 2, 10.0 - height / 2, 10.0 + height / 2, repeats
    corners = [[0, w, low], [0, -w, low], [0, -w, high], [0, w, high]]
    uvs: list[list[float]] = [[0, n], [n, n], [n, 0], [0, 0]]
    return quad(corners, uvs, FACE)


def lit(image: Pixels | None, repeat: bool = False, **weather: float) -> AppearancePlan:
    """Return clear noon with the sun behind the camera and a white board, with or without an image."""
    plan = appearance(30.0, azimuth=180.0, looks={"board": {"face": "#ffffff"}}, **{"fog_density": 0.0, **weather})
    file = FilePlan(sha256="0" * 64, bytes=1, kind="png")
    textures = {} if image is None else {"board": {"face": TexturePlan(file=file, repeat=repeat)}}
    return plan.model_copy(update={"textures": textures})


def albedo(mesh: Mesh, image: Pixels, pose: Pose, camera: CameraPlan, repeat: bool = False) -> NDArray[np.float64]:
    """Return the board's linear colour [H, W, 3], NaN elsewhere: its light relative to a black and a white board."""
    renderer = Renderer([Body("board", 0, (("static", mesh),))], images=lambda texture: image)
    seen = renderer.observe(camera, from_pose(pose), NOBODY)
    black = lit(None).model_copy(update={"looks": Looks({"board": {"face": "#000000"}})})
    plans = lit(image, repeat), black, lit(None)
    shown, low, high = (renderer.radiance(seen, plan).astype(np.float64) for plan in plans)
    return np.where((seen.semantic == 20)[..., None], (shown - low) / np.maximum(high - low, 1e-9), np.nan)


def light(pixels: Pixels) -> NDArray[np.float64]:
    light: NDArray[np.float64] = np.vectorize(srgb_to_linear, otypes=[np.float64])(pixels)
    return light


def noise(height: int, width: int) -> Pixels:
    """Return an image of random colours."""
    n = np.arange(height * width * 3, dtype=np.uint64).reshape(height, width, 3)
    return ((n * np.uint64(2654435761)) >> np.uint64(9) & np.uint64(255)).astype(np.uint8)


def chequers(size: int) -> Pixels:
    """Return a chequerboard with squares of one texel."""
    y, x = np.mgrid[0:size, 0:size]
    return np.repeat((255 * ((x + y) % 2))[..., None], 3, axis=2).astype(np.uint8)


def test_a_texel_seen_head_on_has_its_exact_colour() -> None:
    """At one texel per pixel the picture shows the image, upright and not mirrored."""
    image = noise(24, 32)
    camera = CameraPlan(width=32, height=24, fov=90)
    found = albedo(board(32.0, 24.0), image, Pose(x=-16.0, z=10.0), camera)
    np.testing.assert_allclose(found, light(image), atol=2e-4)


def test_up_close_texels_are_interpolated() -> None:
    image = np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8)
    found = albedo(board(2.0, 1.0), image, Pose(x=-1.0, z=10.0), CameraPlan(width=64, height=32, fov=90))
    expected = np.clip((np.arange(64) + 0.5) / 32.0 - 0.5, 0.0, 1.0)  # edge texels extend beyond their centres
    np.testing.assert_allclose(found[16, :, 0], expected, atol=1e-3)


@pytest.mark.parametrize("metres", [40.0, 97.0, 180.0])
def test_a_distant_chequerboard_has_its_mean_light(metres: float) -> None:
    """Every pixel has half the light of white, which is level 188 of sRGB, within one level."""
    camera = CameraPlan(width=48, height=48, fov=8)
    found = albedo(board(40.0, 40.0), chequers(1024), Pose(x=-metres, z=10.0), camera)[2:-2, 2:-2]
    inside = found[~np.isnan(found[..., 0])]
    assert len(inside) > 200
    assert srgb_to_linear(187) < inside.min() and inside.max() < srgb_to_linear(189)


@pytest.mark.slow
def test_an_image_does_not_flicker_when_the_camera_moves() -> None:
    """At 3 to 12 texels per pixel, a movement of 1/20 pixel changes a brick-like image by very little."""
    y, x = np.mgrid[0:512, 0:512]
    image = np.repeat(np.where((x % 8 < 2) | (y % 8 < 2), 250, 30)[..., None], 3, axis=2).astype(np.uint8)
    camera, mesh = CameraPlan(width=64, height=64, fov=40), board(40.0, 40.0)
    for metres in (150.0, 400.0):
        here, there = (
            albedo(mesh, image, Pose(x=-metres, y=shift, z=10.0), camera) for shift in (0.0, 0.05 * metres / 88)
        )
        inside = ~np.isnan(here[..., 0] + there[..., 0])
        assert np.abs(here - there)[inside].max() < 0.02


def test_filtering_is_anisotropic() -> None:
    """Seen nearly edge-on, stripes along the view direction stay stripes; isotropic filtering would give grey."""
    y, _ = np.mgrid[0:256, 0:256]
    stripes = np.repeat(np.where(y % 64 < 32, 255, 0)[..., None], 3, axis=2).astype(np.uint8)
    camera = CameraPlan(width=96, height=96, fov=30)
    found = albedo(board(40.0, 10.0), stripes, Pose(x=-3.0, y=30.0, z=10.0, yaw=-82.0), camera)[..., 0]
    column = found[:, 48]
    column = column[~np.isnan(column)]
    assert len(column) > 40 and column.max() > 0.95 and np.sort(column)[len(column) // 4] < 0.08


def test_beyond_its_edges_an_image_is_clamped_or_repeated() -> None:
    image = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]], np.uint8)
    camera, pose = CameraPlan(width=90, height=10, fov=90), Pose(x=-4.5, z=10.0)
    again, on = (albedo(board(9.0, 3.0, repeats=3.0), image, pose, camera, repeat)[5] for repeat in (True, False))
    middles = np.arange(90) % 10 == 5  # one texel is ten pixels
    assert (again[middles].argmax(axis=1) == np.tile([0, 1, 2], 3)).all()
    assert (on[middles].argmax(axis=1) == [0, 1, 2, 2, 2, 2, 2, 2, 2]).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (7, 3), (8, 8), (300, 9)])
def test_mipmap_levels_are_means_of_light_rounded_to_the_nearest_colour(shape: tuple[int, int]) -> None:
    """Reference: exact fractions, texel by texel."""
    image = noise(*shape)
    units = [round(srgb_to_linear(v) * 65535) for v in range(256)]
    levels = mip_levels(image)
    assert levels[-1].shape == (1, 1) and len(levels) == 1 + (max(shape) - 1).bit_length()
    for number, level in enumerate(levels):
        side = 1 << number
        for y, x in np.ndindex(level.shape):
            block = image[y * side : (y + 1) * side, x * side : (x + 1) * side].reshape(-1, 3)
            for channel in range(3):
                mean = Fraction(sum(units[v] for v in block[:, channel].tolist()), len(block))
                got = int(level[y, x]) >> (8 * channel) & 255
                assert all(abs(units[got] - mean) <= abs(units[v] - mean) for v in (max(got - 1, 0), min(got + 1, 255)))


def test_another_image_changes_only_pixels_that_show_it() -> None:
    wall = quad([[5, 30, 0], [5, -30, 0], [5, -30, 30], [5, 30, 30]], [[0, 0]] * 4, Surface("w", Pattern.PLASTER, 3))
    bodies = [Body("wall", 0, (("static", wall),)), Body("board", 0, (("static", board(6.0, 4.0)),))]
    images = {"1" * 64: noise(40, 60), "2" * 64: chequers(64)}
    renderer = Renderer(bodies, images=lambda texture: images[texture.file.sha256])
    seen = renderer.observe(CameraPlan(width=96, height=64, fov=60), from_pose(Pose(x=-8.0, z=10.0)), NOBODY)
    shown = []
    for sha256 in images:
        file = FilePlan(sha256=sha256, bytes=1, kind="png")
        textures = {"board": {"face": TexturePlan(file=file)}}
        plan = lit(None, precipitation_deposits=50.0).model_copy(update={"textures": textures})
        shown.append(renderer.shade(seen, plan, "street", 3, 0.1))
    differ = (shown[0] != shown[1]).any(axis=2)
    near = seen.semantic == 20
    for axis in (0, 1):
        near = near | np.roll(near, 1, axis) | np.roll(near, -1, axis)  # pixels at an edge show both
    assert differ.sum() > 200 and not (differ & ~near).any()


def test_the_pixels_of_an_untrusted_plans_images_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan from a dataset may show any image of a glTF file, and the recipe counts only those of its materials."""
    monkeypatch.setattr(mipmaps, "MAX_TEXTURE_PIXELS", 100)
    file = FilePlan(sha256="0" * 64, bytes=100, kind="glb")
    plans = [TexturePlan(file=file, number=n) for n in range(9)]
    read: list[int | None] = []

    def levels(texture: TexturePlan) -> list[NDArray[np.uint32]]:
        read.append(texture.number)
        return mip_levels(noise(8, 8))

    geometry = upload([Body("town", 0, (("static", board(1.0, 1.0)),))], "cpu")
    with pytest.raises(InputError, match="the images have more than 100 pixels in total"):
        mipmaps.atlas_of(geometry, {}, levels, "cpu", plans)
    assert read == [0, 1], "the others are not decoded"
    twice = [plans[0], plans[0].model_copy(update={"repeat": True})]
    assert len(mipmaps.atlas_of(geometry, {}, levels, "cpu", twice).numbers) == 2, "one image counts once"


def test_images_of_props_are_read_once_while_those_of_patches_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cache of large images is bounded."""
    monkeypatch.setattr("recipe_runtime.render.texture.mipmaps._ATLAS_CACHE_TEXELS", 64 * 64 * 3)
    geometry = upload([Body("board", 0, (("static", board(9.0, 7.0)),))], "cpu")
    own, *changing = (TexturePlan(file=FilePlan(sha256=f"{n:064x}", bytes=1, kind="png")) for n in range(5))
    read: list[TexturePlan] = []

    def image(texture: TexturePlan) -> Pixels:
        read.append(texture)
        return noise(64, 64)

    atlases = ImageAtlases(geometry, image, "cpu")
    plan = lit(None).model_copy(update={"textures": {"board": {"face": own}}})
    made = [atlases.of(plan, [texture]) for texture in changing]
    assert read == [own, *changing]
    assert atlases.of(plan, [changing[-1]]) is made[-1]
    assert len(atlases._kept) == 1


def _streamed(device: str) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Render an image at a slant with the renderer and with a frame stream."""
    camera, pose = CameraPlan(width=64, height=48, fov=70), from_pose(Pose(x=-9, y=6, z=10, yaw=-50))
    bodies = [Body("board", 0, (("static", board(9.0, 7.0, 2.5)),))]
    renderer = Renderer(bodies, device, images=lambda texture: noise(61, 47))
    plan = lit(noise(1, 1), True)
    (printed,) = renderer.frame_stream(camera, "street", [plan], in_flight=1).frames(
        FrameBatch([1], [0.0], pose[None], NOBODY[None])
    )
    return renderer.shade(renderer.observe(camera, pose, NOBODY), plan, "street", 1, 0.0), printed.pictures[0].copy()


def test_a_frame_stream_has_the_renderers_bytes_of_an_image() -> None:
    plain, reeled = _streamed("cpu")
    assert (plain == reeled).all()


@pytest.mark.gpu
def test_a_gpu_shows_the_same_bytes() -> None:
    here, there = _streamed("cpu"), _streamed("cuda:0")
    assert (here[0] == there[0]).all() and (here[1] == there[1]).all()
