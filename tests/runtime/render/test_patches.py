"""Patches change only the pixels that show them, and lie between their corners."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.patches import STATIC, PatchFace, PatchPlan, PatchTexture
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, FilePlan, Looks, Pose, TexturePlan
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu.frame_stream import FrameBatch, can_stream
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.render.texture.surface_colours import srgb_to_linear

from tests.runtime.render.street import CAMERA, EYE, WEATHERS, appearance, box, parts_at, quad, street

Pixels = NDArray[np.uint8]
PLAIN = Surface("wall", Pattern.PLAIN, 3)
WHITE = Surface("wall", Pattern.PLAIN, 3)
NOBODY = np.zeros((0, 3, 4))


def wall(y: float = 4.0) -> Body:
    """Return a wall 12 m wide and 6 m high to the left of the street that faces -y."""
    corners = [[2.0, y, 0.0], [14.0, y, 0.0], [14.0, y, 6.0], [2.0, y, 6.0]]
    return Body("facade", 0, ((STATIC, quad(corners, [[0, 0]] * 4, PLAIN)),))


FACE = PatchFace(
    part=STATIC,
    corner=(5.0, 4.0, 3.2),
    right=(1.0, 0.0, 0.0),
    down=(0.0, 0.0, -1.0),
    width=2.4,
    height=1.8,
    reach=0.02,
)


def file_of(pixels: Pixels) -> FilePlan:
    return FilePlan(sha256=hashlib.sha256(pixels.tobytes()).hexdigest(), bytes=1, kind="png")


def patch(
    texture: PatchTexture, body: str = "facade", faces: tuple[PatchFace, ...] = (FACE,), **more: object
) -> PatchPlan:
    return PatchPlan.model_validate({"name": "poster", "body": body, "faces": faces, "texture": texture, **more})


def of_colour(colour: str) -> PatchTexture:
    return PatchTexture(colour=colour)


class Scene:
    """Return the street with a plain wall behind the tree and the walker."""

    def __init__(self, images: Mapping[str, Pixels] | None = None, **options: object) -> None:
        bodies = street()
        known = images or {}
        self.renderer = Renderer(
            [wall(), *bodies],
            images=lambda texture: known[texture.file.sha256],
            **options,  # type: ignore[arg-type]
        )

    def see(self, camera: CameraPlan = CAMERA, pose: NDArray[np.float64] = EYE, frame: int = 0) -> Observation:
        return self.renderer.observe(camera, pose, parts_at(frame))

    def show(self, seen: Observation, plan: AppearancePlan, frame: int = 0) -> Pixels:
        return self.renderer.shade(seen, plan, "street", frame, frame / 30)


def with_patches(plan: AppearancePlan, *patches: PatchPlan, wall_colour: str = "#c08040") -> AppearancePlan:
    looks = Looks({**plan.looks.root, "facade": {"wall": wall_colour}})
    return plan.model_copy(update={"patches": patches, "looks": looks})


def noise(height: int, width: int, seed: int = 0) -> Pixels:
    """Return an image of random colours."""
    n = np.arange(height * width * 3, dtype=np.uint64).reshape(height, width, 3) + np.uint64(7919 * seed)
    return ((n * np.uint64(2654435761)) >> np.uint64(9) & np.uint64(255)).astype(np.uint8)


def grown(mask: NDArray[np.bool_], by: int = 1) -> NDArray[np.bool_]:
    """Return a mask dilated by a pixel."""
    wide = np.pad(mask, by)
    h, w = mask.shape
    steps = range(2 * by + 1)
    found: NDArray[np.bool_] = np.any([wide[y : y + h, x : x + w] for y in steps for x in steps], axis=0)
    return found


@pytest.mark.parametrize("weather", WEATHERS)
def test_a_patch_of_the_walls_own_colour_gives_the_walls_bytes(weather: str) -> None:
    scene, plan = Scene(), WEATHERS[weather]
    seen = scene.see()
    plain = scene.show(seen, with_patches(plan))
    same = scene.show(seen, with_patches(plan, patch(of_colour("#c08040"))))
    np.testing.assert_array_equal(plain, same)
    assert (scene.show(seen, with_patches(plan, patch(of_colour("#00903a")))) != plain).any()


@pytest.mark.parametrize("weather", ["noon", "foggy", "night"])
def test_another_texture_changes_only_the_pixels_of_the_patch(weather: str) -> None:
    """This includes occlusion by a tree, a pole and a walker; pixels at its edge may show it in part."""
    first, second = noise(24, 32), noise(24, 32, 5)
    images = {file_of(p).sha256: p for p in (first, second)}
    scene = Scene(images)
    seen = scene.see()
    one, two = (with_patches(WEATHERS[weather], patch(PatchTexture(image=file_of(p)))) for p in (first, second))
    differs = (scene.show(seen, one) != scene.show(seen, two)).any(axis=-1)
    mask = scene.renderer.patch_map(seen, one) > 0
    assert mask.sum() > 150
    assert not (differs & ~grown(mask)).any()
    assert (differs & mask).sum() > 0.9 * mask.sum()
    np.testing.assert_array_equal(mask, scene.renderer.patch_map(seen, two) > 0)
    assert seen.depth is not None and (seen.semantic[mask] == 3).all(), "an occluder's pixels are not the patch's"


def test_only_wet_ground_reflects_a_patch() -> None:
    """In rain, puddles reflect the patch; other surfaces do not."""
    scene = Scene()
    seen = scene.see()
    one, two = (with_patches(WEATHERS["rainy"], patch(of_colour(c))) for c in ("#ffffff", "#000000"))
    differs = (scene.show(seen, one) != scene.show(seen, two)).any(axis=-1)
    outside = differs & ~grown(scene.renderer.patch_map(seen, one) > 0)
    assert set(np.unique(seen.semantic[outside])) <= {1, 2, 24}


def projected(camera: CameraPlan, pose: NDArray[np.float64], point: tuple[float, float, float]) -> tuple[float, float]:
    """Return the pixel of a point by the pinhole formula."""
    sine, cosine = exact.sin_cos_deg(camera.fov / 2)
    focal = camera.width / 2 * cosine / sine
    x, y, z = np.linalg.inv(pose[:, :3]) @ (np.array(point) - pose[:, 3])
    return camera.width / 2 - focal * y / x, camera.height / 2 - focal * z / x


@given(st.floats(-35, 35), st.floats(-3, 2), st.floats(1, 4))
@settings(max_examples=8, deadline=None)
def test_a_patch_lies_within_its_corners(yaw: float, y: float, z: float) -> None:
    """A pixel shows it if its centre is inside the projected quadrilateral, by a closed form."""
    camera, pose = (
        CameraPlan(width=96, height=64, fov=80),
        from_pose(Pose(x=0, y=y, z=z, yaw=40 + yaw, pitch=-5, roll=4)),
    )
    renderer = Renderer([wall()])
    seen = renderer.observe(camera, pose, NOBODY)
    found = renderer.patch_map(seen, with_patches(appearance(), patch(of_colour("#ff0000")))) > 0
    rows, columns = np.mgrid[0:64, 0:96] + 0.5
    corners = [projected(camera, pose, corner) for corner in FACE.corners]
    sides = []
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        length = np.hypot(x1 - x0, y1 - y0)
        sides.append(((x1 - x0) * (rows - y0) - (y1 - y0) * (columns - x0)) / max(length, 1e-9))
    inward = np.min(sides, axis=0)  # pixels within the edge; clockwise, y down
    assert found[inward > 0.01].all() and not found[inward < -0.01].any()


def test_the_texture_is_upright_and_each_texel_has_its_place() -> None:
    """Seen head-on with one texel per pixel, the picture shows the image."""
    image = noise(24, 32)
    camera = CameraPlan(width=32, height=24, fov=90)
    face = FACE.model_copy(update={"corner": (8.0 - 1.6, 4.0, 3.2), "width": 3.2, "height": 2.4})
    renderer = Renderer([wall()], images=lambda texture: image)
    seen = renderer.observe(camera, from_pose(Pose(x=8.0, y=4.0 - 1.6, z=2.0, yaw=90)), NOBODY)
    shown, black, white = (
        renderer.radiance(seen, with_patches(appearance(60.0, 270.0, fog_density=0.0), patch(t, faces=(face,))))
        for t in (PatchTexture(image=file_of(image)), of_colour("#000000"), of_colour("#ffffff"))
    )
    albedo = (shown.astype(float) - black) / (white.astype(float) - black)
    np.testing.assert_allclose(albedo, np.vectorize(srgb_to_linear)(image), atol=2e-4)


def test_a_patch_moves_with_its_part_and_can_cover_a_whole_body() -> None:
    """On a car that approaches the camera: a rectangle on its front, none on its rear, and the entire paint."""
    down = (0.0, 0.0, -1.0)
    front = PatchFace(
        part="body", corner=(2.0, -0.6, 1.2), right=(0.0, 1.0, 0.0), down=down, width=1.2, height=0.8, reach=0.05
    )
    rear = front.model_copy(update={"corner": (-2.0, 0.6, 1.2), "right": (0.0, -1.0, 0.0)})
    scene, noon = Scene(), WEATHERS["noon"]
    for frame in (0, 9):
        seen = scene.see(frame=frame)
        hidden = with_patches(noon, patch(of_colour("#ff00ff"), "car", (rear,)))
        assert not scene.renderer.patch_map(seen, hidden).any()
        shown = scene.renderer.patch_map(seen, with_patches(noon, patch(of_colour("#ff00ff"), "car", (front,))))
        pose, where = parts_at(frame)[1], np.argwhere(shown)
        x, y, z = pose[:, :3] @ np.array([2.0, 0.0, 0.8]) + pose[:, 3]
        assert np.abs(where.mean(axis=0)[::-1] + 0.5 - projected(CAMERA, EYE, (x, y, z))).max() < 1.0
        faces = (front.model_copy(update={"reach": 9.0}),)
        whole = with_patches(noon, patch(of_colour("#ff00ff"), "car", faces, whole=True, slots=("paint",)))
        np.testing.assert_array_equal(scene.renderer.patch_map(seen, whole) > 0, seen.instance == 14001)


def test_the_later_patch_lies_over_the_earlier_one() -> None:
    scene = Scene()
    seen = scene.see()
    small = FACE.model_copy(update={"corner": (5.6, 4.0, 2.9), "width": 1.0, "height": 1.0})
    big, over = patch(of_colour("#ff0000")), patch(of_colour("#0000ff"), faces=(small,))
    both = with_patches(WEATHERS["noon"], big, over)
    numbers = scene.renderer.patch_map(seen, both)
    assert set(np.unique(numbers)) == {0, 1, 2}
    hidden = scene.renderer.patch_map(seen, with_patches(WEATHERS["noon"], over, big))
    assert set(np.unique(hidden)) == {0, 2}
    np.testing.assert_array_equal(
        scene.show(seen, with_patches(WEATHERS["noon"], over, big)),
        scene.show(seen, with_patches(WEATHERS["noon"], big)),
    )


@pytest.mark.slow
def test_a_static_camera_shows_each_frames_image_of_a_sequence() -> None:
    """Cached data of the previous frame must not affect this one."""
    images = [noise(12, 16, n) for n in range(4)]
    scene = Scene({file_of(p).sha256: p for p in images})
    film = with_patches(WEATHERS["noon"], patch(PatchTexture(frames=tuple(map(file_of, images)))))
    for frame, image in enumerate(images):
        seen = scene.see(frame=frame)
        still = with_patches(WEATHERS["noon"], patch(PatchTexture(image=file_of(image))))
        alone = Scene({file_of(image).sha256: image})
        np.testing.assert_array_equal(scene.show(seen, film, frame), alone.show(alone.see(frame=frame), still, frame))


@pytest.mark.slow
def test_reuse_changes_no_byte_of_a_patch() -> None:
    image = noise(12, 16)
    images = {file_of(image).sha256: image}
    plan = with_patches(WEATHERS["rainy"], patch(PatchTexture(image=file_of(image))))
    reusing, plain = Scene(images), Scene(images, reuse=NO_REUSE)
    for frame in range(4):
        np.testing.assert_array_equal(
            reusing.show(reusing.see(frame=frame), plan, frame), plain.show(plain.see(frame=frame), plan, frame)
        )


def test_emission_is_visible_at_night_and_gloss_reflects_the_sky() -> None:
    scene = Scene()
    seen = scene.see()
    night, noon = WEATHERS["night"], WEATHERS["noon"]
    dark, lit = (scene.show(seen, with_patches(night, patch(of_colour("#ffffff"), emission=e))) for e in (0.0, 400.0))
    mask = scene.renderer.patch_map(seen, with_patches(night, patch(of_colour("#ffffff")))) > 0
    assert lit[mask].mean() > dark[mask].mean() + 40
    matt, glossy = (
        scene.renderer.radiance(seen, with_patches(noon, patch(of_colour("#000000"), gloss=g))) for g in (0.0, 0.9)
    )
    assert (glossy[mask] > matt[mask]).all()
    np.testing.assert_array_equal(glossy[~grown(mask)], matt[~grown(mask)])


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("weathers", [["noon", "rainy"], ["night"]])
def test_a_frame_stream_has_the_renderers_bytes_and_masks(weathers: list[str], device: str) -> None:
    """With an image on a wall, paint on a moving car, an appearance without patches and one that only has masks."""
    image = noise(24, 32)
    images = {file_of(image).sha256: image}
    paint = FACE.model_copy(update={"part": "body", "corner": (2.0, -0.6, 1.2), "right": (0.0, 1.0, 0.0), "reach": 9.0})
    texture = PatchTexture(image=file_of(image))
    painted = patch(texture, "car", (paint,), name="paint", whole=True, slots=("paint",), emission=90.0)
    plans = [with_patches(WEATHERS[name], patch(texture, gloss=0.4), painted) for name in weathers]
    masked = with_patches(WEATHERS["noon"], painted)
    scene, streaming = Scene(images, reuse=NO_REUSE), Scene(images, device=device).renderer
    looks, numbers = [*plans, with_patches(WEATHERS[weathers[0]])], [0, 3, 1]
    batch = FrameBatch(
        numbers, [n / 30 for n in numbers], np.stack([EYE] * 3), np.stack([parts_at(n) for n in numbers])
    )
    stream = streaming.frame_stream(CAMERA, "street", looks, 2, [plans[0], masked])
    for number, made in zip(numbers, stream.frames(batch), strict=True):
        seen = scene.see(frame=number)
        for plan, picture in zip(looks, made.pictures, strict=True):
            np.testing.assert_array_equal(picture, scene.show(seen, plan, number))
        for plan, shown in zip((plans[0], masked), made.patch_maps, strict=True):
            np.testing.assert_array_equal(shown, scene.renderer.patch_map(seen, plan, number))
        assert set(np.unique(made.patch_maps[0])) == {0, 1, 2} and set(np.unique(made.patch_maps[1])) == {0, 1}


def test_inserted_and_changing_patches_are_not_rendered_by_a_stream() -> None:
    """A stream has no inserted textures, and its images are the same in every frame."""
    from recipe_compiler.ir.plan import SensorPlan

    sensor = SensorPlan(name="street", camera=CAMERA, capture=("rgb",), poses=(Pose(),))
    assert can_stream(sensor, [appearance()])
    assert can_stream(sensor, [with_patches(appearance(), patch(of_colour("#ff0000")))])
    assert not can_stream(sensor, [with_patches(appearance(), patch(of_colour("#ff0000"), mode="digital"))])
    film = PatchTexture(frames=(file_of(noise(2, 2)), file_of(noise(2, 3))))
    assert not can_stream(sensor, [with_patches(appearance(), patch(film))])


def test_masks_are_distorted_like_labels() -> None:
    camera = CameraPlan(width=96, height=64, fov=80, lens_k=-0.2)
    renderer = Renderer([wall(), Body("box", 0, ((STATIC, box([7.0, 3.0, 0.0], [7.2, 3.2, 4.0], WHITE)),))])
    seen = renderer.observe(camera, EYE, NOBODY)
    everywhere = FACE.model_copy(update={"corner": (2.0, 4.0, 6.0), "width": 12.0, "height": 6.0})
    mask = renderer.patch_map(seen, with_patches(appearance(), patch(of_colour("#ff0000"), faces=(everywhere,)))) > 0
    pinhole = CameraPlan(width=96, height=64, fov=80)
    straight = (
        renderer.patch_map(
            renderer.observe(pinhole, EYE, NOBODY),
            with_patches(appearance(), patch(of_colour("#ff0000"), faces=(everywhere,))),
        )
        > 0
    )
    assert mask.any() and (mask != straight).any()
    assert (seen.semantic[mask] == 3).all()


def test_an_image_without_a_reader_is_an_error() -> None:
    renderer = Renderer([wall()])
    seen = renderer.observe(CAMERA, EYE, NOBODY)
    plan = with_patches(appearance(), patch(PatchTexture(image=file_of(noise(2, 2)))))
    with pytest.raises(ValueError, match="no reader"):
        renderer.shade(seen, plan, "street", 0, 0.0)
    assert TexturePlan(file=file_of(noise(2, 2))).number is None


@pytest.mark.gpu
@pytest.mark.parametrize("weather", WEATHERS)
def test_a_gpu_shows_the_same_bytes(weather: str) -> None:
    """This applies to an image on a wall and to paint on a moving car, and to the mask."""
    image = noise(24, 32)
    images = {file_of(image).sha256: image}
    paint = FACE.model_copy(update={"part": "body", "corner": (2.0, -0.6, 1.2), "right": (0.0, 1.0, 0.0), "reach": 9.0})
    texture = PatchTexture(image=file_of(image))
    patches = patch(texture, gloss=0.4), patch(texture, "car", (paint,), whole=True, slots=("paint",), emission=90.0)
    plan = with_patches(WEATHERS[weather], *patches)
    shown = []
    for device in ("cpu", "cuda:0"):
        scene = Scene(images, device=device)
        seen = scene.see(frame=3)
        shown.append((scene.show(seen, plan, 3), scene.renderer.patch_map(seen, plan)))
    np.testing.assert_array_equal(shown[0][0], shown[1][0])
    np.testing.assert_array_equal(shown[0][1], shown[1][1])
