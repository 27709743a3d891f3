"""An interrupted build reports how many frames it kept, and the next build how many it resumed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import pytest
from click.testing import CliRunner, Result
from recipe_cli.commands import build
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.lockfile import skeleton
from recipe_runtime.build import local
from recipe_runtime.build.worker import Job
from recipe_runtime.dataset.schedule import Shard

from tests.cli.reading import problems
from tests.cli.runner import run_here
from tests.cli.test_commands import RECIPE
from tests.runtime.fakes import ENGINES

_NONE = "interrupted; no frame was finished yet; build again to start over"

FRAMES = 12
Runner = Callable[..., local.Seconds]


def _stopping(after: int) -> Runner:
    """Return a runner that is interrupted after a number of shards."""

    def run(job: Job, shards: Sequence[Shard], workers: int, done: local.Done, tick: Callable[[int], None]) -> NoReturn:
        local.run(job, shards[:after], 0, done, tick)
        raise KeyboardInterrupt

    return run


def _whole(
    job: Job, shards: Sequence[Shard], workers: int, done: local.Done, tick: Callable[[int], None]
) -> local.Seconds:
    return local.run(job, shards, 0, done, tick)


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Return a function that runs `recipe build` in this process with fast engines."""
    (tmp_path / "small.yaml").write_text(RECIPE.replace("frames: 2", f"frames: {FRAMES // 2}"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(build, "engines_for", lambda compiled: ENGINES)

    def invoke(run: Runner, *options: str) -> Result:
        @contextmanager
        def runner(ray: str | None) -> Iterator[Runner]:
            yield run

        monkeypatch.setattr(build, "_runner", runner)
        return CliRunner().invoke(build.command, ["small.yaml", *options], catch_exceptions=False)

    return invoke


@pytest.mark.slow
def test_an_interrupted_build_counts_the_frames_that_it_kept(command: Callable[..., Result]) -> None:
    first = command(_stopping(0))
    assert (first.exit_code, problems(first.stderr)) == (130, [_NONE])
    second = command(_stopping(1))  # a shard has five frames in each of two weathers
    assert (second.exit_code, problems(second.stderr)) == (
        130,
        ["interrupted; 10 of 12 frames are kept; build again to continue"],
    )
    again = command(_stopping(0))
    assert again.stderr == second.stderr  # a build without progress keeps the frames of an earlier one
    whole = command(_whole)
    assert whole.exit_code == 0
    assert "12 frames: 2 rendered, 10 resumed from the stopped build;" in whole.stdout


def test_frames_of_another_recipe_are_not_counted(command: Callable[..., Result], tmp_path: Path) -> None:
    command(_stopping(1))
    recipe = tmp_path / "small.yaml"
    recipe.write_text(recipe.read_text().replace("yaw: 40", "yaw: 41"))
    assert problems(command(_stopping(0)).stderr) == [_NONE]


def test_an_interrupted_upload_reports_that_the_dataset_is_complete(
    command: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from recipe_runtime.transfer.upload import Target

    def put(self: Target, *_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Target, "put", put)
    url = f"file://{tmp_path}/there"
    stopped = command(_whole, "--out", url)
    assert problems(stopped.stderr) == [
        f"interrupted; datasets/small is complete; build again to continue copying it to {url}"
    ]


@pytest.mark.slow
def test_an_interrupted_repair_does_not_claim_success(command: Callable[..., Result], tmp_path: Path) -> None:
    command(_whole)
    picture = tmp_path / "datasets/small/weather=dry/street/rgb/000001.png"
    picture.write_bytes(picture.read_bytes()[:-1] + b"!")
    nothing = "interrupted; run it again with --repair to repair the rest"
    assert problems(command(_stopping(0), "--repair").stderr) == [nothing]
    some = "interrupted; 2 of 12 frames are kept; run it again with --repair to continue"
    assert problems(command(_stopping(1), "--repair").stderr) == [some]
    repaired = command(_whole, "--repair")
    reported = "repaired: weather=dry/street/rgb/000001.png differs from its SHA-256 in the manifest\n"
    assert (repaired.exit_code, repaired.stdout.startswith(reported)) == (0, True)
    assert "none rendered, 10 reused from the existing dataset, 2 resumed from the stopped" in repaired.stdout
    assert "every file has the bytes that its manifest lists" in command(_whole, "--repair").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command_line", "stopped"),
    [
        (("lock", "small.yaml"), "recipe_runtime.verify.locking.lock"),
        (("verify", "small.yaml"), "recipe_runtime.verify.verify.verify"),
        (("verify", "datasets/small", "--integrity"), "recipe_runtime.verify.verify.verify_files"),
        (("export", "datasets/small", "out"), "recipe_runtime.transfer.export._write"),
        (("shot", "small.yaml"), "recipe_runtime.frames.shot.shot"),
    ],
)
def test_an_interrupted_command_ends_with_130(
    command: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command_line: tuple[str, ...],
    stopped: str,
) -> None:
    def interrupted(*_: object, **__: object) -> NoReturn:
        raise KeyboardInterrupt

    assert command(_whole).exit_code == 0
    (tmp_path / "lockfiles").mkdir()
    plan = compile_recipe(tmp_path / "small.yaml").plan
    if command_line[0] == "verify":
        skeleton(plan, "../small.yaml", {}, {}, {}).write(tmp_path / "lockfiles" / "small.lock")
    monkeypatch.setattr(stopped, interrupted)
    done = run_here(*command_line, cwd=tmp_path)
    assert done.returncode == 130
    assert done.stdout == "" and "interrupted" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists() and not (tmp_path / ".out.export").exists()
    assert ("--nonce" in done.stderr) == (command_line == ("verify", "small.yaml"))  # only then there is a sample
