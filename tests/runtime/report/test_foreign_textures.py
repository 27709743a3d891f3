"""Textures of other models on our texture maps: each point of the body shows what the other model shows there."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir import assets
from recipe_compiler.library import blueprints, surfaces
from recipe_compiler.library.surfaces import WholeSurface
from recipe_runtime.report import foreign_textures
from recipe_runtime.report.foreign_textures import tiled, unwrapped

SIDES = {"front": (255, 0, 0), "rear": (0, 255, 0), "left": (0, 0, 255), "right": (255, 255, 0), "top": (0, 255, 255)}
# corners of each side of a box seen from outside: top left, top right, bottom right, bottom left
CORNERS = {
    "front": ((2, -1, 1), (2, 1, 1), (2, 1, 0), (2, -1, 0)),
    "rear": ((-2, 1, 1), (-2, -1, 1), (-2, -1, 0), (-2, 1, 0)),
    "left": ((2, 1, 1), (-2, 1, 1), (-2, 1, 0), (2, 1, 0)),
    "right": ((-2, -1, 1), (2, -1, 1), (2, -1, 0), (-2, -1, 0)),
    "top": ((2, -1, 1), (-2, -1, 1), (-2, 1, 1), (2, 1, 1)),
}


def body_of(blueprint: str) -> WholeSurface:
    found = next(iter(surfaces.actor_surfaces(blueprints.specimen(blueprints.match(blueprint)[0])[0])))
    assert isinstance(found, WholeSurface)
    return found


def box() -> assets.MeshData:
    """A box whose side n shows the n-th fifth of a picture."""
    lines = []
    for corners in CORNERS.values():
        lines += ["v " + " ".join(map(str, corner)) for corner in corners]
    for n in range(5):
        lines += [f"vt {(n + u) / 5} {v}" for u, v in ((0.02, 0.98), (0.98, 0.98), (0.98, 0.02), (0.02, 0.02))]
    lines += ["f " + " ".join(f"{4 * n + k}/{4 * n + k}" for k in (1, 2, 3, 4)) for n in range(5)]
    return assets.mesh("\n".join(lines).encode(), "obj", "z")


def picture() -> NDArray[np.uint8]:
    """Each side's colour, the upper left quarter of each in white."""
    pixels = np.zeros((40, 200, 3), np.uint8)
    for n, colour in enumerate(SIDES.values()):
        pixels[:, 40 * n : 40 * n + 40] = colour
        pixels[:20, 40 * n : 40 * n + 20] = 255
    return pixels


def decoded(png: bytes) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("turn", [0, 90])
def test_each_island_shows_the_side_of_the_other_model_upright(turn: int) -> None:
    """A turn of the model to the left brings its right side to the front."""
    body, order = body_of("vehicle.sedan.a"), ("front", "left", "rear", "right")
    page = decoded(unwrapped(body.islands, body.aspect, box(), picture(), turn))
    for name, face in body.islands:
        shown = name if turn == 0 or name == "top" else order[order.index(name) - 1]
        if turn and name == "top":
            continue
        left, top, right, bottom = (v * page.shape[1 - n % 2] for n, v in enumerate(face.region))
        colours = [
            tuple(page[int(top + y * (bottom - top)), int(left + x * (right - left))].tolist())
            for x, y in ((0.25, 0.3), (0.75, 0.3), (0.25, 0.8), (0.75, 0.8))
        ]
        assert colours == [(255, 255, 255), *[SIDES[shown]] * 3], name


@pytest.mark.parametrize("blueprint", ["vehicle.sedan.a", "vehicle.bicycle.*", "walker.pedestrian.*"])
def test_repeated_image_has_its_size_in_metres_on_every_island(blueprint: str) -> None:
    """Black and white stripes of 4 cm, which repeat every 8 cm, in both directions."""
    body = body_of(blueprint)
    y, x = np.mgrid[:32, :32]
    tile = np.repeat(np.where((x < 16) ^ (y < 16), 255, 0).astype(np.uint8)[..., None], 3, axis=2)
    page = decoded(tiled(body.islands, body.aspect, tile, 0.08)).astype(np.float64)[..., 0] / 255
    for name, face in body.islands:
        left, top, right, bottom = (round(v * page.shape[1 - n % 2]) for n, v in enumerate(face.region))
        area = page[top:bottom, left:right]
        for length, metres, rows in ((right - left, face.width, area), (bottom - top, face.height, area.T)):
            if metres < 0.2:
                continue
            changes = [np.count_nonzero(np.diff(row > 0.5)) for row in rows]
            assert abs(np.median(changes) - metres / 0.04) <= 1.5, (name, length)


def test_what_no_surface_shows_takes_the_colour_of_its_neighbours() -> None:
    body = body_of("vehicle.sedan.a")
    page = decoded(unwrapped(body.islands, body.aspect, box(), np.full((4, 4, 3), (9, 99, 199), np.uint8)))
    assert (page == (9, 99, 199)).all()


def test_bodies_of_several_parts_take_no_model() -> None:
    body = body_of("walker.pedestrian.*")
    with pytest.raises(ValueError, match="the body has several parts"):
        unwrapped(body.islands, body.aspect, box(), picture())


def test_models_without_texture_coordinates_are_refused() -> None:
    body = body_of("vehicle.sedan.a")
    plain = assets.mesh(b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3", "obj", "z")
    with pytest.raises(ValueError, match="no texture coordinates"):
        unwrapped(body.islands, body.aspect, plain, picture())


@pytest.mark.parametrize(("height", "width", "metres"), [(40, 30, 3.7), (3000, 2, 30.0), (30, 40, 100.0)])
def test_only_the_part_of_a_large_repeated_image_that_is_shown_is_scaled(
    height: int, width: int, metres: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scaled parts have no more pixels than the map, and they show what the whole image does."""
    sizes: list[int] = []
    resize = Image.Image.resize

    def counted(image: Image.Image, size: tuple[int, int], *rest: object) -> Image.Image:
        sizes.append(size[0] * size[1])
        return resize(image, size, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(Image.Image, "resize", counted)
    rows, columns = np.indices((height, width))
    tile = np.stack([rows * 255 // height, columns * 255 // width, np.zeros_like(rows)], axis=-1).astype(np.uint8)
    body = body_of("vehicle.sedan.a")
    shown = decoded(tiled(body.islands, body.aspect, tile, metres))
    assert sum(sizes) <= shown.shape[0] * shown.shape[1]


@pytest.mark.parametrize(("low", "number"), [(0, 40), (-13, 37), (170, 60), (-5, 300)])
def test_parts_of_a_scaled_image_are_equal_to_the_whole(low: int, number: int) -> None:
    tile = np.random.default_rng(1).integers(0, 256, (30, 50, 3), np.uint8)
    size = (200, 120)
    whole = np.asarray(Image.fromarray(tile).resize(size, Image.Resampling.LANCZOS)).astype(int)
    places = np.arange(low, low + number)
    (columns, x), (rows, y) = foreign_textures._needed(places, size[0]), foreign_textures._needed(places, size[1])
    strips = [[foreign_textures._scaled(tile, size, across, down) for across in columns] for down in rows]
    made = np.concatenate([np.concatenate(strip, axis=1) for strip in strips])[y[:, None], x[None, :]]
    assert np.abs(made - whole[places[:, None] % size[1], places[None, :] % size[0]]).max() <= 1


def test_models_of_far_too_many_layers_are_refused() -> None:
    """Painting each of 500,000 triangles over the whole map would take minutes."""
    body = body_of("vehicle.sedan.a")
    side = "\nv 2 -1 1\nv 2 1 1\nv -2 1 0\nvt 0 0\nf 1/1 2/1 3/1" + "\nf 1/1 2/1 3/1" * 400
    with pytest.raises(ValueError, match="lie behind each other"):
        unwrapped(body.islands, body.aspect, assets.mesh(side.encode(), "obj", "z"), picture())
