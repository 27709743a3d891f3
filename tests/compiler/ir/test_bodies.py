"""Bodies of actors in glTF files: skins, nodes, and what is refused."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from recipe_compiler.ir import assets
from recipe_compiler.ir.assets import AssetError, rigs

from tests.compiler import rigging
from tests.compiler.modelling import glb


def place(name: str) -> tuple[float, float, float]:
    """Return a bone of the test's person with x forward, y left, z up."""
    x, y, z = rigging.BONES[name][1]
    return z, x, y


@pytest.mark.parametrize("prefix", ["mixamorig:", "mixamorig4_", "", "Armature|mixamorig:"])
def test_a_person_is_measured_from_bones_of_mixamos_names(prefix: str) -> None:
    body = assets.body(rigging.person(prefix="mixamorig:" if "|" in prefix else prefix))
    rig = rigs.person(body, 1.0)
    for name in rigs.NEEDED:
        np.testing.assert_allclose(rig.joints[name], place(name), atol=1e-6)
    assert rig.height == pytest.approx(rigging.HEIGHT)
    low, high = rig.low, rig.high
    assert low[1] == pytest.approx(-0.18 - 0.085, abs=0.03) and high[1] == -low[1]  # arms hang beside the body
    assert high[2] == pytest.approx(rigging.HEIGHT) and low[2] == 0.0


@pytest.mark.parametrize(("scale", "bind_scale"), [(1.0, 1.0), (100.0, 1.0), (1.0, 100.0)])
def test_a_skin_is_where_its_bones_place_it(scale: float, bind_scale: float) -> None:
    """Whatever the units of file and mesh; the bind matrices relate the two."""
    plain = assets.body(rigging.person()).mesh
    other = assets.body(rigging.person(scale=scale, bind_scale=bind_scale)).mesh
    np.testing.assert_allclose(np.array([other.low, other.high]) / scale, np.array([plain.low, plain.high]), atol=1e-5)
    (part,) = other.parts
    assert part.follows is not None and part.picture == 0
    np.testing.assert_allclose(part.follows[:, 4:].sum(axis=1), 1.0)


def test_a_turned_bone_turns_the_vertices_that_follow_it() -> None:
    """The file's nodes need not be in the bind pose: a forearm that is bent upward, in a file's own numbers."""
    content = rigging.person()
    bent = rigging.person(changes={})
    document, body = opened(bent)
    elbow = next(n for n in document["nodes"] if n["name"].endswith("LeftForeArm"))
    elbow["rotation"] = [0.0, 0.0, 0.5**0.5, 0.5**0.5]  # about z: from the left to upward
    high = assets.body(glb(document, body)).mesh.high
    assert assets.body(content).mesh.high[2] == pytest.approx(1.8)
    assert high[2] == pytest.approx(1.44 + 0.9 - 0.47, abs=0.01)


def opened(content: bytes) -> tuple[dict[str, Any], bytes]:
    size = int.from_bytes(content[12:16], "little")
    return json.loads(content[20 : 20 + size]), content[28 + size :]


def test_a_vehicles_wheels_are_its_nodes_with_all_below_them() -> None:
    names = {"wheel_front_left": "Wheel.Front.Left", "wheel_rear_right": "WHEEL REAR-RIGHT"}
    body = assets.body(rigging.vehicle(rename=names))
    rig = rigs.vehicle(body, 1.0)
    assert len(rig.wheels) == 8 and rig.radius == pytest.approx(rigging.RADIUS)
    front, rear = rig.centres["wheel_front_left"], rig.centres["wheel_rear_right"]
    np.testing.assert_allclose(front, (1.35, 0.75, rigging.RADIUS), atol=1e-6)
    np.testing.assert_allclose(rear, (-1.35, -0.75, rigging.RADIUS), atol=1e-6)
    assert rig.clearance == pytest.approx(0.25)
    np.testing.assert_allclose(np.subtract(rig.high, rig.low), (4.5, 1.8, 1.45), atol=1e-6)


def no_bones(content: bytes) -> bytes:
    document, body = opened(content)
    del document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]
    return glb(document, body)


def eight_bones(content: bytes) -> bytes:
    document, body = opened(content)
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_1"], attributes["WEIGHTS_1"] = attributes["JOINTS_0"], attributes["WEIGHTS_0"]
    return glb(document, body)


COUNT = 8 * len(rigging.BONES)
NO_WEIGHT, NAN = np.zeros((COUNT, 4)), np.full((COUNT, 4), np.nan)
WRONG: list[tuple[Callable[[], bytes], Callable[[Any, float], object] | None, str]] = [
    (lambda: rigging.person(rename={"LeftArm": "bone7"}), rigs.person, "has no bone LeftArm (its nodes are"),
    (lambda: rigging.person(rename={"LeftArm": "", "Hips": ""}), rigs.person, "no bone Hips and no bone LeftArm"),
    (lambda: rigging.person(places={"LeftFoot": (0.09, 1.2, 0)}), rigs.person, "does not stand upright"),
    (
        lambda: rigging.person(places={"LeftUpLeg": (-0.09, 0.93, 0), "RightUpLeg": (0.09, 0.93, 0)}),
        rigs.person,
        "looks backwards",
    ),
    (lambda: rigging.person(weights=NO_WEIGHT), None, "vertices that follow no bone"),
    (lambda: rigging.person(weights=NAN), None, "invalid weights"),
    (lambda: no_bones(rigging.person()), None, "without bones and weights"),
    (lambda: eight_bones(rigging.person()), None, "at most four"),
    (lambda: rigging.person(changes={"skins": [{"joints": [0, 99]}]}), None, "bones are not in its scene"),
    (lambda: rigging.person(changes={"skins": [{"joints": [0, 0]}]}), None, "a bone twice"),
    (lambda: rigging.person(changes={"skins": [{"joints": [0, 1]}]}), None, "names a bone that its skin does not"),
    (lambda: rigging.vehicle(rename={"wheel_rear_left": "w"}), rigs.vehicle, "has no node wheel_rear_left (its nodes"),
    (lambda: rigging.vehicle(backwards=True), rigs.vehicle, "front wheels are not ahead"),
    (lambda: rigging.vehicle(radius=0.6), rigs.vehicle, "radii from 0.33 to 0.60 m"),
]


@pytest.mark.parametrize(("content", "measure", "message"), WRONG, ids=[row[2][:30] for row in WRONG])
def test_what_a_file_lacks_is_named(
    content: Callable[[], bytes], measure: Callable[[Any, float], object] | None, message: str
) -> None:
    with pytest.raises(AssetError) as caught:
        body = assets.body(content())
        assert measure is not None
        measure(body, 1.0)
    assert message in str(caught.value)


def test_a_prop_with_a_skin_is_refused_as_before() -> None:
    with pytest.raises(AssetError, match="has a skin"):
        assets.mesh(rigging.person(), "glb", "y")


@pytest.mark.parametrize("seed", range(6))
def test_a_damaged_body_raises_no_other_error(seed: int) -> None:
    rng = random.Random(seed)
    plain = rigging.person() if seed % 2 else rigging.vehicle()
    for _ in range(60):
        content = bytearray(plain)
        for _ in range(rng.randint(1, 6)):
            content[rng.randrange(20, len(content))] = rng.randrange(256)
        try:
            body = assets.body(bytes(content))
            (rigs.person if seed % 2 else rigs.vehicle)(body, 1.0)
        except AssetError:
            pass
