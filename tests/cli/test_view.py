"""`recipe view`: a dataset's page, annotated pictures and films."""

from __future__ import annotations

import json
import shutil
import webbrowser
from pathlib import Path

import click
import numpy as np
import pytest
from PIL import Image
from recipe_cli.main import recipe as cli
from recipe_runtime.build.pipeline import BuildOptions, build

from tests.cli.runner import run_here
from tests.runtime.fakes import ENGINES, dataset_plan


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("view")
    options = BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)
    return build(dataset_plan(frames=6), folder / "tiny", options).path


def test_the_page_is_opened_in_a_browser(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def note(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", note)
    ran = run_here("view", "tiny", cwd=root.parent)
    assert ran.returncode == 0, ran.stderr
    assert opened == [(root / "preview" / "index.html").as_uri()]
    run_here("view", "tiny", "--no-open", cwd=root.parent)
    assert len(opened) == 1


def test_json_names_the_page(root: Path) -> None:
    document = json.loads(run_here("view", "tiny", "--json", cwd=root.parent).stdout)
    assert document["page"] == str(root / "preview" / "index.html") and document["opened"] is False


def test_a_page_with_a_foreign_script_is_not_opened(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(root, tmp_path / "tiny")
    (tmp_path / "tiny" / "preview" / "page" / "page.js").write_text("alert(1)")
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail("it was opened"))
    ran = run_here("view", "tiny", cwd=tmp_path)
    assert ran.returncode == 2 and "page.js is missing, or is not the one of this release" in ran.stderr


def test_pictures_have_the_labels_drawn_over_them(root: Path, tmp_path: Path) -> None:
    options = ("--frames", "1,3-4", "--sensor", "side", "--draw")
    for draw in ("none", "boxes"):
        ran = run_here("view", root, *options, draw, "-o", draw, cwd=tmp_path)
        assert ran.returncode == 0, ran.stderr
    names = sorted(path.name for path in (tmp_path / "boxes").iterdir())
    assert names == [f"weather=w0_jitter=still+side-rgb-{k:06d}.png" for k in (1, 3, 4)]
    own = np.asarray(Image.open(root / "weather=w0,jitter=still" / "side" / "rgb" / "000003.png"))
    plain, drawn = (np.asarray(Image.open(tmp_path / draw / names[1])) for draw in ("none", "boxes"))
    assert (plain == own).all()
    labels = json.loads((root / "weather=w0,jitter=still" / "side" / "labels.jsonl").read_text().splitlines()[3])
    x, y, _, _ = labels["objects"][0]["bbox"]
    assert (drawn[y, x] != own[y, x]).any()


def test_every_modality_has_pictures(root: Path, tmp_path: Path) -> None:
    for modality in ("depth", "instance", "semantic", "normals"):
        ran = run_here("view", root, "--frames", "2", "--modality", modality, "-o", "out", "--json", cwd=tmp_path)
        assert ran.returncode == 0, ran.stderr
        (path,) = json.loads(ran.stdout)["pictures"]
        assert len(np.unique(np.asarray(Image.open(tmp_path / path)))) > 1


def test_a_film_has_every_frame_and_the_map(root: Path, tmp_path: Path) -> None:
    ran = run_here("view", root, "--film", "film.gif", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.n_frames, film.width > 64, film.info["duration"]) == (6, True, 100)
    again = run_here("view", root, "--film", "film.gif", cwd=tmp_path)
    assert again.returncode == 2 and "--replace" in again.stderr


def test_a_film_is_an_mp4_of_the_right_rate(root: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="PyAV is not installed")
    ran = run_here("view", root, "--film", "film.mp4", "--frames", "0-3", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    with av.open(str(tmp_path / "film.mp4")) as film:
        assert film.streams.video[0].average_rate == 10
        assert len(list(film.decode(video=0))) == 4


def test_names_in_the_dataset_are_completed(root: Path) -> None:
    command = cli.get_command(click.Context(cli), "view")
    assert command is not None
    context = click.Context(command)
    context.args = [str(root)]
    found = {p.name: [item.value for item in p.shell_complete(context, "")] for p in command.params}
    assert found["sensor"] == ["side", "street"]
    assert found["variant"][0] == "weather=w0,jitter=still" and "depth" in found["modality"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--frames", "9", "-o", "out"), "takes none of 9\nhelp: it takes 0 to 5"),
        (("--frames", "x", "-o", "out"), "neither a frame nor a range"),
        (("--draw", "boxs", "-o", "out"), "'boxs' is not one of"),
        (("--sensor", "top", "-o", "out"), "no sensor 'top'\nhelp: its sensors are street, side"),
        (("--sensor", "side", "--modality", "depth", "-o", "out"), "does not capture 'depth'"),
        (("--variant", "wet", "-o", "out"), "has no variant 'wet'"),
        (("--film", "film.avi"), "a film is an MP4 or a GIF"),
        (("--frames", "1"), "need --output or --film"),
    ],
)
def test_bad_options_are_explained(root: Path, tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    ran = run_here("view", root, *options, cwd=tmp_path)
    assert ran.returncode == 2 and message in ran.stderr.replace("\n    ", " ")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_picture_is_one_error(root: Path, tmp_path: Path) -> None:
    shutil.copytree(root, tmp_path / "tiny")
    (tmp_path / "tiny" / "weather=w0,jitter=still" / "street" / "rgb" / "000002.png").write_bytes(b"no picture")
    ran = run_here("view", "tiny", "-o", "out", "--json", cwd=tmp_path)
    assert ran.returncode == 2 and "missing or damaged" in json.loads(ran.stdout)["errors"][0]["message"]
