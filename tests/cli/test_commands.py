"""Commands: what each one prints, where, and with which exit code."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image
from recipe_cli.main import COMMANDS
from recipe_compiler.ir import lockfile

from tests.cli.reading import problems
from tests.cli.runner import run_here

# By night: the sun's shadows take three quarters of the time of a small build.
RECIPE = """\
recipe: small
seed: 1
base:
  clock: {fps: 10, frames: 2}
  town: {name: downtown, blocks: [1, 1]}
  weather: ClearNight
  actors:
    walker: {blueprint: walker.pedestrian.*, start: {x: -4, y: 1, yaw: -90}, goal: {x: -4, y: -9}}
  sensors:
    street: {mount: {x: -7, y: -3, z: 1.7, yaw: 40}, camera: {width: 64, height: 48}, capture: [rgb, depth, instance]}
deltas:
  weather: {dry: {}, wet: {weather: HardRainNight}}
"""


def run(*arguments: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "recipe_cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, **environment},
        timeout=300,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recipe, its lockfile and its dataset."""
    root = tmp_path_factory.mktemp("project")
    (root / "small.yaml").write_text(RECIPE)
    locked = run_here("lock", "small.yaml", "--workers", "1", cwd=root)
    assert locked.returncode == 0, locked.stderr
    built = run_here("build", "small.yaml", "--workers", "1", cwd=root)
    assert built.returncode == 0, built.stderr
    return root


def test_help_lists_every_command(tmp_path: Path) -> None:
    shown = run("--help", cwd=tmp_path)
    assert all(f"  {name} " in shown.stdout for name in COMMANDS)
    imported = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "recipe_cli", "--help"], capture_output=True, text=True
    ).stderr
    for heavy in ("numpy", "warp", "pybullet", "pydantic", "yaml", "PIL"):
        assert f" {heavy}\n" not in imported, f"--help imports {heavy}"


def test_recipe_alone_prints_its_help_as_plain_text(tmp_path: Path) -> None:
    done = run(cwd=tmp_path)
    lines = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert lines[0].startswith("Usage: recipe [OPTIONS] COMMAND") and "Commands:" in lines
    assert "error[" not in done.stderr and "\\n" not in done.stderr


def test_a_mistyped_command_gets_a_suggestion(tmp_path: Path) -> None:
    shown = run("biuld", cwd=tmp_path)
    assert (shown.returncode, shown.stdout) == (2, "")
    assert problems(shown.stderr) == ["no such command 'biuld'; did you mean 'build'?"]


@pytest.mark.parametrize("command", ["plan", "build", "check", "shot", "lock", "pack", "export", "diff"])
def test_a_url_instead_of_a_path_is_refused_without_showing_its_password(command: str, tmp_path: Path) -> None:
    url = "ftp://user:secret@host/x.yaml"
    shown = run_here(command, url, url, cwd=tmp_path)
    assert shown.returncode == 2
    assert "ftp://user:***@host/x.yaml is a URL; copy what is there to this host" in problems(shown.stderr)[0]
    assert "secret" not in shown.stdout + shown.stderr


@pytest.mark.slow
def test_lock_build_and_verify_print_the_same_identity(folder: Path) -> None:
    locked = run_here("lock", "small.yaml", cwd=folder)
    built = run_here("build", "small.yaml", cwd=folder)
    verified = run_here("verify", "small.yaml", cwd=folder)
    identity = built.stdout.splitlines()[-1]
    assert identity.startswith("small@sha256:")
    assert identity in locked.stdout
    assert identity in verified.stdout
    assert "is up to date" in locked.stdout
    assert "exists (sizes checked; `recipe verify datasets/small` checks bytes, --repair repairs it)" in built.stdout
    assert (verified.returncode, verified.stdout[:4]) == (0, "PASS")


@pytest.mark.slow
@pytest.mark.parametrize("target", ["small.yaml", "lockfiles/small.lock", "datasets/small", None])
def test_verify_takes_recipes_lockfiles_datasets_or_nothing(folder: Path, target: str | None) -> None:
    done = run_here("verify", *([target] if target else []), "--frames", "2", "--workers", "1", "--json", cwd=folder)
    (report,) = json.loads(done.stdout)
    assert (done.returncode, report["verdict"], report["checked"], report["total"]) == (0, "PASS", 2, 4)
    assert done.stderr == ""


@pytest.mark.slow
def test_verify_fails_on_a_flipped_digit_of_the_lockfile(folder: Path, tmp_path: Path) -> None:
    text = (folder / "lockfiles" / "small.lock").read_text()
    (tmp_path / "small.yaml").write_text(RECIPE)
    (tmp_path / "lockfiles").mkdir()
    row = next(line for line in text.splitlines() if line.startswith("frame ") and " rgb " in line)
    flipped = row[:-1] + ("0" if row[-1] != "0" else "1")
    (tmp_path / "lockfiles" / "small.lock").write_text(text.replace(row, flipped))
    done = run_here("verify", "small.yaml", "--all", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout.startswith("FAIL at lockfile")
    assert "shading: weather=" in done.stdout
    assert "-rendered.png" in done.stdout


@pytest.mark.slow
def test_verify_is_inconclusive_on_another_stage_version(folder: Path, tmp_path: Path) -> None:
    from recipe_compiler.ir import lockfile

    (tmp_path / "small.yaml").write_text(RECIPE)
    lock = lockfile.read(folder / "lockfiles" / "small.lock")
    lock.stages["shade"], lock.tools["dataset-recipe"] = 2, "99.0"
    first = next(key for key in lock.frames if key[2] == "rgb")
    lock.frames[first] = "0" * 64
    lock.write(tmp_path / "lockfiles" / "small.lock")
    done = run_here("verify", "small.yaml", "--all", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 3
    assert done.stdout.startswith("INCONCLUSIVE at shading")


@pytest.mark.slow
def test_a_shot_equals_the_frame_of_the_build(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "shot.png"
    done = run_here("shot", "small.yaml", "--variant", "weather=wet", "--frame", "1", "-o", out, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert out.read_bytes() == (folder / "datasets/small/weather=wet/street/rgb/000001.png").read_bytes()
    assert answer["digest"] in (folder / "lockfiles" / "small.lock").read_text()
    for modality in ("depth", "instance"):
        assert (
            run_here("shot", "small.yaml", "--modality", modality, "-o", out, "--replace", cwd=folder).returncode == 0
        )
        with Image.open(out) as picture:
            assert (picture.size, picture.mode) == ((64, 48), "RGB")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--variant", "weather=wett"], "small has no variant 'weather=wett'; did you mean 'weather=wet'?"),
        (["--sensor", "roof"], "the rig has no sensor 'roof'; it has street"),
        (["--frame", "9"], "frame 9 does not exist: weather=dry has 2 frames; choose a frame from 0 to 1"),
        (["--modality", "semantic"], "the sensor street does not capture 'semantic'; it captures rgb, depth, instance"),
    ],
)
def test_a_shot_of_an_unknown_name_lists_the_valid_ones(folder: Path, arguments: list[str], says: str) -> None:
    done = run_here("shot", "small.yaml", *arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert says in problems(done.stderr)[0]
    assert "Traceback" not in done.stderr


def test_plan_shows_cost_and_sharing_and_prints_a_variant(folder: Path) -> None:
    shown = run_here("plan", "small.yaml", cwd=folder)
    assert "2 variants: 1 simulation, 1 observation, 2 appearances" in shown.stdout
    assert "4 frames, 12 images" in shown.stdout
    document = json.loads(run_here("plan", "small.yaml", "--json", cwd=folder).stdout)
    assert [v["name"] for v in document["variants"]] == ["weather=dry", "weather=wet"]
    plan = json.loads(run_here("plan", "small.yaml", "--variant", "weather=wet", cwd=folder).stdout)
    assert plan == json.loads((folder / "datasets/small/plans/weather=wet.json").read_text())


def test_check_reports_every_mistake_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(RECIPE.replace("fps: 10", "fps: 7").replace("town:", "twon:"))
    done = run_here("check", "bad.yaml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    lines = problems(done.stderr)
    assert [line.split(" ")[0] for line in lines] == ["bad.yaml:4:3:", "bad.yaml:4:16:", "bad.yaml:5:3:"]
    answer = json.loads(run_here("check", "bad.yaml", "--json", cwd=tmp_path).stdout)
    assert [p["line"] for p in answer["problems"]] == [4, 4, 5]


def test_a_new_recipe_compiles_and_is_never_overwritten(tmp_path: Path) -> None:
    assert run_here("init", "rain_bench", cwd=tmp_path).returncode == 0
    assert run_here("check", "rain_bench.yaml", cwd=tmp_path).returncode == 0
    again = run_here("init", "rain_bench", cwd=tmp_path)
    assert again.returncode == 2
    assert "exists already" in again.stderr
    assert run_here("init", "../x", cwd=tmp_path).returncode == 2


def test_the_schema_is_json(tmp_path: Path) -> None:
    schema = json.loads(run_here("schema", cwd=tmp_path).stdout)
    assert schema["properties"]["recipe"]
    assert run_here("schema", "-o", "s.json", cwd=tmp_path).returncode == 0
    assert json.loads((tmp_path / "s.json").read_text()) == schema


@pytest.mark.slow
def test_a_build_that_differs_from_its_lockfile_reports_it(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(RECIPE.replace("seed: 1", "seed: 2"))
    (tmp_path / "lockfiles").mkdir()
    (tmp_path / "lockfiles" / "small.lock").write_text((folder / "lockfiles" / "small.lock").read_text())
    done = run_here("build", "small.yaml", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 1
    warning, first = problems(done.stderr)[:2]
    assert warning.startswith("warning: lockfiles/small.lock is outdated: small.yaml has changed since it was locked;")
    assert first.startswith("small.lock: recipe: small.yaml has changed since it was locked")
    assert (tmp_path / "datasets" / "small" / "manifest.json").is_file()


def test_an_outdated_lockfile_is_reported_before_the_work(folder: Path, tmp_path: Path) -> None:
    """Otherwise a long build would end with `differs`; the warning is printed even if the build cannot start."""
    root = _project(folder, tmp_path, "lockfiles")
    (root / "small.yaml").write_text(RECIPE.replace("HardRainNight", "WetNight"))
    (root / "mine").mkdir()
    (root / "mine" / "thesis.txt").touch()
    warning, refusal = problems(run_here("build", "small.yaml", "--out", "mine", cwd=root).stderr)
    assert warning.startswith("warning: lockfiles/small.lock is outdated: small.yaml has changed since it was locked;")
    assert refusal.endswith("or replace it (--replace)")
    (root / "small.yaml").write_text(RECIPE)
    (refusal,) = problems(run_here("build", "small.yaml", "--out", "mine", cwd=root).stderr)


@pytest.mark.slow
def test_a_partial_rebuild_reports_rendered_and_reused_frames(folder: Path, tmp_path: Path) -> None:
    """Otherwise a rebuild of one weather would look as if all frames had been rendered, or none."""
    root = _project(folder, tmp_path, "small.yaml")
    first = run_here("build", "small.yaml", "--workers", "1", cwd=root).stdout.splitlines()[0]
    whole = r"datasets/small: 2 variants: 1 simulation, 1 observation, 2 appearances; 4 frames rendered in .* a second"
    assert re.fullmatch(whole, first), first
    (root / "small.yaml").write_text(RECIPE.replace("HardRainNight", "WetNight"))
    completed = run_here("build", "small.yaml", "--workers", "1", cwd=root).stdout.splitlines()[0]
    part = r"datasets/small: 2 variants; 4 frames: 2 rendered, 2 reused from the existing dataset; [0-9.]+ s"
    assert re.fullmatch(part, completed), completed
    only_dry = RECIPE.replace("{dry: {}, wet: {weather: HardRainNight}}", "{dry: {}}")
    (root / "small.yaml").write_text(only_dry)
    less = json.loads(run_here("build", "small.yaml", "--json", cwd=root).stdout)
    assert (less["made_frames"], less["taken_frames"], less["resumed_frames"]) == (0, 2, 0)


@pytest.mark.slow
def test_no_output_of_engines_reaches_the_terminal(folder: Path, tmp_path: Path) -> None:
    """No banner of an engine, no warning and, when piped, no progress bar, even with an empty kernel cache."""
    done = run("verify", "small.yaml", "--frames", "1", "--workers", "1", cwd=folder)
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 3


@pytest.mark.parametrize("source", ["/etc/passwd", "../../etc/passwd", "../..", "a%00b"])
def test_an_untrusted_lockfile_reads_nothing_outside_its_folder(folder: Path, tmp_path: Path, source: str) -> None:
    from dataclasses import replace

    from recipe_compiler.ir import lockfile

    lock = replace(lockfile.read(folder / "lockfiles" / "small.lock"), source=source.replace("%00", "\0"))
    lock.write(tmp_path / "lockfiles" / "evil.lock")
    done = run_here("verify", "lockfiles/evil.lock", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "is not a file of the folder" in done.stderr
    assert "root:" not in done.stderr


def test_lock_reports_a_differing_lockfile_before_rendering(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(RECIPE.replace("frames: 2", "frames: 20000"))
    (tmp_path / "lockfiles").mkdir()
    (tmp_path / "lockfiles" / "small.lock").write_text((folder / "lockfiles" / "small.lock").read_text())
    done = run_here("lock", "small.yaml", cwd=tmp_path)  # rendering 40,000 frames would take an hour
    assert done.returncode == 2
    assert "differs from what small.yaml compiles to now; --update replaces it" in problems(done.stderr)[0]


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_stopped_command_leaves_no_files(tmp_path: Path, number: int, code: int) -> None:
    (tmp_path / "small.yaml").write_text(RECIPE.replace("frames: 2", "frames: 3000"))
    (tmp_path / "tmp").mkdir()
    child = subprocess.Popen(
        [sys.executable, "-m", "recipe_cli", "lock", "small.yaml", "--workers", "1"],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path / "tmp")},
        stderr=subprocess.PIPE,
        text=True,
    )
    while not any((tmp_path / "tmp").iterdir()):
        assert child.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)
    child.send_signal(number)
    _, errors = child.communicate(timeout=30)
    assert child.returncode == code
    assert "Traceback" not in errors
    assert list((tmp_path / "tmp").iterdir()) == []
    assert not (tmp_path / "lockfiles" / "small.lock").exists()


def test_diff_names_the_first_cause(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text(RECIPE.replace("HardRainNight", "SoftRainNight"))
    completed = run_here("diff", "small.yaml", tmp_path / "other.yaml", cwd=folder)
    assert completed.returncode == 1
    first, second = completed.stdout.splitlines()[:2]
    assert first == "recipe: small.yaml and other.yaml differ"
    assert second == "plan: weather=wet: appearance.weather.cloudiness: 100.0 and 60.0"
    for pair in (("datasets/small", "lockfiles/small.lock"), ("small.yaml", "datasets/small")):
        same = run_here("diff", *pair, cwd=folder)
        assert (same.returncode, same.stdout) == (0, "nothing differs\n"), same.stdout
        assert same.stderr.splitlines() == [
            "datasets/small was compared by its manifest; `recipe verify` checks the files themselves"
        ]  # motion and pixels were compared too, by the recipe's lockfile


def test_diff_ignores_an_outdated_lockfile_with_a_note(folder: Path, tmp_path: Path) -> None:
    """Digests of an earlier recipe must not be used for the current one."""
    root = _project(folder, tmp_path, "lockfiles", "datasets")
    (root / "small.yaml").write_text(RECIPE.replace("HardRainNight", "WetNight"))
    completed = run_here("diff", "small.yaml", "datasets/small", cwd=root)
    aside, silent, _ = completed.stderr.splitlines()
    assert aside.startswith(
        "lockfiles/small.lock is not what small.yaml compiles to now, so small.yaml is compared without it; "
    )
    assert silent == "motion and pixels were not compared: small.yaml holds none"


def test_diff_of_an_unknown_path_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("[]")
    for path in ("plan.json", "gone.lock", "gone.yaml", "."):
        completed = run_here("diff", path, "plan.json", cwd=tmp_path)
        assert completed.returncode == 2 and len(problems(completed.stderr)) == 1, completed.stderr


def test_the_cache_is_shown_and_pruned(tmp_path: Path) -> None:
    from recipe_runtime.cache.store import Store

    Store(tmp_path / "cache").put("traces", "ab" * 32, b"x" * 2000)
    places = {
        "RECIPE_CACHE": str(tmp_path / "cache"),
        "RECIPE_KERNEL_CACHE": "",
    }  # (the user's own cache is not pruned)
    assert "traces        1  2 KiB" in run_here("cache", cwd=tmp_path, **places).stdout
    completed = json.loads(run_here("cache", "--prune", "--size", "0", "--json", cwd=tmp_path, **places).stdout)
    assert (completed["removed"], completed["kinds"]) == (1, {})
    refused = run_here("cache", "--size", "3", cwd=tmp_path, **places)
    assert (refused.returncode, problems(refused.stderr)) == (2, ["--size says how much --prune leaves; give both"])


@pytest.mark.parametrize("options", [[], ["--prune", "--size", "0"]])
def test_a_folder_that_is_not_a_cache_is_neither_shown_nor_pruned(tmp_path: Path, options: list[str]) -> None:
    theirs = tmp_path / "backup" / "data" / "ab" / ("ab" * 32)
    theirs.parent.mkdir(parents=True)
    theirs.write_text("theirs")
    completed = run_here("cache", *options, cwd=tmp_path, RECIPE_CACHE=str(tmp_path / "backup"), RECIPE_KERNEL_CACHE="")
    assert completed.returncode == 2 and completed.stdout == ""
    assert f"RECIPE_CACHE {tmp_path}/backup: it holds data, which is not of a cache" in completed.stderr
    assert "set RECIPE_CACHE to an empty folder" in completed.stderr
    assert theirs.read_text() == "theirs"


@pytest.mark.slow
def test_traces_are_stored_beside_the_lockfile_on_request(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "lockfiles").mkdir()
    for name in ("small.yaml", "lockfiles/small.lock"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    assert run_here("lock", "small.yaml", "--with-traces", cwd=tmp_path).returncode == 0
    kept = tmp_path / "lockfiles" / "small.traces"
    assert kept.read_bytes().startswith(b"recipe-traces 1\n")
    kept.write_bytes(b"recipe-traces 1\n" + b"0" * 100)
    refused = run_here("verify", "small.yaml", cwd=tmp_path)
    assert (refused.returncode, "small.traces: cannot be used" in refused.stderr) == (2, True)
    assert run_here("lock", "small.yaml", "--update", cwd=tmp_path).returncode == 0  # the existing file is updated
    assert run_here("verify", "small.yaml", cwd=tmp_path).returncode == 0


def _project(folder: Path, root: Path, *names: str) -> Path:
    """Copy some files of a project."""
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        if (folder / name).is_dir():
            shutil.copytree(folder / name, root / name)
        else:
            shutil.copy(folder / name, root / name)
    return root


@pytest.mark.slow
def test_the_explanation_of_a_finished_dataset(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "small.yaml", "datasets")
    again = run_here("build", "small.yaml", "--explain", cwd=root)
    assert again.stdout.startswith("skip all stages: the dataset exists\n")
    document = json.loads(run_here("build", "small.yaml", "--explain", "--json", cwd=root).stdout)
    assert document["explain"] == ["skip all stages: the dataset exists"]


@pytest.mark.slow
def test_a_locked_build_refuses_a_changed_recipe(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "small.yaml", "lockfiles")
    (root / "small.yaml").write_text(RECIPE.replace("wet: {", "misty: {weather: {fog_density: 20}}, wet: {"))
    refused = run_here("build", "small.yaml", "--locked", cwd=root)
    assert refused.returncode == 2 and not (root / "datasets").exists()
    assert "variant weather=misty is in the recipe only" in refused.stderr
    frozen = run_here("build", "small.yaml", "--frozen", "--workers", "1", cwd=root)
    assert frozen.returncode == 0, frozen.stderr
    assert "2 of 3 variants; 4 frames" in frozen.stdout
    assert not (root / "datasets" / "small" / "weather=misty").exists()
    verified = run_here("verify", "datasets/small", "--integrity", cwd=root)  # it holds no recipe of more variants
    assert verified.returncode == 0, verified.stdout
    (root / "small.yaml").write_text(RECIPE.replace("wet: {weather: HardRainNight}", "wet: {weather: WetNight}"))
    for option in ("--locked", "--frozen"):
        refused = run_here("build", "small.yaml", option, cwd=root)
        assert refused.returncode == 2 and "weather=wet: different appearance plan" in refused.stderr


@pytest.mark.slow
def test_a_build_compares_the_bodies_of_its_lockfile(folder: Path, tmp_path: Path) -> None:
    """The identity does not cover them, and the lockfile becomes part of the dataset, which verification refuses."""
    root = _project(folder, tmp_path, "small.yaml", "lockfiles")
    lock = lockfile.read(root / "lockfiles" / "small.lock")
    (key, motion), *_ = lock.bodies.items()
    forged = dataclasses.replace(lock, bodies={**lock.bodies, key: dataclasses.replace(motion, digest="0" * 64)})
    (root / "lockfiles" / "small.lock").write_text(forged.dumps())
    done = run_here("build", "small.yaml", "--locked", "--workers", "1", cwd=root)
    assert (done.returncode, f"small.lock: trace: body {key[1]}: its row contradicts" in done.stderr) == (1, True)


def test_a_locked_build_needs_a_lockfile(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "small.yaml")
    refused = run_here("build", "small.yaml", "--locked", cwd=root)
    assert (refused.returncode, "there is no lockfile; `recipe lock` writes it" in problems(refused.stderr)[0]) == (
        2,
        True,
    )


@pytest.mark.slow
def test_integrity_hashes_files_and_renders_nothing(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "datasets")
    dataset = root / "datasets" / "small"
    clean = run_here("verify", "datasets/small", "--integrity", "--nonce", "1", cwd=root)
    assert (clean.returncode, "files hashed, no frame rendered" in clean.stdout) == (0, True)
    assert "the identity covers pixels and labels, which were not compared" in clean.stdout
    url = f"file://{dataset}"
    again = run_here("verify", url, "--integrity", "--nonce", "1", cwd=root)
    assert again.stdout == clean.stdout.replace("datasets/small", url)
    held = run_here("verify", "small.yaml", "--against", url, "--frames", "1", cwd=folder)
    assert (held.returncode, held.stderr) == (0, "")
    picture = dataset / "weather=dry" / "street" / "rgb" / "000001.png"
    picture.write_bytes(picture.read_bytes()[:-1] + b"!")
    assert run_here("verify", url, "--integrity", cwd=root).returncode == 1
    spoiled = run_here("verify", "datasets/small", "--integrity", cwd=root)
    assert (spoiled.returncode, "000001.png" in spoiled.stdout) == (1, True)
    assert run_here("verify", "small.yaml", "--integrity", cwd=folder).returncode == 2


@pytest.mark.slow
def test_a_damaged_file_of_equal_size_is_detected_and_repaired(folder: Path, tmp_path: Path) -> None:
    """It is detected by its bytes; the repaired dataset has the identity and the bytes of the original one."""
    root = _project(folder, tmp_path, "small.yaml", "lockfiles", "datasets")
    picture = root / "datasets/small/weather=dry/street/rgb/000001.png"
    body = picture.read_bytes()
    picture.write_bytes(body[:-20] + bytes([body[-20] ^ 1]) + body[-19:])
    there = run_here("build", "small.yaml", cwd=root)
    assert (there.returncode, "exists (sizes checked" in there.stdout) == (0, True)
    assert run_here("verify", "datasets/small", "--integrity", cwd=root).returncode == 1
    repaired = run_here("build", "small.yaml", "--repair", "--workers", "1", cwd=root)
    assert (repaired.returncode, repaired.stderr) == (0, "")
    first, *_, last = repaired.stdout.splitlines()
    assert first == "repaired: weather=dry/street/rgb/000001.png differs from its SHA-256 in the manifest"
    assert last == there.stdout.splitlines()[-1]
    assert picture.read_bytes() == body
    assert run_here("verify", "datasets/small", "--integrity", cwd=root).returncode == 0
    url = run_here("build", "small.yaml", "--repair", "--out", "memory://x/y", cwd=root)
    assert (url.returncode, "--repair repairs a folder, not memory://x/y" in url.stderr) == (2, True)


@pytest.mark.slow
def test_any_dataset_can_be_compared_with_a_recipe(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "small.yaml", "datasets", "lockfiles")
    there = root / "downloaded"
    (root / "datasets" / "small").rename(there)
    same = run_here("verify", "small.yaml", "--against", "downloaded", "--all", cwd=root)
    assert (same.returncode, same.stdout.splitlines()[0]) == (0, "PASS  small.yaml"), same.stdout
    (root / "other.yaml").write_text(RECIPE.replace("y: 1, yaw", "y: 2, yaw").replace("recipe: small", "recipe: other"))
    other = run_here("verify", "other.yaml", "--against", "downloaded", cwd=root)
    assert other.returncode == 1
    assert "plan: weather=dry: different scene plan" in other.stdout
    assert run_here("verify", "small.yaml", "other.yaml", "--against", "downloaded", cwd=root).returncode == 2


@pytest.mark.slow
def test_a_pack_replaces_its_recipe(folder: Path, tmp_path: Path) -> None:
    packed = run_here("pack", "small.yaml", "-o", tmp_path / "small.recipe", cwd=folder)
    assert packed.returncode == 0, packed.stderr
    again = run_here("pack", "small.yaml", "-o", tmp_path / "again.recipe", cwd=folder)
    assert again.stdout.split()[-1] == packed.stdout.split()[-1]
    assert run_here("check", "small.recipe", cwd=tmp_path).stdout == "small.recipe: valid, 2 variants\n"
    verified = run_here("verify", "small.recipe", "--all", cwd=tmp_path)
    assert (verified.returncode, verified.stdout.splitlines()[0]) == (0, "PASS  small.recipe")
    built = run_here("build", "small.recipe", "--workers", "1", cwd=tmp_path)
    assert built.stdout.splitlines()[-1] == verified.stdout.splitlines()[1].strip()
    shown = run_here("diff", "small.recipe", folder / "lockfiles" / "small.lock", cwd=tmp_path)
    assert (shown.returncode, shown.stdout) == (0, "nothing differs\n"), shown.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.recipe", "datasets", "small.recipe"]


def test_pack_refuses_a_lockfile_or_traces_that_differ(folder: Path, tmp_path: Path) -> None:
    root = _project(folder, tmp_path, "small.yaml", "lockfiles")
    assert run_here("pack", "small.yaml", "--with-traces", cwd=root).returncode == 2
    (root / "small.yaml").write_text(RECIPE.replace("HardRainNight", "WetNight"))
    refused = run_here("pack", "small.yaml", cwd=root)
    assert (refused.returncode, "`recipe lock --update` first" in problems(refused.stderr)[0]) == (2, True)
    (root / "bad.recipe").write_bytes(b"PK")
    for command in ("build", "verify", "plan", "check", "shot"):
        assert run_here(command, "bad.recipe", cwd=root).returncode == 2
