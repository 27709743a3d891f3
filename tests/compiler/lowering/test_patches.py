"""Patches in recipes: parts of the scene and of the appearance, positions, and errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import GREEN, PatchPlan
from recipe_compiler.ir.plan import ScenarioPlan

from tests.compiler.kitchen import small
from tests.compiler.modelling import obj, picture, png

SIZE = {"width": 1.0, "height": 0.5}
WALL = {"town": "wall.0", "at": {"x": 0.5, "z": 1.2}, "size": SIZE}
RED = {"color": "#ff0000"}


def compiled(folder: Path, patches: dict[str, Any], deltas: dict[str, Any] | None = None, **base: Any) -> Compiled:
    (folder / "a.png").write_bytes(png(picture()))
    (folder / "frames").mkdir(exist_ok=True)
    for n in range(5):
        (folder / f"frames/{n}.png").write_bytes(png(picture(4 + n, 3)))
    recipe = small(patches=patches, town={"name": "downtown", "blocks": [2, 2]}, **base)
    (folder / "recipe.yaml").write_text(json.dumps(recipe | ({"deltas": deltas} if deltas else {})))
    return compile_recipe(folder / "recipe.yaml")


def patch_of(folder: Path, patch: dict[str, Any], **base: Any) -> PatchPlan:
    (plan,) = compiled(folder, {"poster": patch}, **base).plan.variants[0].appearance.patches
    return plan


def refused(folder: Path, patch: dict[str, Any], **base: Any) -> str:
    with pytest.raises(InputError) as caught:
        compiled(folder, {"poster": patch}, **base)
    return " ".join(str(caught.value).split())


def test_a_patch_changes_only_the_appearance(tmp_path: Path) -> None:
    """Mode, texture, position and gloss of a patch change neither scene nor rig."""
    changes: dict[str, Any] = {
        "green": {"mode": "green"},
        "digital": {"mode": "digital"},
        "image": {"texture": {"image": "a.png", "color": None}},
        "place": {"on": {"at": {"x": 1.0}}},
        "gloss": {"gloss": 0.5},
        "emission": {"emission": 300},
    }
    deltas = {"change": {name: {"patches": {"poster": change}} for name, change in {"none": {}, **changes}.items()}}
    variants = compiled(tmp_path, {"poster": {"on": WALL, "texture": RED}}, deltas).plan.variants
    assert len({v.scene.digest for v in variants}) == len({v.rig.digest for v in variants}) == 1
    assert len({v.appearance.digest for v in variants}) == len({v.appearance.colours for v in variants}) == 7


def test_a_plan_with_patches_equals_its_document(tmp_path: Path) -> None:
    """Datasets contain plans as JSON with six decimals; with more, the plan that verify reads had another digest."""
    (tmp_path / "wedge.obj").write_bytes(obj())
    pose = {"x": -5, "y": 3, "z": 0.4, "yaw": 20, "pitch": 15, "roll": 10}
    props = {"wedge": {"asset": "wedge", "at": pose}, "sign": {"size": SIZE, "at": pose}}
    places: dict[str, Any] = {
        "mesh": {"prop": "wedge", "surface": "body"},
        "sign": {"prop": "sign", "size": SIZE},
        "board": {"board": pose, "size": SIZE},
        "wall": WALL,
    }
    patches = {name: {"on": place, "texture": RED} for name, place in places.items()}
    recipe = small(patches=patches, props=props, town={"name": "downtown", "blocks": [2, 2]})
    recipe["assets"] = {"wedge": {"mesh": "wedge.obj"}}
    (tmp_path / "recipe.yaml").write_text(json.dumps(recipe))
    (plan,) = compile_recipe(tmp_path / "recipe.yaml").plan.variants
    assert [patch.name for patch in plan.appearance.patches] == list(places)
    assert ScenarioPlan.model_validate(plan.document()).digest == plan.digest


def test_a_board_is_part_of_the_scene_and_its_texture_is_not(tmp_path: Path) -> None:
    board = {"on": {"board": {"x": -4, "y": 2, "yaw": 90}, "size": SIZE}, "texture": RED}
    move: dict[str, Any] = {"patches": {"poster": {"on": {"board": {"x": -3}}}}}
    deltas: dict[str, Any] = {
        "change": {"none": {}, "colour": {"patches": {"poster": {"texture": {"color": "#00ff00"}}}}, "move": move}
    }
    plain, colour, moved = compiled(tmp_path, {"poster": board}, deltas).plan.variants
    assert plain.scene is colour.scene and plain.scene.digest != moved.scene.digest
    (prop,), (patch,) = plain.scene.props, plain.appearance.patches
    assert prop.name == patch.body == "patch.poster"
    assert (patch.faces[0].width, patch.faces[0].height) == (1.0, 0.5)
    # It faces +y from y = 2.01; seen from there, -x is to the right.
    for found, wanted in zip(
        patch.faces[0].corners, ((-3.5, 0.65), (-4.5, 0.65), (-4.5, 0.15), (-3.5, 0.15)), strict=True
    ):
        assert found == pytest.approx((wanted[0], 2.01, wanted[1]), abs=1e-5)


def test_a_patch_lies_around_its_point(tmp_path: Path) -> None:
    """Seen from the front, x is to the right of the surface's middle, and z is up from the foot of the body."""
    patch = patch_of(tmp_path, {"on": WALL, "texture": RED})
    compiled_plan = compiled(tmp_path, {"poster": {"on": WALL, "texture": RED}}).plan.variants[0]
    wall = next(e for e in compiled_plan.scene.town.elements if e.name == "wall.0")
    face = patch.faces[0]
    middle = [sum(corner[n] for corner in face.corners) / 4 for n in range(3)]
    across = [(middle[n] - (wall.pose.x, wall.pose.y)[n]) for n in range(2)]
    assert across == pytest.approx([0.5 * face.right[0], 0.5 * face.right[1]], abs=1e-5)
    assert middle[2] == pytest.approx(wall.pose.z + 1.2)
    assert face.normal == pytest.approx((-face.right[1] * face.down[2], face.right[0] * face.down[2], 0.0), abs=1e-6)
    assert patch.mode == "rendered" and not patch.whole and patch.shown.colour == "#ff0000"


def test_textures_are_pinned_and_listed_as_files_of_the_recipe(tmp_path: Path) -> None:
    made = compiled(tmp_path, {"poster": {"on": WALL, "texture": {"image": "a.png"}}})
    (file,) = made.plan.variants[0].appearance.patches[0].texture.files
    assert made.files["a.png"] == file.sha256 and made.places[file.sha256] == tmp_path / "a.png"
    assert file.sha256 in made.plan.variants[0].files
    other = {"on": WALL, "texture": {"image": "a.png", "sha256": "0" * 64}}
    assert "is another file" in refused(tmp_path, other)


@pytest.mark.parametrize(
    "delta",
    [
        {"poster": {"texture": {"sha256": "0" * 64}}},
        {"poster": {"texture": {"image": "a.png", "sha256": "0" * 64}}},
        {"other": {"on": WALL, "texture": {"image": "a.png", "sha256": "0" * 64}}},
    ],
)
def test_a_pin_in_a_delta_is_compared_too(tmp_path: Path, delta: dict[str, Any]) -> None:
    """The base may name the same image without a pin, or with the right one."""
    base = {"poster": {"on": WALL, "texture": {"image": "a.png"}}}
    with pytest.raises(InputError, match=r"texture\.image\.sha256: \S+ is another file: its digest is"):
        compiled(tmp_path, base, {"pin": {"none": {}, "wrong": {"patches": delta}}})


def test_a_sequence_has_one_image_per_frame(tmp_path: Path) -> None:
    patch = patch_of(tmp_path, {"on": WALL, "texture": {"frames": "frames"}})
    assert patch.changes and len(patch.texture.frames) == 4, "as many as the clip has frames"
    assert patch.shown.at(2) == patch.texture.frames[2] and len(set(patch.texture.frames)) == 4
    clock = {"fps": 10, "frames": 6}
    assert "5 images for 6 frames" in refused(tmp_path, {"on": WALL, "texture": {"frames": "frames"}}, clock=clock)


@pytest.mark.parametrize("mode", ["green", "digital", "color_transfer"])
def test_the_placeholder_is_green(tmp_path: Path, mode: str) -> None:
    patch = patch_of(tmp_path, {"on": WALL, "mode": mode, "texture": {"image": "a.png"}})
    assert patch.shown.colour == GREEN and patch.shown.at(0) is None and patch.texture.image is not None


@pytest.mark.parametrize(
    ("patch", "words"),
    [
        ({"on": {**WALL, "town": "wal.0"}, "texture": RED}, ['"wal.0" is not an element', 'did you mean "wall.0"?']),
        ({"on": {**WALL, "surface": "bakc"}, "texture": RED}, ['no surface "bakc"', 'did you mean "back"?']),
        ({"on": {"actor": "hero3"}, "texture": RED}, ['"hero3" is not an actor', 'did you mean "hero']),
        ({"on": {**WALL, "size": {"width": 12, "height": 1}}, "texture": RED},
         ["12 x 1 m does not fit the front of wall.0", "at x = 0.5, z = 1.2"]),
        ({"on": {"town": "wall.0"}, "texture": RED}, ["needs a size", "at most"]),
        ({"on": {"actor": "hero1", "size": SIZE}, "texture": RED}, ["shirt is a texture map", "name another surface"]),
        (
            {"on": {"actor": "hero1"}, "mode": "digital", "texture": RED},
            ["poster.mode: digital needs a rectangle; shirt is a texture map", "mode: rendered"],
        ),
        ({"on": {"board": {"x": 0, "y": 0}}, "texture": RED}, ["a board has the patch's size"]),
        ({"on": "hero1", "texture": RED},
         ['must be a map, not "hero1"; write keys and values: valid are town, actor, prop, board']),
        ({"on": WALL}, ["needs a `texture`"]),
        ({"on": WALL, "texture": {"image": "recipe.yaml"}}, ["not an image in a supported format"]),
        ({"on": WALL, "texture": {"frames": "."}, "mode": "rendered"}, ["1 image for 4 frames"]),
        ({"on": WALL, "texture": "film"}, ['write {image: FILE.png}, {frames: FOLDER} or {color: "#rrggbb"}']),
        ({"on": WALL, "image": "a.png"},
         ['"image" in patches.poster; it is a key of texture: write texture: {image: ...}']),
        ({"on": WALL, "texture": RED, "surface": "back"}, ["it is a key of on: write on: {surface: ...}"]),
    ],
)  # fmt: skip
def test_mistakes_are_explained(tmp_path: Path, patch: dict[str, Any], words: list[str]) -> None:
    text = refused(tmp_path, patch)
    for word in words:
        assert word in text, text
