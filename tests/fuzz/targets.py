"""Every loader that a stranger's bytes reach, as a function of bytes, with files to begin from.

A target returns, or raises the project's own error for such a file; anything else that comes out is a finding.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from recipe_compiler import assets, lockfile
from recipe_compiler.compile import compile_recipe
from recipe_compiler.errors import InputError
from recipe_runtime import dataset, layout, pack, traces
from recipe_runtime.build import build
from recipe_runtime.trace import Trace

from tests.runtime.fakes import ENGINES, dataset_plan, scene_plan, simulate
from tests.sources import ROOT

CASES = ROOT / "tests" / "cases" / "good"


@dataclass(frozen=True)
class Target:
    """What is fed, and what to feed it first."""

    feed: Callable[[bytes], None]
    seeds: Callable[[], Iterator[bytes]]


@cache
def _folder() -> Path:
    """A folder for one process's files, in memory where there is such a disk."""
    shared = Path("/dev/shm")
    held = tempfile.TemporaryDirectory(prefix="recipe-fuzz-", dir=shared if shared.is_dir() else None)
    _HELD.append(held)
    return Path(held.name)


_HELD: list[tempfile.TemporaryDirectory[str]] = []


def _file(name: str, content: bytes) -> Path:
    path = _folder() / name
    path.write_bytes(content)
    return path


def _recipe(content: bytes) -> None:
    with suppress(InputError):
        compile_recipe(_file("fed.yaml", content))


def _lockfile(content: bytes) -> None:
    with suppress(InputError):
        lockfile.read(_file("fed.lock", content))


def _pack(content: bytes) -> None:
    with suppress(InputError):
        pack.read(_file("fed.recipe", content))


def _trace(content: bytes) -> None:
    with suppress(ValueError):
        Trace.from_bytes(content + hashlib.sha256(content).digest())


def _traces(content: bytes) -> None:
    with suppress(InputError):
        traces.read(_file("fed.traces", content), {"a" * 64: "b" * 64})


def _plan(content: bytes) -> None:
    with suppress(InputError):
        dataset.plan_alone(_file("fed.json", content))


@cache
def _dataset() -> Path:
    made = build(dataset_plan(2, 1), _folder() / "made", workers=0, cache=_folder() / "cache", engines=ENGINES)
    return made.path


def _manifest(content: bytes) -> None:
    (_dataset() / layout.MANIFEST).write_bytes(content)
    with suppress(InputError):
        dataset.read(_dataset())


def _mesh(kind: str) -> Callable[[bytes], None]:
    def feed(content: bytes) -> None:
        with suppress(assets.AssetError):
            assets.mesh(content, kind, "y")

    return feed


def _image(content: bytes) -> None:
    with suppress(assets.AssetError):
        assets.image(content, "png")


def _found(*patterns: str) -> Callable[[], Iterator[bytes]]:
    def seeds() -> Iterator[bytes]:
        for pattern in patterns:
            for path in sorted(ROOT.glob(pattern)):
                yield path.read_bytes()

    return seeds


def _packs() -> Iterator[bytes]:
    yield pack.Pack("a.yaml", {"a.yaml": b"recipe: a\n", "lockfiles/a.lock": b"x"}).dumps()


def _trace_bytes() -> Iterator[bytes]:
    yield simulate(scene_plan(2)).to_bytes()[:-32]


def _traces_bytes() -> Iterator[bytes]:
    yield traces.dumps({"a" * 64: simulate(scene_plan(2))})


def _manifests() -> Iterator[bytes]:
    yield (_dataset() / layout.MANIFEST).read_bytes()


def _plans() -> Iterator[bytes]:
    yield dataset_plan(2, 1).variants[0].model_dump_json().encode()


TARGETS = {
    "recipe": Target(_recipe, _found("tests/cases/good/*/recipe.yaml", "tests/golden/*.yaml")),
    "lockfile": Target(_lockfile, _found("tests/golden/lockfiles/*.lock")),
    "pack": Target(_pack, _packs),
    "trace": Target(_trace, _trace_bytes),
    "traces": Target(_traces, _traces_bytes),
    "plan": Target(_plan, _plans),
    "manifest": Target(_manifest, _manifests),
    "obj": Target(_mesh("obj"), _found("tests/cases/*/*/**/*.obj")),
    "stl": Target(_mesh("stl"), _found("tests/cases/*/*/**/*.stl")),
    "glb": Target(_mesh("glb"), _found("tests/cases/*/*/**/*.glb")),
    "gltf": Target(_mesh("gltf"), _found("tests/cases/*/*/**/*.gltf")),
    "png": Target(_image, _found("tests/cases/*/*/**/*.png")),
}
