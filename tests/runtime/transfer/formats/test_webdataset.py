"""WebDataset shards contain a dataset's own files; `tests/runtime/test_webdataset.py` reads them with the library."""

from __future__ import annotations

import tarfile
from pathlib import Path

import pytest
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import export

from tests.runtime.fakes import quiet

SMALL = 40_000  # bytes: a few samples per shard


@pytest.mark.slow
def test_shards_contain_the_datasets_files(tiny: Dataset, tmp_path: Path) -> None:
    held = set()
    made = export(tiny, tmp_path / "out", "webdataset", quiet, options={"shard-size": str(SMALL)})
    assert len(made.rows) > 3
    for shard in (tmp_path / "out" / row["file"] for row in made.rows):
        assert shard.stat().st_size <= SMALL
        with tarfile.open(shard) as tar:
            for entry in tar:
                assert (entry.mtime, entry.uid, entry.gid, entry.uname, entry.gname) == (0, 0, 0, "", "")
                place, _, name = entry.name.rpartition("/")
                frame, modality, ending = [*name.split("."), ""][:3]
                if ending:
                    body = tar.extractfile(entry)
                    assert body is not None
                    assert body.read() == (tiny.root / place / modality / f"{frame}.{ending}").read_bytes()
                    held.add(f"{place}/{modality}/{frame}.{ending}")
    assert held == {
        layout.frame_file(variant.variant, sensor.name, modality, frame, tiny.plan.forms)
        for variant in tiny.plan.variants
        for sensor in variant.rig.sensors
        for modality in sensor.capture
        for frame in range(variant.scene.clock.frames)
    }
