"""Traces beside a lockfile round-trip, and only those with a digest in the lockfile are used."""

from __future__ import annotations

import zlib
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.errors import InputError
from recipe_compiler.library import blueprints
from recipe_runtime.body.skeleton import part_names
from recipe_runtime.core.trace import Trace, TraceWriter
from recipe_runtime.verify import trace_bundle

from tests.runtime.fakes import dataset_plan, scene_plan, simulate

SCENES = [scene_plan(frames) for frames in (3, 5)]
TRACES = {scene.digest: simulate(scene) for scene in SCENES}
LOCKED = {scene: trace.digest for scene, trace in TRACES.items()}
LIMITS = dict.fromkeys(TRACES, 1 << 20)


def test_traces_round_trip(tmp_path: Path) -> None:
    path = trace_bundle.beside(tmp_path / "street.lock")
    assert path.name == "street.traces"
    assert trace_bundle.write(path, TRACES)
    assert not trace_bundle.write(path, TRACES)
    assert {s: t.digest for s, t in trace_bundle.read(path, LOCKED, LIMITS).items()} == LOCKED


def test_a_missing_file_has_no_traces(tmp_path: Path) -> None:
    assert trace_bundle.read(tmp_path / "street.traces", LOCKED, LIMITS) == {}


def test_a_trace_that_the_lockfile_does_not_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.traces").write_bytes(trace_bundle.dumps(TRACES))
    with pytest.raises(InputError, match=r"not the lockfile's; lock the recipe again, with traces"):
        trace_bundle.read(tmp_path / "a.traces", {**LOCKED, SCENES[0].digest: "0" * 64}, LIMITS)


def test_a_trace_under_the_digest_of_another_is_refused(tmp_path: Path) -> None:
    forged: dict[str, Trace] = {}
    for scene, trace in TRACES.items():
        forged[scene] = replace(trace, positions=trace.positions + 1)
    body = trace_bundle.dumps(forged)
    for scene, trace in forged.items():
        body = body.replace(trace.digest.encode(), LOCKED[scene].encode())
    (tmp_path / "a.traces").write_bytes(body)
    with pytest.raises(InputError, match="is not what its digest says"):
        trace_bundle.read(tmp_path / "a.traces", LOCKED, LIMITS)


def test_a_decompression_bomb_is_not_unpacked(tmp_path: Path) -> None:
    packed = zlib.compress(b"\0" * (1 << 24), 9)
    scene = SCENES[0].digest
    for reported in (1000, 1 << 40, -1):
        head = f"{scene} {LOCKED[scene]} {len(packed)} {reported}\n".encode()
        (tmp_path / "a.traces").write_bytes(b"recipe-traces 1\n" + head + packed)
        with pytest.raises(InputError, match=r"the stated size|a Trace cannot have|more motion than"):
            trace_bundle.read(tmp_path / "a.traces", LOCKED, LIMITS)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, len(trace_bundle.dumps(TRACES)) - 1), value=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_file_gives_the_locked_motion_or_is_refused(tmp_path: Path, at: int, value: int, cut: bool) -> None:
    body = bytearray(trace_bundle.dumps(TRACES))
    body[at] = value
    path = tmp_path / "a.traces"
    path.write_bytes(body[:at] if cut else body)
    try:
        found = trace_bundle.read(path, LOCKED, LIMITS)
    except InputError:
        return
    assert all(LOCKED[scene] == trace.digest for scene, trace in found.items())


def test_traces_of_scenes_that_the_recipe_no_longer_has_are_skipped(tmp_path: Path) -> None:
    """Regression: `recipe verify` of a recipe that was changed after `lock --with-traces` reported a damaged file of
    traces instead of the change."""
    path, first = tmp_path / "a.traces", SCENES[0].digest
    path.write_bytes(trace_bundle.dumps(TRACES))
    assert trace_bundle.read(path, LOCKED, {}) == {}
    assert trace_bundle.read(path, LOCKED, {first: LIMITS[first]}).keys() == {first}


def test_a_scene_has_one_trace_of_bounded_size(tmp_path: Path) -> None:
    """Regression: 40 rows of one scene, each unpacked to 256 MiB, filled the disk."""
    path, one = tmp_path / "a.traces", {SCENES[0].digest: TRACES[SCENES[0].digest]}
    body = trace_bundle.dumps(one)
    head = b"recipe-traces 1\n"
    path.write_bytes(body + body.removeprefix(head))
    with pytest.raises(InputError, match="twice, or more motion"):
        trace_bundle.read(path, LOCKED, LIMITS)
    path.write_bytes(body)
    with pytest.raises(InputError, match="twice, or more motion"):
        trace_bundle.read(path, LOCKED, {SCENES[0].digest: 100})
    path.write_bytes(body + body.removeprefix(head))
    with pytest.raises(InputError, match="twice, or more motion"):
        trace_bundle.read(path, LOCKED, {})
    plan = dataset_plan(frames=3)
    limits = trace_bundle.size_limits(plan)
    assert limits.keys() == {variant.scene.digest for variant in plan.variants}
    assert all(len(simulate(v.scene).to_bytes()) < limits[v.scene.digest] < 2 << 20 for v in plan.variants)


def test_the_limit_of_a_trace_has_room_for_the_parts_of_each_actor() -> None:
    """The limit is close: from a file of traces, several times the motion of a scene would be unpacked to the disk."""
    for blueprint in blueprints.match("*"):
        actor = blueprints.specimen(blueprint)[0]
        parts = part_names(actor.shape)
        with closing(TraceWriter([actor.name], parts, 1)) as writer:
            size = writer.frame_size
        assert size < trace_bundle._MAX_POSE <= 1024, blueprint
