"""Pages of the paper's studies: each study has a page with the table and the sheet of its command."""

from __future__ import annotations

import itertools
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from recipe_compiler.compile import compile_recipe

from benchmarks import insertion
from benchmarks.pages import markdown, table_of, write_table
from benchmarks.paper import __main__ as paper
from benchmarks.paper.defences import opencv_subtractors
from benchmarks.paper.sheets import MAX_BYTES, Sheet, around, marked, outlined
from benchmarks.paper.studies import STUDIES, Measured
from tests.sources import ROOT

INDEX = ROOT / "docs" / "paper.md"
TABLE = ({"weather": "clear", "error": "1.5"}, {"weather": "foggy", "error": "2.5"})


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "small.md"
    path.write_text(f"# Small\n\n<!-- table of `{paper.command('small')}` -->\n<!-- end of the table -->\n\nSeen.\n")
    return path


def measured(level: int = 90) -> Measured:
    """Return the result of a study with one grey picture."""
    return Measured(TABLE, Sheet((("grey", np.full((6, 8, 3), level, np.uint8)),), 1, (80, 60)))


def test_pages_sheets_and_the_index_are_of_the_studies() -> None:
    folder = paper.PAGES
    assert {path.stem for path in folder.iterdir()} == set(STUDIES)
    assert set(re.findall(r"\(paper/(\w+)\.md\)", INDEX.read_text())) == set(STUDIES)


@pytest.mark.parametrize("name", STUDIES)
def test_a_page_has_figure_recipe_sheet_and_table(name: str) -> None:
    text = (paper.PAGES / f"{name}.md").read_text()
    assert re.search(r"^Figure \d of the paper", text, re.M)
    (recipe,) = re.findall(r"^    recipe build (recipes/paper/\w+\.yaml)$", text, re.M)
    assert (ROOT / recipe).is_file() and recipe in INDEX.read_text()
    assert f"({name}.jpg)" in text and (paper.PAGES / f"{name}.jpg").stat().st_size < MAX_BYTES
    assert table_of(paper.PAGES / f"{name}.md", paper.command(name)).count("\n") > 2, "run `make paper`"


def test_the_table_of_insertions_has_rows_by_weather_and_hour() -> None:
    table = table_of(insertion.PAGE, insertion.COMMAND).splitlines()
    assert table[0].startswith("| weather | hour | `green` | `digital` |")
    assert len(table) == 2 + len(insertion.WEATHERS) * len(insertion.HOURS)


def test_every_weather_and_hour_has_all_methods() -> None:
    """Methods differ only in the patch, hours only in the sun; neither affects labels."""
    plan = compile_recipe(insertion.RECIPE).plan
    assert len(plan.variants) == 4 * len(insertion.WEATHERS) * len(insertion.HOURS)
    appearances = set()
    for weather, hour in itertools.product(insertion.WEATHERS, insertion.HOURS):
        variants = insertion.variants_of(plan, weather, hour)
        assert list(variants) == list(insertion.TITLES)
        assert len({variant.appearance.digest for variant in variants.values()}) == len(insertion.TITLES)
        assert {(v.scene.digest, v.rig.digest) for v in variants.values()} == {
            (plan.variants[0].scene.digest, plan.variants[0].rig.digest)
        }
        appearances.add(variants["rendered"].appearance.digest)
    assert len(appearances) == len(insertion.WEATHERS) * len(insertion.HOURS)


def test_only_the_table_of_a_page_is_replaced(page: Path) -> None:
    write_table(page, paper.command("small"), [{"old": "1"}])
    write_table(page, paper.command("small"), TABLE)
    assert table_of(page, paper.command("small")) == markdown(TABLE)
    assert page.read_text().startswith("# Small\n\n<!--") and page.read_text().endswith("-->\n\nSeen.\n")
    assert "old" not in page.read_text()


def test_a_page_without_a_place_for_the_table_is_an_error(page: Path) -> None:
    with pytest.raises(ValueError, match="0 tables of `python -m benchmarks\\.paper other`"):
        write_table(page, paper.command("other"), TABLE)


def test_a_written_table_passes_the_check(
    page: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(paper, "STUDIES", {"small": measured})
    assert paper.main(["small"], page.parent) == 0
    written = page.read_text(), page.with_suffix(".jpg").read_bytes()
    assert paper.main(["--check"], page.parent) == 0
    page.write_text(written[0].replace("2.5", "2.6"))
    monkeypatch.setattr(paper, "STUDIES", {"small": lambda: measured(level=91)})
    assert paper.main(["--check", "small"], page.parent) == 1
    said = capsys.readouterr().err
    assert "small.md: the table differs" in said and "small.jpg: the sheet differs" in said
    assert "2.6" in page.read_text() and page.with_suffix(".jpg").read_bytes() == written[1], "--check writes nothing"


def test_a_study_without_its_library_writes_no_table(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without OpenCV, the table of the background ablation would lose its rows."""
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.setattr(paper, "STUDIES", {"small": lambda: [opencv_subtractors(), measured()][1]})
    before = page.read_text()
    with pytest.raises(SystemExit, match="small: OpenCV is not installed; `make paper` installs it"):
        paper.main(["small"], page.parent)
    assert page.read_text() == before


def test_marks_and_outlines_are_at_the_masks() -> None:
    found, wanted = np.eye(4, dtype=np.bool_), np.zeros((4, 4), np.bool_)
    wanted[:2] = True
    pixels = marked(found, wanted)
    assert {tuple(pixels[i, i]) for i in (0, 1)} != {tuple(pixels[i, i]) for i in (2, 3)}
    instances = np.zeros((9, 9), np.uint16)
    instances[2:7, 2:7] = 5
    outline = outlined(np.zeros((9, 9, 3), np.uint8), instances)[..., 0] > 0
    assert outline.sum() == 16 and not outline[3:6, 3:6].any()


@pytest.mark.parametrize("corner", [(0, 0), (30, 52), (12, 20)])
def test_the_part_around_a_mask_shows_all_of_it(corner: tuple[int, int]) -> None:
    mask = np.zeros((40, 60), np.bool_)
    mask[corner[0] : corner[0] + 10, corner[1] : corner[1] + 8] = True
    picture = np.repeat(mask[..., None], 3, axis=2).astype(np.uint8)
    part = around(picture, mask, 0.5, (4, 3))
    assert part[..., 0].sum() == 80 and part.shape[1] > part.shape[0] > 10
