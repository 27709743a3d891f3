"""The work of finding the images of patches is bounded, whatever paths a recipe has."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.lowering.patches import texture_files

from tests.compiler.kitchen import small
from tests.compiler.modelling import picture, png


def written(folder: Path, kind: str, paths: list[str]) -> Path:
    """Write a recipe whose patch has one of these textures, and a folder with an image."""
    (folder / "film").mkdir()
    (folder / "film" / "0.png").write_bytes(png(picture()))
    board = {"board": {"x": -4, "y": 0, "z": 1}, "size": {"width": 1, "height": 1}}
    recipe: dict[str, Any] = small(clock={"fps": 10, "frames": 1}, patches={"p": {"on": board, "texture": {}}})
    recipe["base"]["patches"]["p"]["texture"][kind] = paths[0]
    recipe["sweep"] = {"draw": {"count": 2, "values": {f"patches.p.texture.{kind}": {"choice": paths}}}}
    path = folder / "recipe.yaml"
    path.write_text(json.dumps(recipe))
    return path


def test_an_image_and_a_folder_of_one_path_are_two_textures(tmp_path: Path) -> None:
    path = written(tmp_path, "image", ["film/0.png"])
    recipe = json.loads(path.read_text())
    recipe["deltas"] = {"kind": {"image": {}, "frames": {"patches": {"p": {"texture": {"frames": "film/0.png"}}}}}}
    path.write_text(json.dumps(recipe))
    with pytest.raises(InputError, match="cannot be read as a folder"):
        compile_recipe(path)


def test_the_images_of_all_folders_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand links to one folder are small, but each would have its own list of images."""
    monkeypatch.setattr(texture_files, "MAX_IMAGES", 3)
    path = written(tmp_path, "frames", [f"film{n}" for n in range(9)])
    for n in range(9):
        (tmp_path / f"film{n}").symlink_to("film")
    with pytest.raises(InputError, match='"film3": with it, the folders have 4 images, over 3') as caught:
        compile_recipe(path)
    assert "film4" not in str(caught.value)
