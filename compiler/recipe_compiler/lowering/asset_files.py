"""Asset files of a recipe: located below its folder, read once, hashed and validated before any work.

The same bytes are hashed and decoded, so that an invalid file is reported with its place in the recipe. Plans need only
the digest, size, bounding box and materials; the runtime reads the file again and checks the digest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import FilePlan
from recipe_compiler.schema.scene import Asset
from recipe_compiler.source.merge import Sources, forbidden, nearest_file, stays_below
from recipe_compiler.source.yaml_reader import Value, printable, show

MESH_BYTES, IMAGE_BYTES, ALL_BYTES = 32 << 20, 16 << 20, 128 << 20
ALL_TRIANGLES, ALL_PIXELS = 2_000_000, 64 << 20
_KINDS = {"mesh": ("glb", "gltf", "obj", "stl"), "image": ("png",)}
_WHY = {"mesh": "export it as one of these", "image": "save it so: a PNG decodes to the same pixels everywhere"}

Corner = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A part of a mesh: its colour, its picture within the file, and whether an image can be laid on it."""

    colour: str
    picture: int | None
    repeat: bool
    mapped: bool


@dataclass(frozen=True)
class AssetFile:
    """An asset: its path and content; for a mesh its bounding box, in the file's unit, with x forward, y left, z up."""

    name: str
    path: str  # relative to the recipe's folder
    file: FilePlan
    up: str = "z"
    triangles: int = 0
    pixels: tuple[int, int] = (0, 0)  # width, height of an image
    low: Corner = (0.0, 0.0, 0.0)
    high: Corner = (0.0, 0.0, 0.0)
    materials: Mapping[str, Material] = field(default_factory=dict)  # by slot

    @property
    def contents(self) -> str:
        """A description of its content."""
        if self.file.kind == "png":
            return f"{self.pixels[0]} x {self.pixels[1]} pixels"
        return f"{self.triangles} triangles in {', '.join(self.materials)}"


def read(
    root: Value, assets: Mapping[str, Asset], folder: Path, sources: Sources
) -> tuple[dict[str, AssetFile], list[Problem]]:
    """Read and validate the assets of a recipe.

    Args:
        root: the recipe, for places.
        assets: the assets by name.
        folder: the recipe's folder.
        sources: the digests of the asset files are added to its `files`.

    Returns:
        The valid assets by name, and the problems of the others.
    """
    found: dict[str, AssetFile] = {}
    problems: list[Problem] = []
    names = {printable(str(folder / name)): name for name in sources.files}
    total = triangles = pixels = 0
    for name, asset in assets.items():
        key = "mesh" if asset.mesh is not None else "image"
        place = root.place_of("assets", name, key)
        path = _path(names.get(place.file, ""), asset.mesh or asset.image or "")
        try:
            one = _read_one(name, asset, folder, path)
        except (OSError, ValueError) as error:
            reason = (isinstance(error, OSError) and f"cannot be read: {error.strerror}") or str(error)
            if isinstance(error, FileNotFoundError):
                near = nearest_file(folder / path) or "paths are relative to this file"
                reason = f"there is no such file; {near}"
            shown = show(asset.mesh if asset.mesh is not None else asset.image)
            problems.append(Problem(f"assets.{name}: {shown}: {reason}", place, code=Code.INVALID_ASSET))
            continue
        found[name] = one
        sources.files[path] = one.file.sha256
        if asset.sha256 is not None and asset.sha256 != one.file.sha256:
            message = f"assets.{name}.sha256: {show(path)} is another file: its digest is {one.file.sha256}"
            remedy = "put the right file there, or write this digest if the new file is meant"
            problems.append(Problem(message, root.place_of("assets", name, "sha256"), remedy, Code.INVALID_ASSET))
        total, triangles = total + one.file.bytes, triangles + one.triangles
        pixels += one.pixels[0] * one.pixels[1]
        for count, what, most in _sums(total, triangles, pixels):
            message = f"assets: {count} {what} up to here are more than the most allowed together, {most}"
            problems.append(Problem(message, place, "bring fewer", Code.INPUT_LIMIT))
            return found, problems
    return found, problems


def named(root: Value, folder: Path, sources: Sources) -> set[str]:
    """The paths of all assets of a recipe, relative to its folder. The files are not read."""
    names = {printable(str(folder / name)): name for name in sources.files}
    assets, found = root.get("assets"), set()
    for name, asset in (assets.map if assets else {}).items():
        for key in ("mesh", "image"):
            given = asset.get(key)
            if given is not None and isinstance(given.data, str):
                found.add(_path(names.get(root.place_of("assets", name, key).file, ""), given.data))
    return found


def _path(names_it: str, given: str) -> str:
    """The path of an asset from the recipe's folder, of one that is given relative to a file."""
    return str(PurePosixPath(names_it).parent / given)


def _sums(total: int, triangles: int, pixels: int) -> Iterator[tuple[int, str, int]]:
    every = ((total, "bytes", ALL_BYTES), (triangles, "triangles", ALL_TRIANGLES), (pixels, "pixels", ALL_PIXELS))
    return (row for row in every if row[0] > row[2])


def _read_one(name: str, asset: Asset, folder: Path, path: str) -> AssetFile:
    """One asset; ValueError, or OSError, with what is wrong with its path or its content."""
    key, given = ("mesh", asset.mesh) if asset.mesh is not None else ("image", asset.image or "")
    assert given is not None
    if not given:
        raise ValueError("is no path; name a file below the recipe's folder")
    problem = forbidden(given)
    if problem:
        raise ValueError(problem)
    if not stays_below(folder, path):
        raise ValueError("it leads out of the recipe's folder through a symbolic link; put the file itself there")
    kind = PurePosixPath(path).suffix[1:].lower()
    if kind not in _KINDS[key]:
        kinds = ", ".join(f".{k}" for k in _KINDS[key])
        article = "an" if key == "image" else "a"
        raise ValueError(f"is not {article} {key} of a kind that is read here, {kinds}; {_WHY[key]}")
    most = MESH_BYTES if key == "mesh" else IMAGE_BYTES
    content = read_regular(folder / path, most)
    if len(content) > most:
        raise ValueError(f"is larger than {most:,} bytes, the limit for a {key}; simplify it")
    file = FilePlan(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content), kind=kind)
    return _mesh(name, path, file, asset.up, content) if key == "mesh" else _image(name, path, file, content)


def _image(name: str, path: str, file: FilePlan, content: bytes) -> AssetFile:
    from recipe_compiler.ir import assets

    height, width, _ = assets.image(content, file.kind).shape
    return AssetFile(name, path, file, pixels=(width, height))


def _mesh(name: str, path: str, file: FilePlan, up: str | None, content: bytes) -> AssetFile:
    from recipe_compiler.ir import assets

    up = up or ("z" if file.kind == "stl" else "y")
    mesh = assets.mesh(content, file.kind, up)
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
            raise ValueError(f"its pictures have more than {ALL_PIXELS >> 20} Mpx together; make them smaller")
    return AssetFile(name, path, file, up, mesh.triangles, (pixels, 1), mesh.low, mesh.high, materials)
