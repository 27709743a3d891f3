"""Untrusted plans, manifests and lockfiles with any change are either accepted or refused with an InputError.

`make fuzz` searches further, with a memory limit of 1 GiB and 60 s a case.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenarioPlan, TownPlan
from recipe_compiler.library import towns
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.plan_checks import MAX_MANIFEST_BYTES
from recipe_runtime.dataset.plan_reader import PlanReader
from recipe_runtime.verify.verify import Options, verify_files

from tests.runtime import fakes
from tests.sources import ROOT

PLAN = fakes.dataset_plan(frames=2, weathers=1)
GOLDEN = ROOT / "tests" / "golden" / "lockfiles"
JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from([-1, 0, 2**31, 2**64, 10**400, 1e9, 1e308, -1e308, float("inf"), float("nan"), -0.0]),
    st.sampled_from(["", ".", "..", "/etc/passwd", "a" * 5000, "\x1b[2J", "\ud800", "0" * 64, "street", "2001"]),
    st.text(max_size=8),
    st.lists(st.integers(), max_size=3),
    st.dictionaries(st.text(max_size=4), st.integers(), max_size=3),
    st.just([[]] * 200),
    st.just({str(n): {} for n in range(200)}),
)


def mutated(document: Any, data: st.DataObject) -> Any:
    """Return the document with one value anywhere replaced, removed, added or repeated."""
    document = json.loads(json.dumps(document))
    here: Any = document
    parent: Any = None  # the list or object that contains it
    key: Any = None
    while isinstance(here, dict | list) and here and (parent is None or data.draw(st.integers(0, 7))):
        parent, keys = here, sorted(here) if isinstance(here, dict) else list(range(len(here)))
        key = data.draw(st.sampled_from(keys))
        here = parent[key]
    assert parent is not None
    how = data.draw(st.sampled_from(["replace", "replace", "remove", "add"]))
    if how == "remove":
        del parent[key]
    elif how == "add" and isinstance(parent, dict):
        parent[data.draw(st.sampled_from(["x", "frames", "sha256", "", "a" * 300]) | st.text(max_size=5))] = here
    elif how == "add":
        parent.insert(0, here)
    else:
        parent[key] = data.draw(JUNK)
    return document


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    return build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES)).path


def with_town() -> dict[str, Any]:
    """Return a valid plan with every kind of element of a small town."""
    document: dict[str, Any] = json.loads(_with_town())
    return document


@cache
def _with_town() -> str:
    plan = PLAN.variants[0]
    elements = towns.build("downtown", 1, {"blocks": (1, 1)}).plan.elements
    one_of_each = {element.kind: element for element in elements}
    town = TownPlan(name="downtown", elements=tuple(one_of_each.values()))
    scene = plan.scene.model_copy(update={"town": town})
    return ScenarioPlan(variant="a", scene=scene, rig=plan.rig, appearance=plan.appearance).model_dump_json()


def accepted(read: Callable[[], object]) -> bool:
    """Return whether a document is accepted; any error but an InputError of one printable line fails the test."""
    try:
        read()
    except InputError as error:
        assert len(str(error).splitlines()) == 1
        assert len(str(error)) < 2000
        return False
    return True


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_changed_plan_is_refused_or_accepted(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    path = tmp_path_factory.getbasetemp() / "plan.json"
    path.write_text(json.dumps(mutated(with_town(), data)))
    accepted(lambda: datasets.plan_alone(path).digest)


@pytest.mark.slow
@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data(), st.booleans())
def test_a_changed_dataset_is_refused_or_accepted(built: Path, data: st.DataObject, of_plan: bool) -> None:
    """The files of an accepted dataset are compared, which reports differences without raising."""
    path = built / ("plans/weather=w0,jitter=still.json" if of_plan else "manifest.json")
    before = path.read_bytes()
    try:
        path.write_text(json.dumps(mutated(json.loads(before), data)))
        found: list[datasets.Dataset] = []
        if accepted(lambda: found.append(datasets.read(built))):
            verify_files(found[0], Options(nonce=1), lambda *_: None).document()
            datasets.text_differences(found[0], {})
    finally:
        path.write_bytes(before)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_changed_lockfile_is_refused_or_accepted(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    lines = sorted(GOLDEN.glob("*.lock"))[0].read_bytes().splitlines(keepends=True)
    at = data.draw(st.integers(0, len(lines) - 1))
    cells = lines[at].rstrip(b"\n").split(b" ")
    which = data.draw(st.integers(0, len(cells) - 1))
    junk = st.sampled_from([b"", b"-", b"%00", b"%", b"\xff", b"9" * 5000, b"a" * 20_000, b"0" * 64, b"\r", b"x y"])
    cells[which] = data.draw(junk | st.binary(max_size=9) | st.text(max_size=9).map(str.encode))
    lines[at] = b" ".join(cells) + b"\n"
    lines = lines[: at + 1] + lines[at:] if data.draw(st.booleans()) else lines  # and perhaps twice
    path = tmp_path_factory.getbasetemp() / "changed.lock"
    path.write_bytes(b"".join(lines))
    found: list[lockfile.Lockfile] = []
    if accepted(lambda: found.append(lockfile.read(path))) and found[0].sealed:
        assert found[0].dumps().encode() == path.read_bytes()


def scene_with(**changes: Any) -> dict[str, Any]:
    document = with_town()
    document["scene"]["town"]["elements"][0].update(changes)
    return document


def repeated(kind: str, number: int) -> dict[str, Any]:
    document = with_town()
    elements = document["scene"]["town"]["elements"]
    (one,) = (element for element in elements if element["kind"] == kind)
    elements += [{**one, "name": f"more.{n}"} for n in range(number)]
    return document


def posed(number: int) -> dict[str, Any]:
    document = with_town()
    document["rig"]["sensors"][0]["poses"] *= number
    document["scene"]["clock"]["frames"] = min(number, 1_000_000)
    return document


HOSTILE: dict[str, tuple[Callable[[], dict[str, Any]], str]] = {
    "a huge tree": (lambda: shaped("tree", trunk=1e9), "its trunk is 1e+09"),
    "many floors": (lambda: shaped("building", floors=1e9), "its floors is 1e+09"),
    "a tower of kilometres": (lambda: scene_with(size=[1e5, 1e5, 1e5]), "its size along x is 100000 m"),
    "an unknown kind": (lambda: scene_with(kind="castle"), "there is no kind of element 'castle'"),
    "20,000 lamps": (lambda: repeated("lamp", 20_000), "elements"),
    "2,000 lamps": (lambda: repeated("lamp", 2_000), "at most 1,500 are allowed"),
    "a million poses": (lambda: posed(400_000), "more than 300,000 poses of sensors"),
    "a huge actor": (lambda: actor(shape={"height": 1e9}), "its shape lacks"),
    "an unknown actor": (lambda: actor(blueprint="vehicle.tank"), "there is no blueprint 'vehicle.tank'"),
    "a fog of ages": (lambda: weather(fog_density=1e9), "weather.fog_density"),
}


def shaped(kind: str, **shape: float) -> dict[str, Any]:
    document = with_town()
    (one,) = (element for element in document["scene"]["town"]["elements"] if element["kind"] == kind)
    one["shape"] |= shape
    return document


def actor(**changes: Any) -> dict[str, Any]:
    document = with_town()
    document["scene"]["actors"][0] |= changes
    return document


def weather(**changes: float) -> dict[str, Any]:
    document = with_town()
    document["appearance"]["weather"] |= changes
    return document


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_a_plan_over_a_limit_is_refused(tmp_path: Path, name: str) -> None:
    make, says = HOSTILE[name]
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(make()))
    with pytest.raises(InputError) as caught:
        datasets.plan_alone(path)
    assert says in str(caught.value)


def test_parts_that_variants_share_are_read_once() -> None:
    reader, document = PlanReader(), with_town()
    first = reader.read(json.dumps(document).encode())
    second = reader.read(json.dumps({**document, "variant": "b"}).encode())
    assert first.scene is second.scene
    assert first.rig is second.rig
    assert first.appearance is second.appearance
    document["scene"]["clock"]["frames"] = 1
    assert reader.read(json.dumps(document).encode()).scene.town is first.scene.town


def _with_many_files(manifest: Any) -> None:
    manifest["files"] |= {f"more/{n}": {"size": 1, "sha256": "0" * 64} for n in range(12_000)}


def _with_many_bytes(manifest: Any) -> None:
    manifest["pictures"]["preview/contact_sheet.png"]["size"] = 1 << 40


EXCESSES = [
    (_with_many_files, r"it lists 12,\d{3} files, and its plan requires"),
    (_with_many_bytes, r"it lists 1,099,\d{3},\d{3},\d{3} bytes of files"),
]


@pytest.mark.parametrize(("change", "words"), EXCESSES, ids=["files", "bytes"])
def test_a_manifest_with_far_more_than_its_plan_needs_is_refused(
    built: Path, change: Callable[[Any], None], words: str
) -> None:
    """Every row is read and every byte is hashed: a sparse file of 1 TiB takes minutes, and some KB of an archive."""
    path = built / "manifest.json"
    before = path.read_bytes()
    manifest = json.loads(before)
    change(manifest)
    try:
        path.write_text(json.dumps(manifest))
        with pytest.raises(InputError, match=words):
            datasets.read(built)
    finally:
        path.write_bytes(before)


_READ = """
import sys
from pathlib import Path
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_runtime.dataset import manifest_reader, reader
def peak():  # ru_maxrss would start at that of the process that forked this one
    return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
before = peak()
try:
    kind, path = sys.argv[1], Path(sys.argv[2])
    {"lockfile": lockfile.read, "manifest": manifest_reader.read, "plan": reader.plan_alone}[kind](path)
    said = "accepted"
except (InputError, ValueError) as error:
    said = str(error)[-200:]
print(peak() - before, said)
"""


def frame_rows(number: int) -> str:
    return "".join(f"frame {'a' * 16} street rgb {n:06d} {n:064x}\n" for n in range(number))


HEAD = f"recipe-lock 1\nrecipe x x.yaml {'0' * 64}\n"
BODY = f"body {{n:064x}} 1 hero {'0' * 64} {','.join(['01234567'] * 64)}\n"
MANIFEST = '{"format": "recipe/manifest/1", '


def sensors(number: int) -> str:
    return MANIFEST + '"variants": {"a": {"frames": {' + ", ".join(f'"{n:x}": {{}}' for n in range(number)) + "}}}}"


def files(number: int) -> str:
    return MANIFEST + '"files": {' + '"a": {}, ' * number + '"a": {}}}'


LARGE: dict[str, tuple[str, Callable[[], str], str]] = {
    "a long line": ("lockfile", lambda: HEAD + "tool " + "a" * 100_000_000, "the line is longer than 16,384 bytes"),
    "poses": (
        "plan",
        lambda: json.dumps(posed(600_000), separators=(",", ":")),
        "more than 300,000 poses of sensors",
    ),
    "brackets": ("plan", lambda: "[" * (1 << 26), "Expected `object`, got `array`"),
    "nested keys": ("plan", lambda: '{"a":' * 10_000_000, "unknown field `a`"),
    "empty poses": (
        "plan",
        lambda: '{"rig": {"sensors": [{"poses": [' + "{}," * 20_000_000,
        "missing required field `x`",
    ),
    "sensors": ("manifest", lambda: sensors(3_000_000), "Expected `object` of length >= 1"),
    "files": ("manifest", lambda: files(10_000_000), "missing required field `size`"),
    "short names": (
        "manifest",
        lambda: MANIFEST + '"outputs": {"annotations": [' + '"a",' * 20_000_000 + '"a"]}}',
        "lists of more than 8,388,608 bytes",
    ),
    "nested lists": ("manifest", lambda: MANIFEST + '"files": ' + "[" * (1 << 26), "does not say that it is"),
    "a large manifest": ("manifest", lambda: " " * (MAX_MANIFEST_BYTES + 1), "at most 201,326,592 are read"),
}


LONG: dict[str, tuple[str, Callable[[], str], str]] = {
    "frames": ("lockfile", lambda: HEAD + frame_rows(600_001), "there are more than 600,000 frame rows"),
    "bodies": ("lockfile", lambda: HEAD + "".join(BODY.format(n=n) for n in range(110_000)), "more than 100,000 body"),
    "names": (
        "lockfile",
        lambda: HEAD + "".join(f"frame {'a' * 16} %F0%9F{n:099} rgb 000000 {n:064x}\n" for n in range(500_000)),
        "",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LARGE, *(pytest.param(name, marks=pytest.mark.reliability) for name in LONG)])
def test_no_document_takes_a_gigabyte_or_a_minute(tmp_path: Path, name: str) -> None:
    kind, make, says = {**LARGE, **LONG}[name]
    path = tmp_path / ("manifest.json" if kind == "manifest" else "document")
    path.write_text(make())
    command = [sys.executable, "-c", _READ, kind, str(tmp_path if kind == "manifest" else path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    kilobytes, said = done.stdout.strip().split(" ", 1)
    assert says in said
    assert int(kilobytes) < 1 << 20
