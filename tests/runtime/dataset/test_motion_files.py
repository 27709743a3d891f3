"""`tracks.csv` and `events.csv` follow from Trace, plan and labels, and a reused Trace has its contacts."""

from __future__ import annotations

import csv
import math
import pickle
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir.plan import Element, Pose, ScenePlan
from recipe_runtime.annotate.actor_boxes import body_box
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import METRE, UNIT, ContactEvent, Trace
from recipe_runtime.dataset.events import distinct_events
from recipe_runtime.dataset.tracks import tracks_csv

from tests.runtime.fakes import ENGINES, dataset_plan, scene_plan, simulate

Rows = list[dict[str, str]]


def rows(pieces: Iterable[bytes]) -> Rows:
    return list(csv.DictReader(b"".join(pieces).decode().splitlines()))


def leaning(frames: int, roll_rate: float, pitch_rate: float, fps: int) -> Trace:
    """Return a Trace of actors that look along +y and roll and pitch at constant rates, in degrees per second."""
    scene = scene_plan(frames)
    trace = simulate(scene)
    rotations = np.zeros((frames, 3, 4), np.int32)
    for frame in range(frames):
        roll, pitch, yaw = (math.radians(v) / 2 for v in (roll_rate * frame / fps, pitch_rate * frame / fps, 90.0))
        cr, sr, cp, sp, cy, sy = (f(v) for v in (roll, pitch, yaw) for f in (math.cos, math.sin))
        quaternion = (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
        rotations[frame] = np.round(np.array(quaternion) * UNIT).astype(np.int32)
    return replace(trace, rotations=rotations)


@pytest.mark.slow
@given(st.floats(-80, 80), st.floats(-80, 80))
def test_lean_and_its_rates(roll_rate: float, pitch_rate: float) -> None:
    """The file has the roll, the pitch and their rates, up to 40 degrees in half a second."""
    found = rows(tracks_csv(scene_plan(6), leaning(6, roll_rate, pitch_rate, 10)))
    for row in found:
        time = float(row["time"])
        assert float(row["roll"]) == pytest.approx(roll_rate * time, abs=1e-3)
        assert float(row["pitch"]) == pytest.approx(pitch_rate * time, abs=1e-3)
        assert float(row["yaw"]) == pytest.approx(90.0, abs=1e-3)
        assert float(row["roll_rate"]) == pytest.approx(roll_rate, abs=1e-3)
        assert float(row["pitch_rate"]) == pytest.approx(pitch_rate, abs=1e-3)


def test_the_jump_of_an_entering_actor_does_not_affect_its_rates() -> None:
    scene, trace = scene_plan(4), leaning(4, 20.0, 0.0, 10)
    positions = trace.positions.copy()
    positions[:2, 0, 2] = -1000 * METRE
    rotations = trace.rotations.copy()
    rotations[:2, 0] = (0, 0, 0, UNIT)
    found = rows(tracks_csv(scene, replace(trace, positions=positions, rotations=rotations)))
    mine = [row for row in found if row["actor"] == "hero1"]
    assert [row["present"] for row in mine] == ["0", "0", "1", "1"]
    assert [round(float(row["roll_rate"]), 2) for row in mine] == [0.0, 0.0, 20.0, 20.0]


def test_boxes_have_the_size_of_the_blueprint_and_stand_on_the_ground() -> None:
    scene = scene_plan(2)
    for row in rows(tracks_csv(scene, simulate(scene))):
        (actor,) = (a for a in scene.actors if a.name == row["actor"])
        box = body_box(actor)
        assert [float(row[key]) for key in ("length", "width", "height")] == pytest.approx(box.high - box.low, abs=1e-6)
        assert float(row["box_z"]) - float(row["height"]) / 2 == pytest.approx(float(row["z"]), abs=1e-6)


def town_with_a_light(scene: ScenePlan) -> ScenePlan:
    shape = {"cycle": 20.0, "green_from": 0.35, "green": 0.3, "amber": 0.2}
    light = Element(name="light, north", kind="traffic_light", pose=Pose(), size=(1, 1, 1), shape=shape)
    return scene.model_copy(update={"town": scene.town.model_copy(update={"elements": (light,)})})


def test_events_of_trace_plan_and_labels() -> None:
    scene = town_with_a_light(scene_plan(12))
    contacts = (
        ContactEvent("van", "hero2", -30, -5, 3.0),  # ended before frame 0
        ContactEvent("van", "hero1", -2, 30, 4.5),
        ContactEvent("hero1", "hero2", 49, 400, 0.25),
    )
    trace = replace(simulate(scene), contacts=contacts)
    positions = trace.positions.copy()
    positions[4:7, 2, 2] = -1000 * METRE
    ((names, pieces),) = distinct_events(scene, replace(trace, positions=positions), {"noon": [], "dusk": []})
    assert names == ["noon", "dusk"]
    found = rows(pieces)
    reported = {kind: [row for row in found if row["event"] == kind] for kind in {row["event"] for row in found}}
    assert sorted(reported) == ["collision", "light", "presence", "walk_light"]
    assert [list(row.values())[1:] for row in reported["collision"]] == [
        ["0", "1", "0.000000", "0.125000", "", "van", "hero1", "4.500"],
        ["2", "11", "0.204167", "1.666667", "", "hero1", "hero2", "0.250"],
    ]
    assert [(row["frame"], row["end_frame"]) for row in reported["presence"] if row["subject"] == "van"] == [
        ("0", "3"),
        ("7", "11"),
    ]
    assert [(row["frame"], row["end_frame"], row["value"]) for row in reported["light"]] == [
        ("0", "3", "red"),
        ("4", "6", "green"),
        ("7", "8", "amber"),
        ("9", "11", "red"),
    ]
    assert {row["subject"] for row in reported["light"]} == {"light, north"}
    assert [int(row["frame"]) for row in found] == sorted(int(row["frame"]) for row in found)


@pytest.mark.slow
def test_tracks_begin_and_end_with_the_labels(tmp_path: Path) -> None:
    made = build(
        dataset_plan(), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)
    ).path
    folder = made / "weather=w0,jitter=still"
    with (folder / "events.csv").open(newline="") as file:
        tracks = [row for row in csv.DictReader(file) if row["event"] == "track"]
    assert tracks
    for sensor in ("street", "side"):
        lines = (folder / sensor / "labels.jsonl").read_text().splitlines()
        for row in (row for row in tracks if row["sensor"] == sensor):
            seen = [k for k, line in enumerate(lines) if f'"{row["subject"]}"' in line]
            assert (int(row["frame"]), int(row["end_frame"]), int(row["value"])) == (seen[0], seen[-1], len(seen))


def test_a_cached_trace_has_its_contacts(tmp_path: Path) -> None:
    scene, store = scene_plan(), Store(tmp_path)
    made = simulate(scene)
    assert made.contacts
    assert store.keep_trace(scene, made).contacts == made.contacts
    assert pickle.loads(pickle.dumps(made)).contacts == made.contacts
    assert store.trace(scene, lambda: pytest.fail("it is kept"), contacts=True).contacts == made.contacts
    (entry,) = (tmp_path / "contacts").rglob("??????????*")
    entry.unlink()
    assert store.trace(scene, lambda: pytest.fail("it is kept")).contacts is None
    assert store.trace(scene, lambda: made, contacts=True).contacts == made.contacts
    assert entry.is_file()
