"""Assets are read as by independent readers, with equal bits on every host; broken files are refused with one error."""

from __future__ import annotations

import io
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from PIL import Image
from recipe_compiler.ir.assets import AssetError, MeshData, image, mesh

from tests.compiler import modelling
from tests.compiler.modelling import FACES, TETRAHEDRON, document, glb, obj, picture, png, stl, stl_text

SHIPPED = Path(__file__).parents[3] / "recipes/assets"
VALID = {"obj": obj(), "stl": stl(), "glb": glb()}


def corners(found: MeshData) -> list[tuple[tuple[float, ...], ...]]:
    """Return every triangle as its three corners, in an order that does not depend on the reader."""
    triangles = [part.vertices[row] for part in found.parts for row in part.triangles]
    return sorted(_from_least([tuple(map(float, corner)) for corner in t]) for t in triangles)


def _from_least(corners: list[tuple[float, ...]]) -> tuple[tuple[float, ...], ...]:
    """Return a triangle with the same orientation, starting at its smallest corner."""
    first = corners.index(min(corners))
    return tuple(corners[first:] + corners[:first])


def by_trimesh(content: bytes, kind: str) -> list[tuple[tuple[float, ...], ...]]:
    scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False)
    found = []
    for name in scene.graph.nodes_geometry:
        matrix, key = scene.graph[name]
        geometry = scene.geometry[key]
        points = trimesh.transformations.transform_points(geometry.vertices, matrix)
        triangles = [[tuple(map(float, np.round(c, 6) + 0.0)) for c in points[row].tolist()] for row in geometry.faces]
        found += [_from_least(triangle) for triangle in triangles if len(set(triangle)) == 3]
    return sorted(found)


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        *((VALID[kind], kind) for kind in VALID),
        (stl_text(), "stl"),
        *(((SHIPPED / name).read_bytes(), name[-3:]) for name in ("crate.glb", "pillar.obj", "cone.stl")),
    ],
    ids=["obj", "stl", "glb", "stl text", "crate", "pillar", "cone"],
)
def test_trimesh_reads_the_same_triangles(content: bytes, kind: str) -> None:
    ours = corners(mesh(content, kind, "z"))
    if kind != "glb":  # two-sided here: each triangle and its back
        backs = [_from_least(list(reversed(triangle))) for triangle in by_trimesh(content, kind)]
        assert np.allclose(ours, sorted([*by_trimesh(content, kind), *backs]), rtol=0, atol=1.5e-6)
    else:
        assert np.allclose(ours, by_trimesh(content, kind), rtol=0, atol=1.5e-6)


def test_nodes_place_their_meshes_as_trimesh_places_them() -> None:
    nodes = [
        {"translation": [1, 2, 3], "rotation": [0.5, 0.5, -0.5, 0.5], "scale": [2, 1, 0.5], "children": [1, 2]},
        {"mesh": 0, "scale": [-1, 1, 1]},
        {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]},
    ]
    content = glb(document(nodes=nodes)[0])
    ours, theirs = corners(mesh(content, "glb", "z")), by_trimesh(content, "glb")
    # trimesh leaves a mirrored mesh inside out; this reader reverses its triangles.
    assert np.allclose(sorted(map(sorted, ours)), sorted(map(sorted, theirs)), rtol=0, atol=2e-6)
    outwards = mesh(content, "glb", "z")
    for part in outwards.parts:
        inside = part.vertices.mean(axis=0)
        for row, normal in zip(part.vertices[part.triangles].mean(axis=1), part.normals[::3], strict=True):
            assert float(((row - inside) * normal).sum()) > 0.0


def test_axes_are_converted() -> None:
    """glTF has y up, z forward and x to the left, so its z, x and y become x, y and z."""
    found = mesh(obj(TETRAHEDRON * [1, 2, 3]), "obj", "y")
    assert (found.low, found.high) == ((0, 0, 0), (3, 1, 2))
    assert mesh(obj(TETRAHEDRON * [1, 2, 3]), "obj", "z").high == (1, 2, 3)


def test_numbers_lie_on_a_grid_and_have_no_minus_zero() -> None:
    found = mesh(obj(TETRAHEDRON * (1 / 3) - 0.00000001), "obj", "z")
    vertices = found.parts[0].vertices
    assert (vertices == np.round(vertices, 6)).all() and not np.signbit(vertices[vertices == 0]).any()


def test_polygons_negative_numbers_and_continued_lines() -> None:
    points = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    text = points + b"usemtl red paint\nf -4/1 -3/2 \\\n-2/3 -1/4\n"
    found = mesh(text, "obj", "z")
    (part,) = found.parts
    assert (found.triangles, part.slot, part.mapped) == (4, "red_paint", True)  # a square with two sides
    top_left = part.uvs[(part.vertices == [0, 1, 0]).all(axis=1)]
    assert (top_left == [0, 0]).all() and len(top_left)  # v is counted from below in OBJ, and from above in images


def test_materials_give_slots_colours_and_pictures() -> None:
    materials = [
        {"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.2158605, 0, 1]}},
        {"name": "<script>"},
        {"name": "skin", "doubleSided": True, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
    ]
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1}
    meshes = [{"primitives": [{**primitive, "material": k} for k in range(3)]}]
    content = glb(document(materials=materials, meshes=meshes)[0])
    found = mesh(content, "glb", "y")
    assert [part.slot for part in found.parts] == ["skin", "material.1", "material.2"]
    assert [part.colour for part in found.parts] == ["#ff8000", "#ffffff", "#ffffff"]
    assert [part.picture for part in found.parts] == [None, None, 0]
    assert [len(part.triangles) for part in found.parts] == [4, 4, 8]
    assert (image(content, "glb", 0) == picture()).all()


def test_text_files_can_contain_binary_data() -> None:
    import base64
    import json

    declared, body = document()
    declared["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
    assert corners(mesh(json.dumps(declared).encode(), "gltf", "y")) == corners(mesh(glb(), "glb", "y"))


@pytest.mark.parametrize("mode", ["L", "P", "RGB", "RGBA", "1", "LA"])
def test_pillow_reads_the_same_pixels(mode: str) -> None:
    made = Image.fromarray(picture(9, 7)).convert(mode)
    file = io.BytesIO()
    made.save(file, "PNG")
    assert (image(file.getvalue(), "png") == np.asarray(made.convert("RGB"))).all()


def test_interlaced_images_are_read() -> None:
    pixels, rows = picture(9, 7), b""
    passes = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
    for x, across, y, down in passes:
        rows += b"".join(b"\0" + row.tobytes() for row in pixels[y::down, x::across] if row.size)
    header = modelling.chunk(b"IHDR", struct.pack(">IIBBBBB", 9, 7, 8, 2, 0, 0, 1))
    body = modelling.chunk(b"IDAT", zlib.compress(rows)) + modelling.chunk(b"IEND", b"")
    content = b"\x89PNG\r\n\x1a\n" + header + body
    assert (image(content, "png") == pixels).all()
    assert (image(content, "png") == np.asarray(Image.open(io.BytesIO(content)))).all()


def test_metadata_chunks_do_not_reach_the_decoder() -> None:
    """Neither a text that would unpack to a gigabyte nor a colour profile is read."""
    bomb = modelling.chunk(b"zTXt", b"k\0\0" + b"\x78\xda" + os.urandom(100)) + modelling.chunk(b"gAMA", b"\0\0\0\1")
    assert (image(png(picture(), extra=bomb), "png") == picture()).all()


def _glb(**changes: Any) -> bytes:
    return glb(document(**changes)[0])


def _accessors(at: int, **changes: Any) -> bytes:
    declared, _ = document()
    declared["accessors"][at] |= changes
    return glb(declared)


def _shown_often() -> bytes:
    """Return a GLB of 60 KB with 64 materials, each of which shows the same image under another number."""
    declared, body = document()
    filler = png(picture(), extra=modelling.chunk(b"teXt", bytes(50_000)))
    declared["bufferViews"].append({"buffer": 0, "byteOffset": len(body), "byteLength": len(filler)})
    declared["images"] = [{"bufferView": 4}] * 64
    declared["textures"] = [{"source": n} for n in range(64)]
    declared["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": n}}} for n in range(64)]
    (primitive,) = declared["meshes"][0]["primitives"]
    declared["meshes"] = [{"primitives": [{**primitive, "material": n} for n in range(64)]}]
    body += filler + b"\0" * (-len(filler) % 4)
    declared["buffers"] = [{"byteLength": len(body)}]
    return glb(declared, body)


BROKEN: dict[str, tuple[str, bytes, str]] = {
    "a cut STL": ("stl", stl()[:-7], "its header states 4 triangles (284 bytes), but it has 277 bytes"),
    "an STL that boasts": ("stl", stl(declared=2**32 - 1), "4294967295 triangles"),
    "an STL of nothing": ("stl", stl(faces=FACES[:0]), "has no triangle with an area above 0"),
    "NaN": ("stl", stl(TETRAHEDRON * np.nan), "is not a finite number"),
    "flat": ("obj", obj(TETRAHEDRON * [1, 0, 0]), "has no triangle with an area above 0"),
    "a face beyond": ("obj", obj() + b"f 1 2 99\n", "line 9: a face names number 99 of 4"),
    "a face of two": ("obj", obj() + b"f 1 2\n", "line 9: a face has fewer than three corners"),
    "a library": ("obj", b"mtllib ../../etc/passwd\n" + obj(), "line 1: `mtllib` names another file"),
    "zero bytes": ("obj", obj() + b"\0", "it holds a zero byte"),
    "a cut GLB": ("glb", glb()[:-8], "but it has"),
    "no JSON": ("gltf", b"{", "its content is not JSON"),
    "a signalling NaN": ("glb", glb().replace(struct.pack("<f", 1), b"\1\0\xa0\x7f"), "is not a finite number"),
    "NaN in JSON": ("glb", _glb(nodes=[{"mesh": 0, "scale": [float("nan"), 1, 1]}]), "its content is not JSON"),
    "another file": ("glb", _glb(buffers=[{"uri": "../secret.bin", "byteLength": 9}]), "another file, '../secret.bin'"),
    "a loop": ("glb", _glb(nodes=[{"mesh": 0, "children": [0]}]), "is its own ancestor"),
    "a skin": ("glb", _glb(nodes=[{"mesh": 0, "skin": 0}]), "has a skin (skeleton)"),
    "glass": ("glb", _glb(materials=[{"alphaMode": "BLEND"}]), "is transparent"),
    "a giant column": ("glb", _accessors(0, count=2**40 - 1), "vertices exceed the limit"),
    "indices beyond": ("glb", _accessors(1, bufferView=2, count=12), "a face names a vertex"),
    "many copies": ("glb", _glb(nodes=[{"children": list(range(1, 10_000))}, *[{"mesh": 0}] * 9_999],
                                meshes=[{"primitives": [{"attributes": {"POSITION": 0}}] * 999}]),
                    "9989001 triangles exceed the limit"),
    "many parts": ("glb", _glb(nodes=[{"children": list(range(1, 10_000))}, *[{"mesh": 0}] * 9_999],
                               meshes=[{"primitives": [{"attributes": {"POSITION": 0}}] * 12}]),
                   "119988 parts exceed the limit"),
    "an image shown often": ("glb", _shown_often(), "are parts of each other; export it with each image once"),
    "a giant polygon": ("obj", obj() + b"f " + b"1 2 3 " * 170_000 + b"\n", "510002 triangles exceed the limit"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_or_hostile_mesh_is_refused(name: str) -> None:
    kind, content, words = BROKEN[name]
    with pytest.raises(AssetError) as caught:
        found = mesh(content, kind, "y")
        for part in found.parts:
            if part.picture is not None:
                image(content, kind, part.picture)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 200


def _header(width: int, height: int, depth: int = 8, colour: int = 2) -> bytes:
    return png(picture())[:8] + modelling.chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))


PALETTE = bytes(range(6))  # of two colours


def _indexed(palette: bytes, *, extra: bytes = b"", late: bytes = b"") -> bytes:
    """Return a PNG of two pixels, of the first and the second colour of a palette; `late` chunks follow the pixels."""
    colours = modelling.chunk(b"PLTE", palette) if palette else b""
    pixels = modelling.chunk(b"IDAT", zlib.compress(b"\0\0\1"))
    return _header(2, 1, 8, 3) + colours + extra + pixels + late + modelling.chunk(b"IEND", b"")


def _see_through_grey(depth: int) -> bytes:
    """Return a grey PNG of one pixel, of the value 1, which is transparent."""
    pixels = modelling.chunk(b"IDAT", zlib.compress(bytes([0, 1 << (8 - depth)])))
    clear = modelling.chunk(b"tRNS", b"\0\1")
    return _header(1, 1, depth, 0) + clear + pixels + modelling.chunk(b"IEND", b"")


def test_images_of_a_palette_and_of_many_pieces_are_read() -> None:
    assert image(_indexed(PALETTE), "png").tolist() == [[[0, 1, 2], [3, 4, 5]]]
    whole = png(picture())
    at = whole.index(b"IDAT") - 4
    length = int.from_bytes(whole[at : at + 4], "big")
    body = whole[at + 8 : at + 8 + length]
    pieces = b"".join(modelling.chunk(b"IDAT", body[n : n + 1]) for n in range(len(body)))
    assert (image(whole[:at] + pieces + whole[at + 12 + length :], "png") == picture()).all()


BROKEN_IMAGES = {
    "a JPEG": (b"\xff\xd8\xff\xe0", "is not a PNG image but a JPEG"),
    "a bomb": (_header(60_000, 60_000), "its header states 60000 x 60000 pixels"),
    "a cut": (png(picture())[:-20], "is truncated"),
    "a wrong sum": (png(picture())[:50] + b"\7" + png(picture())[51:], "is damaged: the checksum of a chunk"),
    "two headers": (_header(4, 3) + _header(60_000, 60_000)[8:] + png(picture())[33:], "it has two headers"),
    "see-through": (png(np.full((2, 2, 4), 128, np.uint8)), "is partly transparent"),
    "fewer rows": (_header(4, 400) + png(picture())[33:], "is truncated or damaged"),
    "no palette": (_indexed(b""), "it has no valid palette"),
    "a colour beyond": (_indexed(PALETTE[:3]), "a pixel has a colour beyond its palette"),
    "see-through indices": (_indexed(PALETTE, extra=modelling.chunk(b"tRNS", b"\0")), "is partly transparent"),
    **{f"see-through {depth}-bit grey": (_see_through_grey(depth), "is partly transparent") for depth in (1, 2, 4, 8)},
}


@pytest.mark.parametrize("name", BROKEN_IMAGES)
def test_broken_or_hostile_image_is_refused(name: str) -> None:
    content, words = BROKEN_IMAGES[name]
    with pytest.raises(AssetError) as caught:
        image(content, "png")
    assert words in str(caught.value) and "\n" not in str(caught.value)


hostile = settings(max_examples=150, deadline=5000, suppress_health_check=[HealthCheck.too_slow])


@hostile
@given(st.sampled_from(["obj", "stl", "glb", "gltf", "png"]), st.binary(max_size=400))
@example("gltf", b'{"asset": {"version": "2.0"}, "nodes": 5}')
@example("gltf", b'{"asset": 7}')
def test_any_bytes_are_read_or_refused(kind: str, content: bytes) -> None:
    _read_or_refused(kind, content)


scalars = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats() | st.text(max_size=5)
values = st.recursive(scalars, lambda v: st.lists(v, max_size=3) | st.dictionaries(st.text(max_size=3), v, max_size=3))


@pytest.mark.slow
@hostile
@given(st.data())
def test_any_gltf_document_is_read_or_refused(data: st.DataObject) -> None:
    """One value anywhere in a valid document is replaced by any other."""
    declared, body = document()
    here: Any = declared
    while isinstance(here, dict | list) and here:
        key = data.draw(st.sampled_from(sorted(here) if isinstance(here, dict) else range(len(here))))
        if not isinstance(here[key], dict | list) or data.draw(st.booleans()):
            here[key] = data.draw(values)
            break
        here = here[key]
    _read_or_refused("glb", glb(declared, body))


def _read_or_refused(kind: str, content: bytes) -> None:
    try:
        if kind == "png":
            assert image(content, kind).dtype == np.uint8
            return
        found = mesh(content, kind, "y")
        assert all(np.isfinite(part.vertices).all() and len(part.triangles) for part in found.parts)
        for part in found.parts:
            if part.picture is not None:
                image(content, kind, part.picture)
    except AssetError as error:
        assert str(error) and "\n" not in str(error)


_PRINT = """
import hashlib, sys
from pathlib import Path
from recipe_compiler.ir.assets import image, mesh
digest = hashlib.sha256()
for name in ("crate.glb", "pillar.obj", "cone.stl"):
    content = (Path(sys.argv[1]) / name).read_bytes()
    for part in mesh(content, name[-3:], "y").parts:
        for column in (part.vertices, part.normals, part.uvs, part.triangles):
            digest.update(column.tobytes())
        if part.picture is not None:
            digest.update(image(content, "glb", part.picture).tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_the_numbers_do_not_depend_on_cpu_features() -> None:
    """Compared with numpy without wide instructions and glibc without FMA."""
    seen = set()
    for environment in (
        {},
        {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4", "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3"},
    ):
        command = [sys.executable, "-c", _PRINT, str(SHIPPED)]
        run = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=True)
        seen.add(run.stdout)
    assert len(seen) == 1 and len(seen.pop()) == 65


def test_the_shipped_files_equal_those_of_their_generator(tmp_path: Path) -> None:
    import runpy

    made = runpy.run_path(str(SHIPPED / "make_files.py"))
    assert made["crate"]() == (SHIPPED / "crate.glb").read_bytes()
    assert made["pillar"]() == (SHIPPED / "pillar.obj").read_text()
    assert made["cone"]() == (SHIPPED / "cone.stl").read_bytes()
    assert (image((SHIPPED / "poster.png").read_bytes(), "png") == made["poster"]()).all()
