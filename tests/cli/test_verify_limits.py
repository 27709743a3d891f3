"""A dataset's folder is untrusted: the limits of recipes apply to its plan before any work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from recipe_cli.commands.verify import command
from recipe_cli.host_limits import check_bytes, check_cost
from recipe_cli.main import recipe
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.lockfile import read_source
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes

PLAN = fakes.dataset_plan(frames=2, weathers=1)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    return build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES)).path


def test_a_plan_over_the_limits_is_refused_unless_allowed(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recipe_compiler.estimate.FRAME_LIMIT", 1)
    with pytest.raises(InputError, match="frames are over 1") as caught:
        check_cost(datasets.read(built).plan, "tiny", "pass --allow-large")
    assert "tiny: to render its plan, 8 frames" in str(caught.value)
    check_cost(datasets.read(built).plan, "tiny", "pass --allow-large", allow_large=True)


@pytest.mark.parametrize("arguments", [("verify", "--integrity"), ("export", "--output", "shards")])
def test_a_dataset_of_many_bytes_is_not_read_unless_allowed(
    built: Path, tmp_path: Path, arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sparse files of terabytes fit in an archive of kilobytes, and hashing them takes hours."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("recipe_compiler.estimate.BYTE_LIMIT", 10_000)
    refused = CliRunner().invoke(recipe, [*arguments, str(built)])
    assert isinstance(refused.exception, InputError) and "over 10 KiB" in str(refused.exception)
    assert "--allow-large" in str(refused.exception) and not list(tmp_path.iterdir())
    assert CliRunner().invoke(recipe, [*arguments, str(built), "--allow-large"]).exit_code == 0


def test_each_name_of_a_file_counts_where_it_is_copied(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held = datasets.read(built)
    sizes = {path: (held.root / path).lstat() for path in held.files}
    linked = sum({there.st_ino: there.st_size for there in sizes.values()}.values())
    total = sum(there.st_size for there in sizes.values())
    assert linked < total  # weathers share their labels
    monkeypatch.setattr("recipe_compiler.estimate.BYTE_LIMIT", linked)
    check_bytes(held)
    with pytest.raises(InputError, match="its files have"):
        check_bytes(held, copies=1)


EXPORT = ("export", "--output", "made", "--format")


def test_a_dataset_over_the_limits_is_not_exported_unless_allowed(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: 60,000 pictures of 4096 x 4096 in 95 MB of hard links would have been decoded for 20 hours."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("recipe_compiler.estimate.FRAME_LIMIT", 1)
    refused = CliRunner().invoke(recipe, [*EXPORT, "kitti", str(built)])
    assert isinstance(refused.exception, InputError) and "frames are over 1" in str(refused.exception)
    assert not list(tmp_path.iterdir())
    assert CliRunner().invoke(recipe, [*EXPORT, "kitti", str(built), "--allow-large"]).exit_code == 0


def test_nothing_is_simulated_where_frames_have_no_digest(built: Path) -> None:
    held = datasets.read(built)
    frames = dict(list(held.lock.frames.items())[1:])
    engines = replace(fakes.ENGINES, simulate=lambda scene: pytest.fail("it was simulated"))
    lock = replace(held.lock, frames=frames)
    report = verify(held.plan, lock, Options(nonce=1, workers=0), lambda *_: None, dataset=held, engines=engines)
    assert (report.verdict, report.stage, report.bound.checked) == ("FAIL", "lockfile", 0)


def test_only_the_head_of_a_lockfile_is_read_for_its_recipe(tmp_path: Path) -> None:
    path = tmp_path / "x.lock"
    path.write_text(f"recipe-lock 1\nrecipe x ../x%20y.yaml {'0' * 64}\nnot a row\n")
    assert read_source(path) == "../x y.yaml"
    for text in ("", "recipe-lock 1\n", f"recipe-lock 1\nidentity x@sha256:{'0' * 64}\n", "no\n"):
        path.write_text(text)
        with pytest.raises(InputError):
            read_source(path)


def test_a_failure_of_the_host_at_one_target_does_not_end_the_others(
    tmp_path: Path, built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(target: Path, options: Options) -> None:
        if target.name == "first":
            raise RunError("the simulation ended")
        seen.append(target.name)
        raise InputError("not a dataset")

    seen: list[str] = []
    monkeypatch.setattr("recipe_cli.commands.verify._integrity", fail)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(command, ["--integrity", "first", "second"])
    assert seen == ["second"]
    assert isinstance(done.exception, RunError) and "the simulation ended" in str(done.exception)
    assert "not a dataset" in str(done.exception)
