"""Every loader of untrusted bytes, as a function of bytes, with seed files.

A target returns or raises the project's own error; any other exception is a finding.
"""

from __future__ import annotations

import hashlib
import io
import json
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from recipe_compiler import carla
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import assets, lockfile
from recipe_compiler.ir.assets.png import SIGNATURE
from recipe_compiler.ir.canonical import canonical_bytes, digest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.lockfile import VariantRow
from recipe_compiler.ir.plan import TownPlan
from recipe_compiler.library import towns
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset import reader
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.transfer import bundle
from recipe_runtime.transfer.formats import kitti
from recipe_runtime.transfer.formats.sequence import ExportSequence
from recipe_runtime.verify import trace_bundle
from recipe_runtime.verify.compare import Side, compare_datasets, compare_locks
from recipe_runtime.verify.diff import differences
from recipe_runtime.verify.motion_comparison import body_differences, motion_difference
from recipe_runtime.verify.verify import Options, verify_files
from recipe_runtime.verify.version_comparison import version_notes

from tests.runtime.fakes import ENGINES, dataset_plan, scene_plan, simulate
from tests.sources import ROOT

CASES = ROOT / "tests" / "cases" / "good"


@dataclass(frozen=True)
class Target:
    """A function to fuzz and its seeds; for `json`, the dictionary has JSON's tokens and the keys of the seeds."""

    feed: Callable[[bytes], None]
    seeds: Callable[[], Iterator[bytes]]
    json: bool = False

    def words(self) -> list[bytes]:
        """Return the entries of the fuzzer's dictionary, which is empty except for JSON."""
        if not self.json:
            return []
        keys = {key for seed in self.seeds() for key in _keys(seed)}
        return [*_JSON, *(json.dumps(key).encode() + b":" for key in sorted(keys) if len(key) < 60)]


_JSON = [
    *(b"{ } [ ] , : [] {} [[ ]] true false null NaN Infinity -Infinity".split()),
    *(b"0 -1 1.5 1e-7 1e308 1e999 -0 0.0 4096 65536 2147483648 9007199254740993 9223372036854775808".split()),
    *(b'"" "." ".." "/" "../a" "a/b" "\\u0000" "\\u001b[2J" "\\ud800" "\\u2028"'.split()),
    b"[" * 2000,
    b'{"a":' * 2000,
    b"9" * 5000,
]


def _keys(seed: bytes) -> Iterator[str]:
    """Return every key of the JSON in a seed, which may have other bytes before and after it."""
    start, waiting = seed.find(b"{"), list[Any]()
    with suppress(ValueError):
        waiting = [json.JSONDecoder().raw_decode(seed[start:].decode("latin-1"))[0]]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            yield from value
        waiting += value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


@cache
def _folder() -> Path:
    """Return a folder for the files of this process, in memory if possible."""
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


def _carla(content: bytes) -> None:
    with suppress(InputError):
        carla.import_configurations([carla.File("fed.yaml", content)])


def _lockfile(content: bytes) -> None:
    with suppress(InputError):
        lockfile.read(_file("fed.lock", content))


def _pack(content: bytes) -> None:
    with suppress(InputError):
        bundle.read(_file("fed.recipe", content))


def _trace(content: bytes) -> None:
    with suppress(ValueError):
        Trace.from_bytes(content + hashlib.sha256(content).digest())


def _traces(content: bytes) -> None:
    with suppress(InputError):
        trace_bundle.read(_file("fed.traces", content), {"a" * 64: "b" * 64}, {"a" * 64: 1 << 24})


def _plan(content: bytes) -> None:
    with suppress(InputError):
        reader.plan_alone(_file("fed.json", content))


@cache
def _dataset() -> Path:
    made = build(
        dataset_plan(2, 1), _folder() / "made", BuildOptions(workers=0, cache=_folder() / "cache", engines=ENGINES)
    )
    return made.path


def _manifest(content: bytes) -> None:
    """Read a manifest beside valid files; if it is accepted, run every comparison that needs no rendering."""
    (_dataset() / layout.MANIFEST).write_bytes(content)
    with suppress(InputError):
        _compared(reader.read(_dataset()))


def _compared(held: reader.Dataset) -> None:
    verify_files(held, Options(nonce=1), lambda *_: None).document()
    reader.text_differences(held, {})
    compare_datasets(held.plan, _locked(), held.lock, held.name)
    side = Side(held.name, held.lock, held.plan, {path: row[1] for path, row in held.files.items()})
    differences(side, Side("honest", _locked(), dataset_plan(2, 1)))


@cache
def _locked() -> lockfile.Lockfile:
    return reader.read(_planned()).lock


@cache
def _planned() -> Path:
    """Return a dataset whose first variant's plan is replaced by the input."""
    made = build(
        dataset_plan(2, 1), _folder() / "planned", BuildOptions(workers=0, cache=_folder() / "cache", engines=ENGINES)
    )
    reader.read(made.path)
    return made.path


def _dataset_plan(content: bytes) -> None:
    """Read a plan in a dataset with a valid manifest."""
    _locked()
    name = dataset_plan(2, 1).variants[0].variant
    (_planned() / layout.plan_file(name)).write_bytes(content)
    with suppress(InputError):
        _compared(reader.read(_planned()))


def _town_plan(content: bytes) -> None:
    """Read a plan whose town has every kind of element; if it is accepted, build the meshes."""
    try:
        plan = reader.plan_alone(_file("fed-town.json", content))
    except InputError:
        return
    scene = plan.variants[0].scene
    elements = scene.town.elements[:100]
    town_bodies(scene.town.model_copy(update={"elements": elements}))
    for actor in scene.actors[:20]:
        actor_body(actor)


def _verified(content: bytes) -> None:
    """Compare a lockfile with a plan, its motion and a valid lockfile."""
    with suppress(InputError):
        lock = lockfile.read(_file("fed.lock", content))
        plan = dataset_plan(2, 1)
        compare_locks(plan, lock, _locked())
        assert all(note.isprintable() for note in version_notes(lock))
        scene = plan.variants[0].scene
        body_differences(plan, lock, simulate)
        motion_difference(lock, scene, simulate(scene))
        differences(Side("fed", lock, None), Side("honest", _locked(), None))


@cache
def _labelled() -> reader.Dataset:
    """Return a dataset whose labels of the first variant and sensor are replaced by the input."""
    made = build(
        dataset_plan(1, 1), _folder() / "labelled", BuildOptions(workers=0, cache=_folder() / "cache", engines=ENGINES)
    )
    return reader.read(made.path)


def _labels(content: bytes) -> None:
    """Read label records with a matching digest in the manifest, which a forger can compute."""
    held = _labelled()
    variant, path = held.plan.variants[0], _labels_file()
    try:
        records = json.loads(content)
        value, line = digest("labels/2", records), canonical_bytes(records) + b"\n"
    except (ValueError, TypeError, RecursionError):
        line, value = content, "0" * 64
    path.write_bytes(line)
    row = VariantRow(variant.scene.digest, variant.rig.digest, variant.appearance.digest)
    key = row.frame_key("labels"), variant.rig.sensors[0].name, "labels", 0
    vouched = replace(held, lock=replace(held.lock, frames={**held.lock.frames, key: value}))
    reader.text_differences(vouched, {})
    sequence = ExportSequence(vouched, variant, variant.rig.sensors[0], 0)
    for lines in (kitti.label_lines, kitti.pose_lines):
        with suppress(InputError):
            "".join(lines(sequence.labels()))


def _labels_file() -> Path:
    variant = _labelled().plan.variants[0]
    return _labelled().root / layout.labels_file(variant.variant, variant.rig.sensors[0].name)


def _mesh(kind: str) -> Callable[[bytes], None]:
    def feed(content: bytes) -> None:
        with suppress(assets.AssetError):
            assets.mesh(content, kind, "y")

    return feed


def _image(content: bytes) -> None:
    for whole in (content, _checked(content)):
        with suppress(assets.AssetError):
            assets.image(whole, "png")


def _checked(content: bytes) -> bytes:
    """Return the chunks of a PNG with valid checksums, so that a decoder reads their content."""
    pieces, at = [content[:8]], 8
    while at + 12 <= len(content):
        (length,) = struct.unpack(">I", content[at : at + 4])
        body = content[at + 4 : at + 8 + length]
        pieces += [content[at : at + 4], body, struct.pack(">I", zlib.crc32(body))]
        at += 12 + length
    return b"".join(pieces)


def _rows(content: bytes) -> None:
    """Return a PNG from the 13 bytes of its header, a palette, transparency, and rows, which are compressed here."""
    head, sizes, rest = content[:13], content[13:15], content[15:]
    if len(sizes) == 2:
        palette, clear = rest[: sizes[0]], rest[sizes[0] : sizes[0] + sizes[1]]
        chunks = [(b"IHDR", head)] + [(kind, body) for kind, body in ((b"PLTE", palette), (b"tRNS", clear)) if body]
        chunks += [(b"IDAT", zlib.compress(rest[sum(sizes) :], 1)), (b"IEND", b"")]
        _image(SIGNATURE + b"".join(struct.pack(">I", len(body)) + kind + body + b"CRC." for kind, body in chunks))


def _found(*patterns: str) -> Callable[[], Iterator[bytes]]:
    def seeds() -> Iterator[bytes]:
        for pattern in patterns:
            for path in sorted(ROOT.glob(pattern)):
                yield path.read_bytes()

    return seeds


def _pictures() -> Iterator[bytes]:
    """Return a small PNG of every kind that Pillow writes, and those of the tests."""
    from PIL import Image

    yield from _found("tests/cases/*/*/**/*.png")()
    for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"):
        out = io.BytesIO()
        clear = {"transparency": b"\0\x80"} if mode == "P" else {"transparency": 3} if mode == "L" else {}
        Image.new("P" if mode == "P" else mode, (5, 3)).save(out, "PNG", **clear)
        yield out.getvalue()


def _picture_rows() -> Iterator[bytes]:
    """Return a header, a palette and rows of every bit depth, colour type and interlacing of PNG."""
    for colour, depths in {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}.items():
        for depth in depths:
            for interlaced in (0, 1):
                head = struct.pack(">IIBBBBB", 3, 2, depth, colour, 0, 0, interlaced)
                sizes = b"\x06\x02" if colour == 3 else b"\0\0"
                yield head + sizes + bytes(sum(sizes) + 60)


def _packs() -> Iterator[bytes]:
    yield bundle.Pack("a.yaml", {"a.yaml": b"recipe: a\n", "lockfiles/a.lock": b"x"}).dumps()


def _trace_bytes() -> Iterator[bytes]:
    yield simulate(scene_plan(2)).to_bytes()[:-32]


def _traces_bytes() -> Iterator[bytes]:
    yield trace_bundle.dumps({"a" * 64: simulate(scene_plan(2))})


def _manifests() -> Iterator[bytes]:
    yield (_dataset() / layout.MANIFEST).read_bytes()


def _lines() -> Iterator[bytes]:
    yield canonical_bytes(json.loads(_labels_file().read_bytes().splitlines()[0]))


def _plans() -> Iterator[bytes]:
    yield dataset_plan(2, 1).variants[0].model_dump_json().encode()


def _town_plans() -> Iterator[bytes]:
    plan = dataset_plan(1, 1).variants[0]
    for name in towns.NAMES:
        kinds = {element.kind: element for element in towns.build(name, 1, {}).plan.elements}
        town = TownPlan(name=name, elements=tuple(kinds.values()))
        scene = plan.scene.model_copy(update={"town": town})
        yield plan.model_copy(update={"scene": scene}).model_dump_json().encode()


def _locks() -> Iterator[bytes]:
    yield _locked().dumps().encode()
    yield from _found("tests/golden/lockfiles/*.lock")()


TARGETS = {
    "recipe": Target(_recipe, _found("tests/cases/good/*/recipe.yaml", "tests/golden/*.yaml")),
    "carla": Target(_carla, _found("tests/compiler/carla/configs/**/*.yaml")),
    "lockfile": Target(_lockfile, _found("tests/golden/lockfiles/*.lock")),
    "verified": Target(_verified, _locks),
    "pack": Target(_pack, _packs),
    "trace": Target(_trace, _trace_bytes, json=True),
    "traces": Target(_traces, _traces_bytes),
    "plan": Target(_plan, _plans, json=True),
    "town": Target(_town_plan, _town_plans, json=True),
    "dataset": Target(_dataset_plan, _plans, json=True),
    "manifest": Target(_manifest, _manifests, json=True),
    "labels": Target(_labels, _lines, json=True),
    "obj": Target(_mesh("obj"), _found("tests/cases/*/*/**/*.obj")),
    "stl": Target(_mesh("stl"), _found("tests/cases/*/*/**/*.stl")),
    "glb": Target(_mesh("glb"), _found("tests/cases/*/*/**/*.glb"), json=True),
    "gltf": Target(_mesh("gltf"), _found("tests/cases/*/*/**/*.gltf"), json=True),
    "png": Target(_image, _pictures),
    "rows": Target(_rows, _picture_rows),
}
