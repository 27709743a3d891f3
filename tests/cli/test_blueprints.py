"""`recipe blueprints`: table, JSON and pictures of the library, with reproducible bytes."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray
from PIL import Image
from recipe_cli.commands.blueprints import command
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import CameraPlan
from recipe_compiler.library.blueprints import LIBRARY, Blueprint, specimen
from recipe_runtime.frames.portrait import matrices, stance
from recipe_runtime.meshes import actor_body


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, list(arguments), catch_exceptions=False)


def test_the_table_has_a_row_for_each_blueprint() -> None:
    lines = run().stdout.splitlines()
    assert lines[0].split() == ["blueprint", "kind", "size,", "m", "tag", "m/s", "dashcam", "colours"]
    assert [line.split()[0] for line in lines[1:]] == [blueprint.id for blueprint in LIBRARY]
    (bus,) = run("vehicle.bus.city").stdout.splitlines()[1:]
    assert bus.startswith("vehicle.bus.city  bus   8.30 x 2.35 x 2.95  16 Bus  7    x: 4.3, z: 1.9  brakelight, disc, ")


def test_json_has_the_fields_of_each_blueprint() -> None:
    rows = json.loads(run("*.bicycle.*", "--json").stdout)
    assert {row["class"] for row in rows} == {"Bicycle"}
    assert rows[0]["attributes"] == {"base_type": "bicycle", "number_of_wheels": "2"}
    assert rows[0]["size"].keys() == {"length", "width", "height"}
    assert rows[0]["look"].keys() >= {"paint", "shirt", "hat"}
    child = next(row for row in json.loads(run("--json").stdout) if row["id"] == "walker.pedestrian.0013")
    assert (child["attributes"], child["size"]) == ({"generation": "child"}, {"height": 1.05})


@pytest.mark.parametrize("blueprint", [b for b in LIBRARY if b.category == "vehicle"], ids=lambda b: b.id)
def test_a_dashcam_is_outside_its_vehicle_and_sees_the_road(blueprint: Blueprint) -> None:
    """Glass is opaque, so a camera behind the windscreen would show only the inside of the vehicle."""
    (row,) = json.loads(run(blueprint.id, "--json").stdout)
    eye = np.array([row["dashcam"][axis] for axis in "xyz"])
    actor, _ = specimen(blueprint)
    triangles = np.concatenate(
        [
            (mesh.vertices.astype(np.float64) @ t[:, :3].T + t[:, 3])[mesh.triangles]
            for (_, mesh), t in zip(actor_body(actor).parts, matrices(stance(actor)), strict=True)
        ]
    )
    samples = triangles[:, None] * _BARYCENTRIC[None, :, :, None]
    assert np.sqrt(((samples.sum(axis=2) - eye) ** 2).sum(axis=2)).min() > CameraPlan(width=1, height=1, fov=1).near
    for yaw in (-35, -20, 0, 20, 35):
        for pitch in (-25, -10, 0):  # upwards and ahead; further down, a bonnet or a mudguard may be visible
            a, b = np.radians(yaw), np.radians(pitch)
            ray = np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), -np.sin(b)])
            assert not _hit(triangles, eye, ray), f"the body is in the way at yaw {yaw}, pitch {pitch}"


_BARYCENTRIC = np.array([[i, j, 6 - i - j] for i in range(7) for j in range(7 - i)]) / 6


def _hit(triangles: NDArray[np.float64], eye: NDArray[np.float64], ray: NDArray[np.float64]) -> bool:
    """Return whether a ray hits a triangle (Moeller and Trumbore)."""
    e1, e2, to = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0], eye - triangles[:, 0]
    p, q = np.cross(ray, e2), np.cross(to, e1)
    det = (e1 * p).sum(1)
    safe = np.where(np.abs(det) > 1e-12, det, np.inf)
    u, v, t = (to * p).sum(1) / safe, (q * ray).sum(1) / safe, (e2 * q).sum(1) / safe
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).any())


@pytest.mark.parametrize(
    ("pattern", "remedy"),
    [
        ("vehicle.seden.*", '"vehicle.seden.*" matches no blueprint; did you mean "vehicle.sedan.*"?'),
        ("", '"" matches no blueprint; valid are vehicle.bicycle.*'),
        ("?" * 5000, "matches no blueprint; valid are"),
    ],
)
def test_a_pattern_without_a_match_gets_a_remedy(pattern: str, remedy: str) -> None:
    with pytest.raises(InputError) as error:
        run(pattern)
    assert remedy in str(error.value)


@pytest.mark.slow
def test_pictures_are_the_same_bytes_twice(tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder in folders:
        done = run("vehicle.[bm]*.b", "--pictures", str(folder))
        assert done.stderr == f"{folder}: 2 pictures, and blueprints.jpg\n"
    names = sorted(path.name for path in folders[0].iterdir())
    assert names == ["blueprints.jpg", "vehicle.bicycle.b.png", "vehicle.motorcycle.b.png"]
    for name in names:
        body = (folders[0] / name).read_bytes()
        assert body == (folders[1] / name).read_bytes()
        with Image.open(io.BytesIO(body)) as picture:
            assert len(picture.getcolors(1 << 20)) > 500  # the pictures are not empty
