"""Locates, reads, hashes and validates the asset files of a recipe, which must be below the recipe's folder.

Each file is read once; the same bytes are hashed and decoded. Plans hold only the digest, size, bounding box and
materials; the runtime reads the file again and checks the digest. A problem is reported at the place in the recipe
that names the file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.plan import FilePlan
from recipe_compiler.ir.plan_bounds import MAX_TEXTURE_PIXELS
from recipe_compiler.ir.plurals import count
from recipe_compiler.schema.scene import Asset
from recipe_compiler.source.file_help import nearest_file
from recipe_compiler.source.merge import Sources, forbidden, stays_below
from recipe_compiler.source.yaml_reader import Value, printable, show

if TYPE_CHECKING:
    from recipe_compiler.ir import assets

MESH_BYTES = 32 << 20
IMAGE_BYTES = 16 << 20
ALL_BYTES = 128 << 20
ALL_TRIANGLES = 2_000_000
ALL_PIXELS = MAX_TEXTURE_PIXELS
ALL_PARTS = 100_000  # each part of a mesh costs time, however small it is
INVALID_FILES = 20  # invalid files that are reported before the others are left out
INVALID_BYTES = 32 << 20  # of invalid files, likewise, since decoding them takes time
_KINDS = {"mesh": ("glb", "gltf", "obj", "stl"), "image": ("png",)}
_WHY = {
    "mesh": "export it in one of these formats",
    "image": "save it as PNG, which decodes to the same pixels on every host",
}

Corner = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A material of a mesh."""

    colour: str  # "#rrggbb"
    picture: int | None  # number of its texture image within the file
    repeat: bool  # whether the texture repeats beyond its edges
    mapped: bool  # whether it has texture coordinates


@dataclass(frozen=True)
class AssetFile:
    """A validated asset. Coordinates of a mesh are in the file's unit, with x forward, y left, z up."""

    name: str
    path: str  # relative to the recipe's folder
    file: FilePlan
    up: str = "z"  # the axis of the file that points up
    triangles: int = 0
    parts: int = 0  # of a mesh: as many as its nodes have primitives
    pixels: tuple[int, int] = (0, 0)  # width and height of an image; for a mesh, all pixels of its textures and 1
    low: Corner = (0.0, 0.0, 0.0)  # minimum corner of the bounding box
    high: Corner = (0.0, 0.0, 0.0)  # maximum corner
    materials: Mapping[str, Material] = field(default_factory=dict)  # by slot
    shape: Mapping[str, float] = field(default_factory=dict)  # of a blueprint, as its file determines it

    @property
    def contents(self) -> str:
        """A one-line summary of the content."""
        if self.file.kind == "png":
            return f"{self.pixels[0]} x {self.pixels[1]} pixels"
        return f"{self.triangles} triangles in {', '.join(self.materials)}"


@dataclass(frozen=True)
class NamedFile:
    """A file that a recipe names."""

    label: str  # of its problems, such as "assets.poster"
    asset: Asset
    path: str  # relative to the recipe's folder
    place: Place
    pinned: Place  # of its SHA-256
    blueprint: str = ""  # the id of the blueprint whose body it is
    scale: float = 1.0  # of a blueprint: metres of one unit


def read(
    root: Value,
    assets: Mapping[str, Asset],
    folder: Path,
    sources: Sources,
    textures: Mapping[str, NamedFile] | None = None,
) -> tuple[dict[str, AssetFile], list[Problem]]:
    """Read and validate the assets of a recipe.

    Args:
        root: the recipe, for places.
        assets: the assets by name.
        folder: the recipe's folder.
        sources: the digests of the asset files are added to its `files`.
        textures: further files by name, those of patches.

    Returns:
        The valid files by name, and the problems of the others.
    """
    found: dict[str, AssetFile] = {}
    problems: list[Problem] = []
    total = triangles = pixels = parts = wasted = 0
    for name, wanted in {**_wanted(root, assets, folder, sources), **(textures or {})}.items():
        asset, path, place, label = wanted.asset, wanted.path, wanted.place, wanted.label
        if len(problems) >= INVALID_FILES or wasted > INVALID_BYTES:
            message = f"assets: {count(len(problems), 'file')} above cannot be used, and the others were not read"
            problems.append(Problem(message, place, "correct them first", Code.INVALID_ASSET))
            break
        content = b""
        try:
            content = _content(asset, folder, path)
            one = _decoded(name, wanted, content)
        except (OSError, ValueError) as error:
            wasted += len(content)
            shown, reason = show(asset.mesh if asset.mesh is not None else asset.image), _reason(error, folder / path)
            problems.append(Problem(f"{label}: {shown}: {reason}", place, code=Code.INVALID_ASSET))
            continue
        found[name] = one
        sources.files[path] = one.file.sha256
        if asset.sha256 is not None and asset.sha256 != one.file.sha256:
            problems.append(other_file(label, path, one.file.sha256, wanted.pinned))
        total, triangles = total + one.file.bytes, triangles + one.triangles
        pixels, parts = pixels + one.pixels[0] * one.pixels[1], parts + one.parts
        for number, what, most in _sums(total, triangles, pixels, parts):
            message = f"assets: {number} {what} in total up to here exceed the limit of {most}"
            problems.append(Problem(message, place, "use fewer or smaller assets", Code.INPUT_LIMIT))
            return found, problems
    return found, problems


def other_file(label: str, path: str, sha256: str, place: Place) -> Problem:
    """Return the problem that a file does not have the SHA-256 that the recipe gives.

    Args:
        label: of the file in the recipe, such as "assets.poster".
        path: the file's path.
        sha256: the file's own digest.
        place: of the digest in the recipe.
    """
    message = f"{label}.sha256: {show(path)} is another file: its digest is {sha256}"
    remedy = "restore the original file, or write this digest if the new file is intended"
    return Problem(message, place, remedy, Code.INVALID_ASSET)


def _wanted(root: Value, assets: Mapping[str, Asset], folder: Path, sources: Sources) -> dict[str, NamedFile]:
    names = {printable(str(folder / name)): name for name in sources.files}
    wanted = {}
    for name, asset in assets.items():
        place = root.place_of("assets", name, "mesh" if asset.mesh is not None else "image")
        path = relative(names.get(place.file, ""), asset.mesh or asset.image or "")
        wanted[name] = NamedFile(f"assets.{name}", asset, path, place, root.place_of("assets", name, "sha256"))
    return wanted


def named(root: Value, folder: Path, sources: Sources) -> set[str]:
    """Return the paths of all assets of a recipe, relative to its folder, without reading the files."""
    names = {printable(str(folder / name)): name for name in sources.files}
    assets, found = root.get("assets"), set()
    for name, asset in (assets.map if assets else {}).items():
        for key in ("mesh", "image"):
            given = asset.get(key)
            if given is not None and isinstance(given.data, str):
                found.add(relative(names.get(root.place_of("assets", name, key).file, ""), given.data))
    return found


def relative(names_it: str, given: str) -> str:
    """Return a path relative to the recipe's folder.

    Args:
        names_it: the file that names the asset, relative to the recipe's folder.
        given: the path written there, relative to that file.
    """
    return str(PurePosixPath(names_it).parent / given)


def _sums(total: int, triangles: int, pixels: int, parts: int) -> Iterator[tuple[int, str, int]]:
    """Yield the exceeded limits: count, unit, limit."""
    every = (
        (total, "bytes", ALL_BYTES),
        (triangles, "triangles", ALL_TRIANGLES),
        (pixels, "pixels", ALL_PIXELS),
        (parts, "parts of meshes", ALL_PARTS),
    )
    return (row for row in every if row[0] > row[2])


def _reason(error: OSError | ValueError, path: Path) -> str:
    """Return why an asset cannot be used, in words."""
    if isinstance(error, FileNotFoundError):
        return f"there is no such file; {nearest_file(path) or 'paths are relative to this file'}"
    return (isinstance(error, OSError) and f"cannot be read: {error.strerror}") or str(error)


def _content(asset: Asset, folder: Path, path: str) -> bytes:
    """Read the file of one asset.

    Raises:
        OSError: the file cannot be read.
        ValueError: the path is not allowed, or the file is too large.
    """
    key, given = ("mesh", asset.mesh) if asset.mesh is not None else ("image", asset.image or "")
    assert given is not None
    if not given:
        raise ValueError("is not a path; name a file below the recipe's folder")
    problem = forbidden(given)
    if problem:
        raise ValueError(problem)
    if not stays_below(folder, path):
        raise ValueError("leaves the recipe's folder through a symbolic link; put a copy of the file in the folder")
    kind = PurePosixPath(path).suffix[1:].lower()
    if kind not in _KINDS[key]:
        kinds = ", ".join(f".{k}" for k in _KINDS[key])
        article = "an" if key == "image" else "a"
        raise ValueError(f"is not {article} {key} in a supported format ({kinds}); {_WHY[key]}")
    most = MESH_BYTES if key == "mesh" else IMAGE_BYTES
    content = read_regular(folder / path, most)
    if len(content) > most:
        raise ValueError(f"is larger than {most:,} bytes, the limit for a {key}; simplify it")
    return content


def _decoded(name: str, wanted: NamedFile, content: bytes) -> AssetFile:
    """Validate the content of one asset; ValueError if it is invalid."""
    asset, path = wanted.asset, wanted.path
    kind = PurePosixPath(path).suffix[1:].lower()
    file = FilePlan(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content), kind=kind)
    if wanted.blueprint:
        return _body(name, wanted, file, content)
    if asset.mesh is not None:
        return _mesh(name, path, file, asset.up, content)
    return _image(name, path, file, content)


def _image(name: str, path: str, file: FilePlan, content: bytes) -> AssetFile:
    from recipe_compiler.ir import assets

    height, width, _ = assets.image(content, file.kind).shape
    return AssetFile(name, path, file, pixels=(width, height))


def _mesh(name: str, path: str, file: FilePlan, up: str | None, content: bytes) -> AssetFile:
    from recipe_compiler.ir import assets

    up = up or ("z" if file.kind == "stl" else "y")
    mesh = assets.mesh(content, file.kind, up)
    pixels, materials = _materials(mesh, file, content)
    counts = mesh.triangles, len(mesh.parts)
    return AssetFile(name, path, file, up, *counts, (pixels, 1), mesh.low, mesh.high, materials)


def _body(name: str, wanted: NamedFile, file: FilePlan, content: bytes) -> AssetFile:
    """Validate the body of a blueprint."""
    from recipe_compiler.ir import assets
    from recipe_compiler.lowering.own_bodies import measured

    if file.kind not in ("glb", "gltf"):
        raise ValueError("is not a glTF file; export it as .glb")
    body = assets.body(content)
    shape, low, high = measured(wanted.blueprint, body, wanted.scale)
    pixels, materials = _materials(body.mesh, file, content)
    counts = body.mesh.triangles, len(body.mesh.parts)
    return AssetFile(name, wanted.path, file, "y", *counts, (pixels, 1), low, high, materials, shape)


def _materials(mesh: assets.MeshData, file: FilePlan, content: bytes) -> tuple[int, dict[str, Material]]:
    """Return the pixels of a mesh's images, and its materials by slot."""
    from recipe_compiler.ir import assets

    materials: dict[str, Material] = {}
    for part in mesh.parts:
        known = materials.setdefault(part.slot, Material(part.colour, part.picture, part.repeat, part.mapped))
        if part.mapped and not known.mapped:
            materials[part.slot] = Material(part.colour, part.picture, part.repeat, True)
    shown = {m.picture for m in materials.values() if m.picture is not None}
    pixels = 0
    for number in sorted(shown):
        height, width, _ = assets.image(content, file.kind, number).shape
        pixels += height * width
        if pixels > ALL_PIXELS:
            raise ValueError(f"its textures have more than {ALL_PIXELS >> 20} Mpx in total; make them smaller")
    return pixels, materials
