"""Props: parts of the scene and of the appearance, positions, and the files of a recipe."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import PropPlan, ScenarioPlan
from recipe_compiler.lowering import asset_files

from tests.compiler.kitchen import small
from tests.compiler.modelling import TETRAHEDRON, glb, obj, picture, png, stl

AT = {"x": 1, "y": 2}


def compiled(folder: Path, props: dict[str, Any], deltas: dict[str, Any] | None = None, **assets: Any) -> Compiled:
    files = {"wedge.obj": obj(), "block.stl": stl(), "skinned.glb": glb(), "poster.png": png(picture())}
    for name, body in files.items():
        (folder / name).write_bytes(body)
    known = {
        "wedge": {"mesh": "wedge.obj", "up": "z"},
        "block": {"mesh": "block.stl"},
        "skinned": {"mesh": "skinned.glb"},
        "poster": {"image": "poster.png"},
    }
    recipe = small(props=props) | {"assets": {**known, **assets}} | ({"deltas": deltas} if deltas else {})
    (folder / "recipe.yaml").write_text(json.dumps(recipe))
    return compile_recipe(folder / "recipe.yaml")


def by_variant(plans: Compiled) -> dict[str, ScenarioPlan]:
    return {variant.variant.partition("=")[2]: variant for variant in plans.plan.variants}


def only_prop(plans: Compiled) -> PropPlan:
    (prop,) = plans.plan.variants[0].scene.props
    return prop


@pytest.mark.slow
def test_images_and_looks_are_appearance_and_meshes_are_scene(tmp_path: Path) -> None:
    board = {"size": {"width": 2, "height": 1}, "at": AT, "image": "poster"}
    deltas = {
        "change": {
            "none": {},
            "image": {"props": {"board": {"image": None}}},
            "look": {"props": {"board": {"look": {"face": "#00903a"}}}},
            "mesh": {"props": {"thing": {"asset": "block"}}},
            "place": {"props": {"thing": {"at": {"x": 3}}}},
            "mesh_image": {"props": {"skinned": {"image": "poster"}}},
        }
    }
    props = {
        "board": board,
        "thing": {"asset": "wedge", "at": {"x": 5, "y": 5}},
        "skinned": {"asset": "skinned", "at": {"x": 7, "y": 5}},
    }
    found = by_variant(compiled(tmp_path, props, deltas))
    plain = found["none"]
    for name in ("image", "look", "mesh_image"):
        assert found[name].observation == plain.observation, name
        assert found[name].appearance.digest != plain.appearance.digest, name
    for name in ("mesh", "place"):
        assert found[name].scene.digest != plain.scene.digest, name
        assert found[name].rig.digest == plain.rig.digest, name
    assert found["place"].appearance.digest == plain.appearance.digest


def test_the_plan_identifies_files_by_content_only(tmp_path: Path) -> None:
    props = {"thing": {"asset": "skinned", "at": AT}}
    deep = tmp_path / "elsewhere"
    deep.mkdir()
    one, two = compiled(tmp_path, props), compiled(deep, props)
    assert one.plan.digest == two.plan.digest
    (file,) = one.plan.variants[0].files.values()
    assert (file.sha256, file.bytes, file.kind) == (hashlib.sha256(glb()).hexdigest(), len(glb()), "glb")
    assert str(tmp_path) not in one.plan.model_dump_json()
    assert one.places[file.sha256] == tmp_path / "skinned.glb"


@pytest.mark.slow
def test_a_prop_stands_on_the_ground_unless_its_height_is_given(tmp_path: Path) -> None:
    low = stl(TETRAHEDRON - [0, 0, 0.25])
    (tmp_path / "low.stl").write_bytes(low)
    asset = {"low": {"mesh": "low.stl"}}
    on_road = only_prop(compiled(tmp_path, {"p": {"asset": "low", "scale": 2, "at": {"x": -1, "y": 30}}}, **asset))
    assert on_road.pose.z == 0.5
    tilted = only_prop(compiled(tmp_path, {"p": {"asset": "low", "at": {"x": -1, "y": 30, "pitch": 90}}}, **asset))
    assert tilted.pose.z == 1.0  # pitched down, the mesh's x axis points to the ground
    given = only_prop(compiled(tmp_path, {"p": {"asset": "low", "at": {"x": -1, "y": 30, "z": 7}}}, **asset))
    assert given.pose.z == 7.0
    assert (on_road.low, on_road.high) == ((0.0, 0.0, -0.5), (2.0, 2.0, 1.5))


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.obj")
    with pytest.raises(InputError, match=r'"pipe.obj": it is not a regular file'):
        compiled(tmp_path, {}, pipe={"mesh": "pipe.obj"})


def test_a_file_over_the_limit_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asset_files, "MESH_BYTES", 100)
    with pytest.raises(InputError, match="is larger than 100 bytes, the limit for a mesh"):
        compiled(tmp_path, {})


@pytest.mark.parametrize(
    ("limit", "what", "most"),
    [("ALL_BYTES", "bytes", 11), ("ALL_TRIANGLES", "tri", 11), ("ALL_PIXELS", "pix", 11), ("ALL_PARTS", "parts", 1)],
)
def test_all_assets_together_are_bounded(
    limit: str, what: str, most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asset_files, limit, most)
    with pytest.raises(InputError, match=rf"assets: \d+ {what}[\w ]* in total up to here exceed the limit of"):
        compiled(tmp_path, {})


@pytest.mark.parametrize(("limit", "most", "read"), [("INVALID_FILES", 2, 2), ("INVALID_BYTES", 20, 3)])
def test_after_a_few_invalid_files_the_others_are_not_read(
    limit: str, most: int, read: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asset_files, limit, most)
    (tmp_path / "bad.png").write_bytes(b"not a PNG.")
    with pytest.raises(InputError, match=f"{read} files above cannot be used, and the others were not read"):
        compiled(tmp_path, {}, **{f"bad{n}": {"image": "bad.png"} for n in range(9)})
