"""The export for MOTSChallenge; `test_trackeval` evaluates it."""

from __future__ import annotations

from pathlib import Path

from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import export

from tests.runtime.fakes import quiet


def test_the_mots_export_equals_the_datasets_mots_annotations(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "mots", quiet)
    for path in (tiny.root / "mots" / "MOTS-train").rglob("gt.txt"):
        inside = path.relative_to(tiny.root / "mots")
        assert (tmp_path / "out" / inside).read_bytes() == path.read_bytes()
        pictures = (tmp_path / "out" / inside).parents[1] / "img1"
        assert len(list(pictures.iterdir())) == 12
    assert (tmp_path / "out/seqmaps/MOTS-train.txt").read_bytes() == (
        tiny.root / "mots/seqmaps/MOTS-train.txt"
    ).read_bytes()
