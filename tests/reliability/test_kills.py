"""A build that is ended anywhere, in any way, leaves nothing half-written, and the next one makes the same dataset.

Twenty points, spread at random over the time that a whole build takes. `RECIPE_SEED=N` repeats a run: the seed is in
each test's name, with the way and the point. Two points are in the quick tests.
"""

from __future__ import annotations

import json
import os
import random
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.reliability.processes import Build, gone, named_files, scraps
from tests.runtime.fakes import tree

SEED = int(os.environ.get("RECIPE_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)
WAYS = ["group"] * 10 + ["build"] * 3 + ["worker"] * 3 + ["interrupt"] * 2 + ["terminate"] * 2
CODES = {"group": -signal.SIGKILL, "build": -signal.SIGKILL, "worker": 1, "interrupt": 130, "terminate": 143}


def points() -> list[object]:
    """Twenty ways with a point each: one in every twentieth of a build, in random order."""
    draw = random.Random(SEED)
    places = [(k + draw.random()) / len(WAYS) for k in range(len(WAYS))]
    draw.shuffle(places)
    many = [
        pytest.param(way, at, id=f"seed{SEED}-{way}-{at:.3f}", marks=pytest.mark.reliability)
        for way, at in zip(WAYS, places, strict=True)
    ]
    return [pytest.param("group", 0.6, id="group"), pytest.param("worker", 0.5, id="worker"), *many]


@dataclass(frozen=True)
class Whole:
    """What a build that nobody stopped makes, and how long it takes."""

    files: dict[str, bytes]
    identity: str
    seconds: float


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("whole")
    for name in ("first", "second"):
        start = time.monotonic()
        ended = Build(folder, out=name, RECIPE_CACHE=str(folder / f"cache-{name}")).end()
        seconds = time.monotonic() - start
        assert ended.code == 0, ended.errors
        if "compiling kernels" not in ended.errors:
            break  # no other build will compile any, so that all take as long
    files = tree(folder / name)
    return Whole(files, json.loads(files["manifest.json"])["identity"], seconds)


@pytest.mark.slow
@pytest.mark.parametrize(("way", "at"), points())
def test_a_build_that_is_ended_is_taken_up(whole: Whole, tmp_path: Path, way: str, at: float) -> None:
    # An interrupt while Python itself still starts is Python's to answer: ours begin once the command does.
    delay = whole.seconds * at if way not in ("interrupt", "terminate") else 0.5 + (whole.seconds - 0.5) * at
    build = Build(tmp_path)
    time.sleep(delay)
    stop(build, way)
    ended = build.end(30)
    assert gone(build.process.pid), "a process outlived the build"
    if ended.code != 0:  # it may have been quicker
        assert ended.code == CODES[way], ended.errors
    check_message(way, ended.code, ended.errors)
    check_names(whole, tmp_path)
    again = Build(tmp_path).end()
    assert again.code == 0, again.errors
    check_whole(whole, tmp_path)


@pytest.mark.reliability
def test_a_build_that_is_ended_again_and_again_comes_to_its_end(whole: Whole, tmp_path: Path) -> None:
    draw = random.Random(SEED)
    for _ in range(8):
        build = Build(tmp_path)
        time.sleep(whole.seconds * (0.3 + 0.6 * draw.random()))
        build.send(signal.SIGKILL, group=True)
        build.end(30)
        check_names(whole, tmp_path)
    assert Build(tmp_path).end().code == 0
    check_whole(whole, tmp_path)


def stop(build: Build, way: str) -> None:
    """End a build in one of the ways."""
    if way == "worker":
        build.kill_a_child()
    elif way == "interrupt":
        build.send(signal.SIGINT, group=True)
    elif way == "terminate":
        build.send(signal.SIGTERM)
    else:
        build.send(signal.SIGKILL, group=way == "group")


def check_message(way: str, code: int, errors: str) -> None:
    """One clear line where a process can still speak; never a traceback. The recipe itself has a warning."""
    if code < 0 or code in (0, 143):
        assert errors == ""
        return
    (line,) = errors.strip().splitlines()  # a terminal shows ^C in the line before
    if way == "interrupt":
        assert line.startswith("interrupted")
    else:
        assert ("a worker process was lost" in line and "build again: what is done is kept" in line) or (
            "the simulation ended with signal 9" in line
        )


def check_names(whole: Whole, folder: Path) -> None:
    """Whatever has a name is whole: the dataset or nothing, and of the files so far each."""
    if (folder / "out").exists():
        assert tree(folder / "out") == whole.files
    for path, body in named_files(folder / ".out.partial" / "dataset"):
        assert body == whole.files[path], f"{path} is not whole"
    for path, body in named_files(folder / ".out.partial" / "shards"):
        assert len(body.partition(b"\n")[0]) == 64 and json.loads(body.partition(b"\n")[2]), path


def check_whole(whole: Whole, folder: Path) -> None:
    """The dataset is the same, and nothing lies beside it but the record of its recipe."""
    assert tree(folder / "out") == whole.files
    assert json.loads((folder / "out" / "manifest.json").read_text())["identity"] == whole.identity
    assert sorted(p.name for p in folder.iterdir()) == [".out.source.json", "cache", "out"]
    assert scraps(folder) == []
