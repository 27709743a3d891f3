"""A build that is ended at any time leaves no partial file, and the next build gives the same dataset.

There are twenty random points in the duration of a complete build. `RECIPE_SEED=N` repeats a run: each test's name has
the seed, the way and the point. Two points are among the quick tests.
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
    """Return twenty ways to end a build, each with a point in another twentieth of its duration, in random order."""
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
    """The result and the duration of an uninterrupted build."""

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
            break  # kernels are compiled now, so later builds have this duration
    files = tree(folder / name)
    return Whole(files, json.loads(files["manifest.json"])["identity"], seconds)


@pytest.mark.slow
@pytest.mark.parametrize(("way", "at"), points())
def test_an_ended_build_is_resumed(whole: Whole, tmp_path: Path, way: str, at: float) -> None:
    # Before the command starts, Python itself handles an interrupt, so the point is after that.
    delay = whole.seconds * at if way not in ("interrupt", "terminate") else 0.5 + (whole.seconds - 0.5) * at
    build = Build(tmp_path)
    time.sleep(delay)
    stop(build, way)
    ended = build.end(30)
    assert gone(build.process.pid), "a process is still running after the build"
    if ended.code != 0:  # the build may have completed before the signal
        assert ended.code == CODES[way], ended.errors
    check_message(way, ended.code, ended.errors)
    check_names(whole, tmp_path)
    again = Build(tmp_path).end()
    assert again.code == 0, again.errors
    check_whole(whole, tmp_path)


@pytest.mark.reliability
def test_a_build_that_is_ended_repeatedly_completes(whole: Whole, tmp_path: Path) -> None:
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
    """Assert that a process that can still print gives one line and no traceback (the recipe itself has a warning)."""
    if code < 0 or code in (0, 143):
        assert errors == ""
        return
    (line,) = errors.strip().splitlines()  # a terminal shows ^C on the line before
    if way == "interrupt":
        assert line.startswith("interrupted")
    else:
        assert ("a worker process was lost" in line and "build again: what is done is kept" in line) or (
            "the simulation ended with signal 9" in line
        )


def check_names(whole: Whole, folder: Path) -> None:
    """Assert that there is either a complete dataset or none, and that each finished file is complete."""
    if (folder / "out").exists():
        assert tree(folder / "out") == whole.files
    for path, body in named_files(folder / ".out.partial" / "dataset"):
        assert body == whole.files[path], f"{path} is not whole"


def check_whole(whole: Whole, folder: Path) -> None:
    """Assert that the dataset is equal, and that only the record of its recipe is beside it."""
    assert tree(folder / "out") == whole.files
    assert json.loads((folder / "out" / "manifest.json").read_text())["identity"] == whole.identity
    assert sorted(p.name for p in folder.iterdir()) == [".out.source.json", "cache", "out"]
    assert scraps(folder) == []
