"""Two concurrent builds: of one dataset, and of two datasets with one cache."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.reliability.processes import Build, gone, scraps
from tests.runtime.fakes import tree

pytestmark = pytest.mark.reliability


@pytest.mark.parametrize("delay", [0.0, 0.0, 0.5, 1.5])
def test_of_one_dataset(tmp_path: Path, delay: float) -> None:
    """One builds it; the other reports that a build is running, or finds the complete dataset."""
    (tmp_path / "texts").mkdir()
    builds = []
    for number in range(3):
        builds.append(Build(tmp_path, out="out", RECIPE_CACHE=str(tmp_path / "cache")))
        builds[-1]._texts = [t.rename(tmp_path / "texts" / f"{number}{t.suffix}") for t in builds[-1]._texts]
        time.sleep(delay)
    ends = [build.end() for build in builds]
    assert 0 in {e.code for e in ends}
    for e in ends:
        if e.code:
            assert e.code == 1
            assert e.errors.startswith(f"another process is writing {tmp_path / 'out'}; wait for it, or choose")
    assert all(gone(build.process.pid) for build in builds)
    assert sorted(p.name for p in tmp_path.iterdir()) == [".out.source.json", "cache", "out", "texts"]
    ended = Build(tmp_path).end()
    assert (ended.code, "exists (sizes checked" in ended.out) == (0, True)


def test_of_two_datasets_with_one_cache(tmp_path: Path) -> None:
    builds = [Build(tmp_path, out=name, RECIPE_CACHE=str(tmp_path / "cache")) for name in ("a", "b", "c")]
    assert [build.end().code for build in builds] == [0, 0, 0]
    assert tree(tmp_path / "a") == tree(tmp_path / "b") == tree(tmp_path / "c")
    assert scraps(tmp_path) == []
