"""Finds the image files that the patches of a recipe name, in its base, its deltas and its draws.

Paths are relative to the file that names them, like those of assets. A folder means its .png files, in the order of
their names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.plurals import count
from recipe_compiler.lowering.asset_files import AssetFile, NamedFile
from recipe_compiler.schema.scene import Asset
from recipe_compiler.source.merge import Sources, forbidden, stays_below
from recipe_compiler.source.yaml_reader import Value, printable, show

MAX_SEQUENCE = 10_000  # images of a folder
MAX_IMAGES = 100_000  # images of all folders that a recipe names
_MAX_PROBLEMS = 20  # after which no further folder is listed
_PREFIX = "texture:"  # keeps their names distinct from those of assets

Key = tuple[str, str, str]  # the file that names a texture, the path as written there, and `image` or `frames`
Location = tuple[str, str]  # path relative to the recipe's folder, and `image` or `frames`


@dataclass
class TextureFiles:
    """The image files of a recipe's patches."""

    paths: dict[Key, Location] = field(default_factory=dict)  # by texture
    names: dict[Location, tuple[str, ...]] = field(default_factory=dict)  # names of files
    files: dict[str, NamedFile] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def read(self, assets: Mapping[str, AssetFile]) -> dict[Key, tuple[AssetFile, ...]]:
        """Return the files of each texture, without textures that have invalid files.

        Args:
            assets: all validated files, by name.
        """
        every = self.names.items()
        found = {place: tuple(assets[n] for n in names) for place, names in every if all(n in assets for n in names)}
        return {key: found[place] for key, place in self.paths.items() if place in found}


def find(root: Value, folder: Path, sources: Sources) -> TextureFiles:
    """Find the texture files of a recipe whose other parts may be invalid.

    Args:
        root: the recipe.
        folder: the recipe's folder.
        sources: the recipe's files.
    """
    found, known = TextureFiles(), {printable(str(folder / name)): name for name in sources.files}
    images = 0
    for where, kind, value in _named(root):
        given = value.data
        key = texture_key(value.place, str(given), kind)
        if not isinstance(given, str) or key in found.paths:
            continue
        path = str(PurePosixPath(known.get(value.place.file, "")).parent / given)
        found.paths[key] = (path, kind)
        if (path, kind) in found.names and not forbidden(given):
            continue  # the same file or folder in another spelling
        paths = (path,) if kind == "image" else _sequence(where, given, folder, path, value.place, found.problems)
        for one in paths:
            asset = Asset.model_construct(image=given if kind == "image" else one, sha256=None)
            found.files.setdefault(_PREFIX + one, NamedFile(where, asset, one, value.place, value.place))
        found.names[path, kind] = tuple(_PREFIX + one for one in paths)
        images += len(paths) if kind == "frames" else 0
        if images > MAX_IMAGES:
            message = f"{where}: {show(given)}: with it, the folders have {images:,} images, over {MAX_IMAGES:,}"
            found.problems.append(Problem(message, value.place, "name fewer folders", Code.INPUT_LIMIT))
        if images > MAX_IMAGES or len(found.problems) >= _MAX_PROBLEMS:
            break
    return found


def texture_key(place: Place, given: str, kind: str) -> Key:
    """Return the key of a texture in `TextureFiles.paths`; `kind` is `image` or `frames`."""
    return place.file, given, kind


def _named(root: Value) -> Iterator[tuple[str, str, Value]]:
    """Yield the path of each texture in the recipe, `image` or `frames`, and its value.

    A SHA-256 may be in another delta than the image, so it is compared where patches are lowered.
    """
    base, deltas = root.get("base"), root.get("deltas")
    layers = [base] if base is not None else []
    layers += [delta for values in deltas.map.values() for delta in values.map.values()] if deltas is not None else []
    for layer in layers:
        patches = layer.get("patches")
        for name in patches.map if patches is not None else ():
            for kind in ("image", "frames"):
                value = layer.get("patches", name, "texture", kind)
                if value is not None:
                    yield f"patches.{name}.texture.{kind}", kind, value
    draws = root.get("sweep", "draw", "values")
    for path, how in draws.map.items() if draws is not None else ():
        steps = path.split(".")
        choice = how.get("choice")
        if len(steps) == 4 and steps[0] == "patches" and steps[2] == "texture" and steps[3] in ("image", "frames"):
            for value in choice.data if choice is not None and isinstance(choice.data, tuple) else ():
                yield path, steps[3], value


def _sequence(
    where: str, given: str, folder: Path, path: str, place: Place, problems: list[Problem]
) -> tuple[str, ...]:
    """The .png files of a folder, in the order of their names; a problem if there are none or too many."""
    reason, remedy, names = forbidden(given) or "", "name a folder below the recipe's folder", []
    if not reason and not stays_below(folder, path):
        reason = "leaves the recipe's folder through a symbolic link"
    if not reason:
        try:
            names = sorted(e.name for e in (folder / path).iterdir() if e.name.lower().endswith(".png"))
        except OSError as error:
            reason = f"cannot be read as a folder: {error.strerror}"
    if not reason and not 1 <= len(names) <= MAX_SEQUENCE:
        reason = f"has {count(len(names), 'PNG image')}"
        remedy = f"put 1 to {MAX_SEQUENCE} images into it, one for each frame"
    if reason:
        problems.append(Problem(f"{where}: {show(given)}: {reason}", place, remedy, Code.INVALID_ASSET))
        return ()
    return tuple(str(PurePosixPath(path) / name) for name in names)
