"""glTF 2.0, binary (.glb) and text (.gltf): meshes, placed by their nodes, with base colours and pictures.

All data must be within the file. Unsupported features that change the appearance (skins, morph targets,
compression, transparent materials) are refused; cameras, lights, animations and vertex colours are ignored.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from recipe_compiler.ir import exact
from recipe_compiler.ir.assets import png
from recipe_compiler.ir.assets.geometry import (
    GREY,
    MAX_TRIANGLES,
    MAX_VERTICES,
    AssetError,
    Floats,
    Raw,
    check_count,
)
from recipe_compiler.ir.assets.json_values import JsonObject, as_list, as_number, as_object, as_whole
from recipe_compiler.ir.assets.matrices import IDENTITY, Matrix, composed, mirrors, moved, turned
from recipe_compiler.ir.assets.names import slot_names

MAX_JSON = 8 << 20
MAX_NODES = 10_000
MAX_REPEATED = 1 << 20  # bytes of images beyond the file's size, which images that share data may have
MAX_PARTS = 20_000  # of all nodes' meshes together; each costs time, however small it is
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_READ = {
    "KHR_materials_unlit",
    "KHR_materials_specular",
    "KHR_materials_ior",
}  # they affect neither geometry nor base colour
_CLAMP, _REPEAT = 33071, 10497

Nodes = dict[int, tuple[int, Matrix]]  # by index: the parent, or -1, and the transform to the scene's frame


@dataclass(frozen=True)
class _Material:
    slot: str
    colour: str
    picture: int | None
    channel: int
    repeat: bool
    both_sides: bool


def read(content: bytes) -> list[Raw]:
    """Return a part for each primitive of each node of the file's scene, in the scene's frame (y up, z forward)."""
    document = opened(content)
    placed = [(mesh, matrix) for mesh, matrix, _ in document.placed()]
    check_counts(document, [mesh for mesh, _ in placed])
    raws = [raw for mesh, matrix in placed for raw in document.parts(mesh, matrix)]
    check_images(document, raws, len(content))
    return raws


def check_counts(document: Document, meshes: Sequence[int]) -> None:
    """Raise AssetError if the meshes of a scene, each as often as it is shown, exceed a limit."""
    limits = ("triangles", MAX_TRIANGLES), ("vertices", MAX_VERTICES), ("parts", MAX_PARTS)
    for column, (what, most) in enumerate(limits):
        check_count(sum(document.counts(mesh)[column] for mesh in meshes), what, most)


def check_images(document: Document, raws: Sequence[Raw], size: int) -> None:
    """Raise AssetError if the images of parts repeat the bytes of a file of `size` bytes."""
    numbers = sorted({raw.picture for raw in raws if raw.picture is not None})
    shown = sum(map(document.image_bytes, numbers))
    if shown > size + MAX_REPEATED:  # each image is decoded, so one must not be there under many numbers
        raise AssetError(f"its images of {shown:,} bytes are parts of each other; export it with each image once")


def picture(content: bytes, number: int) -> png.Pixels:
    """Return one of the file's images."""
    return png.decode(opened(content).image(number), opaque=False)


@lru_cache(maxsize=1)  # the images of a file are read one after the other
def opened(content: bytes) -> Document:
    """Return the document of a file."""
    return Document(*_open(content))


def _open(content: bytes) -> tuple[JsonObject, bytes | None]:
    """Return the JSON document and the binary chunk."""
    if content[:4] != b"glTF":
        return _parsed(content), None
    if len(content) < 20 or int.from_bytes(content[8:12], "little") != len(content):
        stated = int.from_bytes(content[8:12], "little")
        raise AssetError(f"its header states {stated} bytes, but it has {len(content)}; export it again")
    if int.from_bytes(content[4:8], "little") != 2:
        raise AssetError("is not glTF version 2; export it as glTF 2.0")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(content) and len(chunks) < 2:  # the JSON and the data come first
        length, kind = int.from_bytes(content[at : at + 4], "little"), content[at + 4 : at + 8]
        if at + 8 + length > len(content):
            raise AssetError(f"is truncated: a chunk of {length} bytes exceeds the file; export it again")
        chunks[kind] = content[at + 8 : at + 8 + length]
        at += 8 + length
    return _parsed(chunks.get(b"JSON", b"")), chunks.get(b"BIN\0")


def _parsed(text: bytes) -> JsonObject:
    if len(text) > MAX_JSON:
        raise AssetError(f"its description is larger than {MAX_JSON >> 20} MiB; put the data into a .glb file")
    try:
        found = json.loads(text.decode("utf-8-sig"), parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise AssetError("is not glTF: its content is not JSON; export it again") from None
    if not isinstance(found, dict) or not str(as_object(found.get("asset", {})).get("version", "")).startswith("2."):
        raise AssetError("is not glTF version 2; export it as glTF 2.0")
    needed = sorted(set(map(str, as_list(found.get("extensionsRequired", [])))) - _READ)
    if needed:
        raise AssetError(f"needs the extension {needed[0][:40]!r}, which is not supported; export it without")
    return found


def _no_number(word: str) -> NoReturn:
    raise ValueError(word)


class Document:
    """A glTF document. Its methods raise AssetError, or KeyError and similar exceptions for absent parts."""

    def __init__(self, document: JsonObject, beside: bytes | None) -> None:
        self._json, self._beside = document, beside
        self._buffers: dict[int, bytes] = {}
        self._counts: dict[int, tuple[int, int, int]] = {}

    def _index(self, kind: str, index: object) -> int:
        """The index itself, if the document has an entry of that kind there."""
        items = as_list(self._json.get(kind, []))
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise AssetError(f"names {kind} {str(index)[:20]} of {len(items)}, which does not exist; export it again")
        return index

    def item(self, kind: str, index: object) -> JsonObject:
        """Return an entry of the document, such as one of its `nodes`."""
        found = as_list(self._json.get(kind, []))[self._index(kind, index)]
        if not isinstance(found, dict):
            raise AssetError(f"{kind} {index} is damaged; export it again")
        return found

    # Nodes

    def placed(self, bodies: Nodes | None = None) -> Iterator[tuple[int, Matrix, int]]:
        """Return the meshes of the scene, each with its transform and its node.

        Nodes, which may have skins then, are added to `bodies`: by index, the parent and the transform.
        """
        nodes = as_list(self._json.get("nodes", []))
        check_count(len(nodes), "nodes", MAX_NODES)
        waiting: list[tuple[object, Matrix, int]] = [
            (index, IDENTITY, -1) for index in reversed(self._roots(len(nodes)))
        ]
        seen: set[int] = set()
        while waiting:
            index, above, parent = waiting.pop()
            index = self._index("nodes", index)
            node = self.item("nodes", index)
            if index in seen:
                raise AssetError(f"node {index} is its own ancestor or has two parents; export it again")
            seen.add(index)
            if "skin" in node and bodies is None:
                raise AssetError("has a skin (skeleton), which is not supported; apply its pose, then export it")
            matrix = composed(above, _local(node))
            if bodies is not None:
                bodies[index] = parent, matrix
            if "mesh" in node:
                yield self._index("meshes", node["mesh"]), matrix, index
            waiting += [(child, matrix, index) for child in reversed(as_list(node.get("children", [])))]

    def _roots(self, count: int) -> Sequence[object]:
        if self._json.get("scenes"):
            return as_list(self.item("scenes", self._json.get("scene", 0)).get("nodes", []))
        nodes = as_list(self._json.get("nodes", []))
        children = {child for node in nodes for child in as_list(as_object(node).get("children", []))}
        return [index for index in range(count) if index not in children]

    # Meshes

    def counts(self, mesh: int) -> tuple[int, int, int]:
        """How many triangles, vertices and parts a mesh has, from its descriptions alone.

        So what many nodes show again and again is counted before any of it is made.
        """
        if mesh not in self._counts:
            triangles = vertices = 0
            primitives = list(map(as_object, as_list(self.item("meshes", mesh)["primitives"])))
            for primitive in primitives:
                points = as_whole(self.item("accessors", as_object(primitive["attributes"])["POSITION"])["count"])
                corners = points
                if "indices" in primitive:
                    corners = as_whole(self.item("accessors", primitive["indices"])["count"])
                triangles += corners // 3 * (1 + self._material(primitive).both_sides)
                vertices += points
            self._counts[mesh] = triangles, vertices, len(primitives)
        return self._counts[mesh]

    def attributes(self, mesh: int) -> Iterator[JsonObject]:
        """The attributes of each of a mesh's parts: accessors by name."""
        for primitive in map(as_object, as_list(self.item("meshes", mesh)["primitives"])):
            yield as_object(primitive["attributes"])

    def parts(self, mesh: int, matrix: Matrix) -> Iterator[Raw]:
        """The parts of a mesh, moved by a node's matrix."""
        for primitive in map(as_object, as_list(self.item("meshes", mesh)["primitives"])):
            if primitive.get("mode", 4) != 4 or "targets" in primitive:
                raise AssetError("has lines, points, strips or morph targets; export it as plain triangles")
            attributes, material = as_object(primitive["attributes"]), self._material(primitive)
            points = self.floats(attributes["POSITION"], 3)
            normals = self.floats(attributes["NORMAL"], 3) if "NORMAL" in attributes else None
            uv = f"TEXCOORD_{material.channel}"
            uvs = self.floats(attributes[uv], 2) if uv in attributes else None
            if any(column is not None and len(column) != len(points) for column in (normals, uvs)):
                raise AssetError("has columns of different length; export it again")
            rows = self.array(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(points))
            if len(rows) % 3:
                raise AssetError(f"{len(rows)} corners are not a multiple of 3; export it again")
            triangles = rows.astype(np.int64).reshape(-1, 3)
            yield Raw(
                material.slot,
                moved(points, matrix),
                triangles[:, ::-1] if mirrors(matrix) else triangles,
                None if normals is None else turned(normals, matrix),
                uvs,
                material.colour,
                material.picture if uvs is not None else None,
                material.repeat,
                material.both_sides,
            )

    def floats(self, accessor: object, width: int) -> Floats:
        """Return a column of numbers; normalized integers become fractions of 1."""
        found = self.array(accessor)
        if found.shape[1] != width:
            raise AssetError(f"has {found.shape[1]} numbers instead of {width}; export it again")
        if self.item("accessors", accessor).get("normalized") and found.dtype.kind in "iu":
            scale = float(np.iinfo(found.dtype.str).max)
            return np.maximum(found.astype(np.float64) / scale, -1.0)
        with np.errstate(invalid="ignore"):  # NumPy warns of a signalling NaN; it is refused below, as any NaN
            return found.astype(np.float64)

    def array(self, accessor: object) -> NDArray[np.generic]:
        """What an accessor describes, [count, width]; AssetError if it reaches beyond its data."""
        entry = self.item("accessors", accessor)
        if "sparse" in entry or "bufferView" not in entry:
            raise AssetError("has sparse or missing accessor data, which is not supported; export it without")
        kind, width, count = (
            np.dtype(_KINDS[as_whole(entry["componentType"])]),
            _WIDTHS[str(entry["type"])],
            as_whole(entry["count"]),
        )
        check_count(count, "vertices or corners", 3 * MAX_VERTICES)
        view = self._view(entry["bufferView"])
        row = width * kind.itemsize
        stride = as_whole(self.item("bufferViews", entry["bufferView"]).get("byteStride", row))
        start = as_whole(entry.get("byteOffset", 0))
        if count == 0 or stride < row or start + (count - 1) * stride + row > len(view):
            raise AssetError("an accessor is empty or exceeds its data; export it again")
        rows: NDArray[np.generic] = np.ndarray((count, width), kind, view, start, (stride, kind.itemsize))
        return rows.copy()

    def _view(self, index: object) -> memoryview:
        entry = self.item("bufferViews", index)
        start, length = as_whole(entry.get("byteOffset", 0)), as_whole(entry["byteLength"])
        buffer = self._buffer(entry["buffer"])
        if start + length > len(buffer):
            raise AssetError("a buffer view exceeds its buffer; export it again")
        return memoryview(buffer)[start : start + length]

    def _buffer(self, index: object) -> bytes:
        index = self._index("buffers", index)
        entry = self.item("buffers", index)
        if index not in self._buffers:
            if "uri" in entry:
                self._buffers[index] = _embedded(entry["uri"], f"buffer {index}")
            elif index == 0 and self._beside is not None:
                self._buffers[index] = self._beside
            else:
                raise AssetError(f"buffer {index} is not in the file; export it as one .glb file")
        return self._buffers[index]

    # Materials

    @cached_property
    def _slots(self) -> list[str]:
        return slot_names([as_object(material).get("name") for material in as_list(self._json.get("materials", []))])

    def _material(self, primitive: JsonObject) -> _Material:
        if "material" not in primitive:
            return _Material("body", GREY, None, 0, True, False)
        index = self._index("materials", primitive["material"])
        entry = self.item("materials", index)
        if entry.get("alphaMode", "OPAQUE") != "OPAQUE":
            raise AssetError(f"material {self._slots[index]!r} is transparent (alphaMode); make it opaque")
        base = as_object(entry.get("pbrMetallicRoughness", {}))
        image, channel, repeat = None, 0, True
        if "baseColorTexture" in base:
            used = as_object(base["baseColorTexture"])
            texture = self.item("textures", used["index"])
            if "source" not in texture or "KHR_texture_transform" in as_object(used.get("extensions", {})):
                raise AssetError(
                    "has a transformed texture, or one in an unsupported format; export it with a PNG image"
                )
            image, channel = as_whole(texture["source"]), as_whole(used.get("texCoord", 0))
            self.item("images", image)
            sampler = self.item("samplers", texture["sampler"]) if "sampler" in texture else {}
            repeat = self._repeats(sampler)
        colour = _colour(base.get("baseColorFactor", [1.0, 1.0, 1.0, 1.0]))
        return _Material(self._slots[index], colour, image, channel, repeat, bool(entry.get("doubleSided", False)))

    def _repeats(self, sampler: JsonObject) -> bool:
        modes = {sampler.get("wrapS", _REPEAT), sampler.get("wrapT", _REPEAT)}
        if not modes <= {_CLAMP, _REPEAT}:
            raise AssetError("has a mirrored texture wrap mode, which is not supported; use plain repetition")
        return _REPEAT in modes

    def image_bytes(self, number: int) -> int:
        """The size of an image in a buffer; 0 for one in the text, where it cannot share its data."""
        view = self.item("images", number).get("bufferView")
        return 0 if view is None else as_whole(self.item("bufferViews", view)["byteLength"])

    def image(self, number: int) -> bytes:
        """The bytes of an image."""
        entry = self.item("images", number)
        if "bufferView" in entry:
            return bytes(self._view(entry["bufferView"]))
        return _embedded(entry.get("uri"), f"image {number}")


def _embedded(uri: object, what: str) -> bytes:
    """The bytes of a data URI; AssetError for any other."""
    head, comma, body = uri.partition(",") if isinstance(uri, str) else ("", "", "")
    if not head.startswith("data:") or not head.endswith(";base64") or not comma:
        shown = str(uri)[:40].encode("ascii", "replace").decode()
        raise AssetError(f"{what} is in another file, {shown!r}; export it as one .glb file")
    try:
        return base64.b64decode(body, validate=True)
    except (binascii.Error, ValueError):
        raise AssetError(f"{what} is damaged: its text is no base64; export it again") from None


def _colour(factor: object) -> str:
    """Linear RGBA as sRGB text."""
    rgb = [as_number(value) for value in as_list(factor)[:3]]
    if len(rgb) != 3 or not all(0.0 <= value <= 1.0 for value in rgb):
        raise AssetError("a base colour has numbers that are not between 0 and 1; export it again")
    curve = [12.92 * v if v <= 0.0031308 else 1.055 * exact.power(v, 1 / 2.4) - 0.055 for v in rgb]
    return "#" + "".join(f"{int(v * 255.0 + 0.5):02x}" for v in curve)


def matrix_of(values: Sequence[float]) -> Matrix:
    """Return the matrix whose 16 numbers a file lists column by column."""
    return tuple(tuple(values[4 * column + row] for column in range(4)) for row in range(3))


def _local(node: JsonObject) -> Matrix:
    if "matrix" in node:
        return matrix_of(_numbers(node["matrix"], 16))
    t, s = _numbers(node.get("translation", [0, 0, 0]), 3), _numbers(node.get("scale", [1, 1, 1]), 3)
    x, y, z, w = _numbers(node.get("rotation", [0, 0, 0, 1]), 4)
    length = x * x + y * y + z * z + w * w
    if length < 1e-12:
        raise AssetError("a node has a zero quaternion; export it again")
    d = 2.0 / length
    turn = (
        (1.0 - d * (y * y + z * z), d * (x * y - z * w), d * (x * z + y * w)),
        (d * (x * y + z * w), 1.0 - d * (x * x + z * z), d * (y * z - x * w)),
        (d * (x * z - y * w), d * (y * z + x * w), 1.0 - d * (x * x + y * y)),
    )
    return tuple((row[0] * s[0], row[1] * s[1], row[2] * s[2], t[k]) for k, row in enumerate(turn))


def _numbers(values: object, count: int) -> list[float]:
    found = [as_number(value) for value in as_list(values)]
    if len(found) != count or not all(abs(value) <= 1e6 for value in found):
        raise AssetError(f"a node's transform is not {count} finite numbers within the limits; export it again")
    return found
