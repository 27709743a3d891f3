"""`recipe export --format mots` and `kitti`: files, report and JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from recipe_cli.commands import export
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import RigPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.transfer import layouts

from tests.runtime.fakes import ENGINES, dataset_plan


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    return build(
        dataset_plan(2, 1), folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)
    ).path


@pytest.mark.parametrize(("form", "file"), [("mots", "seqmaps/MOTS-train.txt"), ("kitti", "training/calib/0003.txt")])
def test_a_layout_is_written_and_reported(dataset: Path, tmp_path: Path, form: str, file: str) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(export.command, [str(dataset), str(out), "--format", form], catch_exceptions=False)
    assert done.exit_code == 0
    assert (out / file).is_file()
    index = json.loads((out / "index.json").read_text())
    assert done.output.splitlines()[-1] == index["dataset"]
    assert f"{len(index['files'])} files" in done.output
    again = CliRunner().invoke(export.command, [str(dataset), str(out), "--format", form, "--json"])
    report = json.loads(again.output)
    assert (report["dataset"], report["layout"], report["files"]) == (index["dataset"], form, len(index["files"]))
    assert report["bytes"] == sum(size for size, _ in index["files"].values())


def test_lens_distortion_is_reported_for_kitti(tmp_path: Path) -> None:
    """Regression: boxes projected by a calibration of KITTI missed the pictures, without a message.

    At first, the message named one sensor of several.
    """
    plan = dataset_plan(2, 1)
    sensor = plan.variants[0].rig.sensors[0]
    bent = sensor.model_copy(update={"camera": sensor.camera.model_copy(update={"lens_k": 0.3})})
    straight, also = (each.model_copy(update={"name": "side"}) for each in (sensor, bent))
    first = plan.variants[0].model_copy(update={"rig": RigPlan(sensors=(bent, straight))})
    second = plan.variants[1].model_copy(update={"rig": RigPlan(sensors=(bent, also))})
    plan = plan.model_copy(update={"variants": (first, second)})
    made = build(plan, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)).path
    for form, warned in (("kitti", True), ("mots", False)):
        call = [str(made), str(tmp_path / form), "--format", form]
        done = CliRunner().invoke(export.command, call, catch_exceptions=False)
        assert (done.exit_code, "pictures of street, side have lens distortion" in done.stderr) == (0, warned)


def test_a_patch_can_be_chosen_for_armory_only(dataset: Path, tmp_path: Path) -> None:
    """The dataset of the fakes has no patches, which the export of Armory reports; other layouts refuse the option."""
    out = [str(dataset), str(tmp_path / "out"), "--patch", "poster"]
    wrong = CliRunner().invoke(export.command, [*out, "--format", "mots"])
    assert (wrong.exit_code, "--patch needs --format armory" in wrong.output) == (2, True)
    with pytest.raises(InputError, match="has no picture with a patch"):
        CliRunner().invoke(export.command, [*out, "--format", "armory"], catch_exceptions=False)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("pictures", [["a.png"], []])
def test_frames_that_armory_cannot_use_are_reported(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pictures: list[str]
) -> None:
    """Regression: an export of a patch that no frame shows had no picture, and no message."""

    def written(_: object, out: Path, *args: object, **options: object) -> dict[str, object]:
        out.mkdir(exist_ok=True)
        (out / "left_out.csv").write_text("layout,variant,sensor,frame,reason\nall,a,street,all,no patch or no rgb\n")
        return {"dataset": "tiny@sha256:0", "files": {name: [1, "0"] for name in ["left_out.csv", *pictures]}}

    monkeypatch.setattr(layouts, "export_layout", written)
    call = [str(dataset), str(tmp_path / "out"), "--format", "armory"]
    done = CliRunner().invoke(export.command, call, catch_exceptions=False)
    message = (
        "left_out.csv has 1 row: frames and videos that were left out" if pictures else "so the export has no picture"
    )
    assert (done.exit_code, message in " ".join(done.stderr.split())) == (0, True)
    report = json.loads(CliRunner().invoke(export.command, [*call, "--json"], catch_exceptions=False).stdout)
    assert report["left_out"] == 1
