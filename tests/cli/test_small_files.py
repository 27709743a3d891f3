"""Commands that write one small file or none: invalid names, unwritable folders, links; and the progress bar."""

from __future__ import annotations

import json
import os
import pty
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from pydantic import BaseModel, model_serializer
from recipe_cli.commands import check, export, init, schema, shot
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.library import towns
from recipe_runtime.frames.shot import Shot

from tests.cli.runner import run_here
from tests.compiler.kitchen import small


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rain_bench", "rain-bench", "Rain2", "no", "12", "null", "a" * 64, "long_name_of_it"])
def test_every_valid_name_makes_a_recipe(tmp_path: Path, name: str) -> None:
    done = CliRunner().invoke(init.command, [name, "--dir", str(tmp_path / "new")], catch_exceptions=False)
    assert done.exit_code == 0
    assert compile_recipe(tmp_path / "new" / f"{name}.yaml").plan.recipe == name


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("x.yaml", "'x'"), ("../x", "'x' with --dir .."), ("my dataset", "'rain_bench'"), ("", "'rain_bench'")],
)
def test_an_invalid_name_is_refused_with_a_valid_one(tmp_path: Path, name: str, nearest: str) -> None:
    with pytest.raises(InputError, match=f"cannot name a recipe: .*; try {nearest}$"):
        CliRunner().invoke(init.command, [name, "--dir", str(tmp_path)], catch_exceptions=False)
    assert not list(tmp_path.iterdir())


def test_an_unwritable_file_is_an_error_of_one_line(tmp_path: Path) -> None:
    for command, arguments in (
        (init.command, ["x", "--dir", "/proc"]),
        (init.command, ["x", "--dir", "/proc/1/new"]),
        (schema.command, ["-o", "/proc/x.json"]),
        (schema.command, ["-o", "/dev/full"]),
    ):
        with pytest.raises(RunError, match=r"cannot be written: .*; (free some space, or )?choose another ") as caught:
            CliRunner().invoke(command, arguments, catch_exceptions=False)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("there", [None, "recipe: mine\n"])
def test_a_full_disk_does_not_change_an_existing_recipe(tmp_path: Path, there: str | None) -> None:
    path = tmp_path / "mine.yaml"
    if there is not None:
        path.write_text(there)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(
            RunError, match=r"mine\.yaml cannot be written: .*; free some space, or choose another --dir"
        ):
            CliRunner().invoke(init.command, ["mine", "--dir", str(tmp_path), "--replace"], catch_exceptions=False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [entry.name for entry in tmp_path.iterdir()] == ([] if there is None else ["mine.yaml"])
    assert there is None or path.read_text() == there


@pytest.mark.parametrize(
    ("command", "folder"),
    [("lock", "lockfiles"), ("verify", "differences"), ("build", "datasets"), ("import carla", "recipes")],
    ids=["lock", "verify", "build", "import"],
)
def test_a_default_folder_that_is_a_link_is_not_written_through(tmp_path: Path, command: str, folder: str) -> None:
    """The command line does not name it, so an untrusted folder could choose where files are written."""
    (tmp_path / "r.yaml").write_text(json.dumps(small()))
    (tmp_path / "victim").mkdir()
    (tmp_path / folder).symlink_to("victim")
    done = run_here(*command.split(), "r.yaml", cwd=tmp_path)
    assert done.returncode == 2 and f"{folder} is a symbolic link" in done.stderr
    assert not list((tmp_path / "victim").iterdir())


@pytest.mark.parametrize("replace", [[], ["--replace"]], ids=["", "replace"])
@pytest.mark.parametrize("there", [None, "private"], ids=["dangling", "file"])
def test_no_file_is_written_through_a_link(tmp_path: Path, there: str | None, replace: list[str]) -> None:
    """An untrusted folder could contain a link such as `r.recipe -> ~/.bashrc`."""
    (tmp_path / "r.yaml").write_text(json.dumps(small() | {"recipe": "r"}))
    victim = tmp_path / "victim"
    if there:
        victim.write_text(there)
    (tmp_path / "r.recipe").symlink_to("victim")
    done = run_here("pack", "r.yaml", *replace, cwd=tmp_path)
    assert done.returncode == 2 and "r.recipe is a symbolic link" in done.stderr
    assert "help: remove the link, or name the file that it leads to" in done.stderr
    assert (victim.read_text() if victim.exists() else None) == there


def test_a_missing_target_of_verify_has_a_fitting_remedy(tmp_path: Path) -> None:
    (tmp_path / "lockfiles").mkdir()
    (tmp_path / "lockfiles" / "mine.lock").write_text("")
    for target, remedy in (
        ("datasets/mine", "did you mean lockfiles/mine.lock?"),
        ("datasets/other", "`recipe build` makes one"),
        ("mine.lock", "did you mean lockfiles/mine.lock?"),
        ("other.lock", "`recipe lock RECIPE` writes one"),
        ("other.yaml", "`recipe init` writes a recipe"),
    ):
        done = run_here("verify", target, cwd=tmp_path)
        assert done.returncode == 2 and remedy in done.stderr


def test_a_map_of_an_unknown_town_names_the_towns(tmp_path: Path) -> None:
    done = run_here("shot", "--map", "Town03", cwd=tmp_path)
    assert done.returncode == 2 and f"towns are {', '.join(towns.NAMES)}" in done.stderr


@pytest.mark.parametrize("size", ["0", "0.4", "0K", "99999999999999T"])
def test_a_shard_of_no_or_too_many_bytes_is_refused(tmp_path: Path, size: str) -> None:
    """It is refused before the dataset, which does not exist here, is read."""
    arguments = [str(tmp_path / "no"), str(tmp_path / "out"), "--shard-size", size]
    with pytest.raises(InputError, match=f"shard size {size}: a shard holds 1 byte to "):
        CliRunner().invoke(export.command, arguments, catch_exceptions=False)


def test_a_missing_folder_is_an_error_and_not_created(tmp_path: Path) -> None:
    (tmp_path / "r.yaml").write_text(json.dumps(small()))
    for command, arguments in ((schema.command, []), (shot.command, [str(tmp_path / "r.yaml")])):
        with pytest.raises(InputError, match=r"new/x\.png: there is no folder .*new; make it first"):
            CliRunner().invoke(command, [*arguments, "-o", str(tmp_path / "new/x.png")], catch_exceptions=False)
    assert not (tmp_path / "new").exists()


def test_a_shot_is_a_png(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.jpg: a shot is a PNG"):
        CliRunner().invoke(shot.command, ["missing.yaml", "-o", str(tmp_path / "x.jpg")], catch_exceptions=False)


def test_the_name_of_a_shot_is_a_file_name(tmp_path: Path) -> None:
    """Regression: with long names, which the language allows, the picture could not be written."""
    made = Shot("s" * 64, 99_999, "semantic", np.zeros((1, 1), np.uint8))
    assert shot._name("r", "w=v", made) == f"r-w=v-{'s' * 64}-semantic-099999"
    made.write(tmp_path / f"{shot._name('r' * 64, 'v' * 200, made)}.999.png")


@pytest.mark.slow
def test_check_warns_of_a_large_recipe(tmp_path: Path) -> None:
    path = tmp_path / "large.yaml"
    still = {"street": {"mount": {"z": 2}, "camera": {"width": 16, "height": 16}, "capture": ["rgb"]}}
    for recipe, says in (
        (
            small(clock={"fps": 10, "frames": 60_000}, sensors=still) | {"sweep": {"repeats": 2}},
            "first 2 of 2 variants are over 100,000",
        ),
        (small() | {"sweep": {"repeats": 10_000}}, "of 10,000 variants are over 50,000"),
    ):
        path.write_text(json.dumps(recipe))
        done = CliRunner().invoke(check.command, [str(path)], catch_exceptions=False)
        assert done.exit_code == 0
        assert f"{path}: valid, {recipe['sweep']['repeats']:,} variants\n" in done.stdout
        assert says in done.stderr and "`recipe plan` and `recipe build` need --allow-large" in done.stderr


def test_check_as_json_has_warnings_and_the_file_of_every_problem(tmp_path: Path) -> None:
    path, missing = tmp_path / "r.yaml", tmp_path / "missing.yaml"
    draw = {"draw": {"count": 1, "values": {"weather.wetness": {"uniform": [0, 9]}}}}
    path.write_text(json.dumps(small() | {"deltas": {"w": {"wet": {"weather": {"wetness": 9}}}}, "sweep": draw}))
    done = CliRunner().invoke(check.command, ["--json", str(path), str(missing)], catch_exceptions=False)
    answer = json.loads(done.stdout)
    assert (done.exit_code, done.stderr) == (2, "")
    assert [row["file"] for row in answer["problems"]] == [str(missing)]
    (warning,) = answer["warnings"]
    assert warning["message"] == "axis w and sweep.draw both set weather.wetness"
    assert warning["help"] == "the draw wins"
    assert (warning["file"], warning["line"]) == (str(path), 1)


_BAR = """
from recipe_cli.progress import Progress
with Progress() as progress:
    progress("render", 1, 2)
    progress("render", 2, 2)
"""


@pytest.mark.parametrize("columns", [50, 160])
def test_a_bar_fits_the_terminal(columns: int) -> None:
    lines = on_a_terminal(_BAR, columns).replace("\r", "\n").splitlines()
    assert max(map(len, lines)) in range(columns - 8, columns + 1)


def on_a_terminal(program: str, columns: int) -> str:
    """Return what a program writes to standard error on a terminal of the given width, without escape codes."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(columns), "LINES": "24"}
    subprocess.run([sys.executable, "-c", program], stderr=theirs, stdout=theirs, env=environment, check=False)
    os.close(theirs)
    text = b""
    try:
        while chunk := os.read(ours, 4096):
            text += chunk
    except OSError:  # a terminal whose other end is closed
        pass
    os.close(ours)
    return text.decode().replace("\x1b[?25l", "").replace("\x1b[?25h", "")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["verify", "build", "plan", "diff"])
@pytest.mark.parametrize("suffix", [".yaml", ".lock", ".recipe", ""])
def test_names_with_control_characters_are_escaped(tmp_path: Path, command: str, suffix: str) -> None:
    """This applies to line breaks and escape codes, in all messages."""
    name = f"two\nlines\x1b[31m{suffix}"
    if suffix:
        (tmp_path / name).write_bytes(b"\x00")
    else:
        (tmp_path / name).mkdir()
    arguments = [command, name] + ([name] if command == "diff" else [])
    completed = run_here(*arguments, cwd=tmp_path)
    assert completed.returncode == 2, completed.stderr
    assert "\x1b" not in completed.stderr + completed.stdout
    first, *rest = completed.stderr.splitlines()
    assert first.startswith("error[") and r"two\nlines\x1b[31m" in completed.stderr
    assert all(re.match(r"help: |note: | *--> | *\d* \|", line) for line in rest), completed.stderr


@pytest.mark.parametrize(("stop", "code"), [(KeyboardInterrupt(), 130), (SystemExit(143), 143)], ids=repr)
def test_a_signal_within_a_serializer_is_not_reported_as_an_internal_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: BaseException, code: int
) -> None:
    """Pydantic replaces the exception of the signal with its own."""

    class Stopped(BaseModel):
        @model_serializer
        def stopped(self) -> None:
            raise stop

    monkeypatch.setattr(init.command, "callback", lambda **_: Stopped().model_dump())
    done = run_here("init", "small", cwd=tmp_path)
    assert done.returncode == code and "Traceback" not in done.stderr
    assert ("interrupted" in done.stderr) == (code == 130)
