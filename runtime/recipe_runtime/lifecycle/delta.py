"""Delta datasets: the files of a dataset that an earlier one lacks, from which the earlier one becomes the other.

    delta.json        identities of both datasets; size and SHA-256 of the other's manifest; the size of each file
    files/<SHA-256>   the files

A file is identified by its content, so frames, labels and plans that both have are not stored, whatever their names.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Literal, TypedDict

from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core import layout
from recipe_runtime.core.documents import Meta, Sha256, decode_exactly
from recipe_runtime.core.files import (
    file_sha256,
    has_content,
    host_errors,
    is_folder,
    link_or_copy,
    plain_path,
    read_inside,
)
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import Index, Notice, StagedFolder, check_apart, check_place, ignore, is_free
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import listed_files
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.plan_checks import MAX_MANIFEST_BYTES
from recipe_runtime.dataset.reader import Dataset, read

INDEX = "delta.json"
_FORMAT = "recipe/delta/1"
_MAX_INDEX_BYTES = 128 << 20
_MAX_FILES = 600_000
_REMEDY = "free some space or choose another folder, then try again"


class Delta(TypedDict):
    """The content of `delta.json`."""

    format: Literal["recipe/delta/1"]
    before: Annotated[str, Meta(max_length=400)]  # identity of the earlier dataset
    after: Annotated[str, Meta(max_length=400)]  # identity of the other one
    manifest: Sha256  # the other one's `manifest.json`, one of the files
    files: Annotated[dict[Sha256, Annotated[int, Meta(ge=0, le=1 << 40)]], Meta(max_length=_MAX_FILES)]


def write_delta(
    before: Dataset, after: Dataset, out: Path, progress: Progress, *, replace: bool = False, notice: Notice = ignore
) -> Delta:
    """Write what `after` has and `before` lacks into a folder, which appears when it is complete.

    Args:
        before: The earlier dataset.
        after: The other one.
        out: The folder to create.
        progress: Called to report progress.
        replace: Whether another folder may be replaced.
        notice: Called with a line of text if a replaced folder is kept.

    Raises:
        InputError: `out` is in the way, or a file of `after` is damaged.
        RunError: the files cannot be written.
    """
    known = {sha256 for _, sha256 in before.files.values()}
    new: dict[str, str] = {}  # SHA-256 -> path in `after`
    for path, (_, sha256) in after.files.items():
        if sha256 not in known:
            new.setdefault(sha256, path)
    manifest = after.root / layout.MANIFEST
    digest = file_sha256(manifest)
    sizes = {sha256: after.files[path][0] for sha256, path in new.items()} | {digest: manifest.stat().st_size}
    delta: Delta = {
        "format": "recipe/delta/1",
        "before": before.lock.identity,
        "after": after.lock.identity,
        "manifest": digest,
        "files": dict(sorted(sizes.items())),
    }
    sources = {**new, digest: layout.MANIFEST}

    def fill(folder: Path) -> None:
        (folder / "files").mkdir()
        for number, (sha256, path) in enumerate(sources.items(), start=1):
            _put(after.root, path, sizes[sha256], sha256, folder / "files" / sha256)
            progress("files", number, len(sources))
        (folder / INDEX).write_bytes(pretty(delta).encode())

    _publish(out, after.root, Index(INDEX, _listed), fill, replace=replace, notice=notice)
    return delta


def is_delta(folder: Path) -> bool:
    """Return whether a folder holds a delta."""
    return is_folder(folder) and (folder / INDEX).is_file()


def read_delta(folder: Path) -> Delta:
    """Read `delta.json`.

    Raises:
        InputError: the folder holds no valid delta.
    """
    try:
        delta = decode_exactly(read_inside(folder, INDEX, _MAX_INDEX_BYTES), Delta)
        if delta["manifest"] not in delta["files"]:
            raise ValueError("it lacks the manifest")
    except (OSError, ValueError) as error:
        raise InputError(
            f"{folder} is not a delta dataset: {error}",
            help="name a folder that `recipe diff` wrote",
            code=Code.INVALID_DATASET,
        ) from None
    return delta


def apply_delta(
    before: Dataset, folder: Path, out: Path, progress: Progress, *, replace: bool = False, notice: Notice = ignore
) -> Dataset:
    """Make the other dataset from the earlier one and a delta; every file is compared with its SHA-256.

    Args:
        before: The earlier dataset. Files that both have are hard links to its files.
        folder: The folder of the delta.
        out: The folder to create; it appears when the dataset is complete.
        progress: Called to report progress.
        replace: Whether another folder may be replaced.
        notice: Called with a line of text if a replaced folder is kept.

    Returns:
        The other dataset.

    Raises:
        InputError: the delta is of another dataset, or a file of either is missing or damaged.
        RunError: the files cannot be written.
    """
    delta = read_delta(folder)
    if delta["before"] != before.lock.identity:
        raise InputError(
            f"{folder} is a delta to {delta['before']}, and {before.name} is {before.lock.identity}",
            help="name the dataset that it was made from",
            code=Code.INVALID_DATASET,
        )
    manifest = _manifest(folder, delta)
    held = {sha256: path for path, (_, sha256) in before.files.items()}
    rows = listed_files(manifest)

    def fill(target: Path) -> None:
        first: dict[str, Path] = {}  # the file of each content, to which its other names are linked
        for number, (path, (size, sha256)) in enumerate(rows.items(), start=1):
            place = target / path
            place.parent.mkdir(parents=True, exist_ok=True)
            if sha256 in first:
                link_or_copy(first[sha256], place)
            elif sha256 in delta["files"]:
                _put(folder, f"files/{sha256}", size, sha256, place)
            elif sha256 in held:
                _put(before.root, held[sha256], size, sha256, place)
            else:
                raise InputError(f"neither {before.name} nor {folder} has {path}", code=Code.INVALID_DATASET)
            first.setdefault(sha256, place)
            progress("files", number, len(rows))
        _put(folder, f"files/{delta['manifest']}", delta["files"][delta["manifest"]], delta["manifest"],
             target / layout.MANIFEST)  # fmt: skip
        made = read(target, str(out))
        if made.lock.identity != delta["after"] or not made.lock.sealed:
            raise InputError(f"{folder} does not contain the dataset that it names", code=Code.INVALID_DATASET)

    _publish(out, before.root, manifest_reader.FILES, fill, replace=replace, notice=notice)
    return read(out)


def _manifest(folder: Path, delta: Delta) -> Manifest:
    name = f"files/{delta['manifest']}"
    if not has_content(folder, name, delta["files"][delta["manifest"]], delta["manifest"]):
        raise InputError(f"{folder}/{name} is missing or damaged", code=Code.INVALID_DATASET)
    try:
        return manifest_reader.parse(io.BytesIO(read_inside(folder, name, MAX_MANIFEST_BYTES)))
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}/{name} is not a dataset's manifest: {error}", code=Code.INVALID_DATASET) from None


def _listed(folder: Path) -> Mapping[str, tuple[int, str]] | None:
    try:
        return {f"files/{sha256}": (size, sha256) for sha256, size in read_delta(folder)["files"].items()}
    except InputError:
        return None


def _put(root: Path, path: str, size: int, sha256: str, target: Path) -> None:
    if not has_content(root, path, size, sha256):
        raise InputError(f"{root}/{path} is missing or damaged", code=Code.INVALID_DATASET)
    link_or_copy(root / path, target)


def _publish(
    out: Path, source: Path, index: Index, fill: Callable[[Path], None], *, replace: bool, notice: Notice
) -> None:
    """Fill a folder and put it in its place by one rename."""
    out = plain_path(out)
    check_place(out)
    check_apart(out, source, "from which it is made")
    with host_errors(str(out), _REMEDY):
        staged = StagedFolder(out, index, owner=_FORMAT, replace=replace, notice=notice)
        staged.settle()
        if not replace and not is_free(out):
            raise InputError(
                f"{out} exists already", help="choose another folder, or replace it", code=Code.OUTPUT_IN_THE_WAY
            )
        with staged:
            try:
                fill(staged.files)
                staged.publish()
            except BaseException:
                staged.remove()
                raise
