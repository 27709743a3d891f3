"""Which files a command may overwrite, and which lockfile belongs to a recipe; its text is not part of the identity."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from recipe_cli import lockfile_paths
from recipe_cli.commands import (
    blueprints,
    build,
    diff,
    import_,
    init,
    lock,
    pack,
    schema,
    shot,
    surfaces,
    verify,
)
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import Code, InputError, Problem
from recipe_runtime.build import provenance
from recipe_runtime.cache import pruning

from tests.cli.test_commands import RECIPE
from tests.runtime.fakes import ENGINES
from tests.sources import ROOT

OTHER_PLAN = RECIPE.replace("HardRainNight", "WetNight")
_USED = (blueprints, build, diff, import_, init, lock, pack, schema, shot, surfaces, verify)
COMMANDS = {module.__name__.rpartition(".")[2]: module for module in _USED}
Run = Callable[..., Result]


@pytest.fixture
def recipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return a function that runs commands in this process, in an empty project and with fast engines."""
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(pruning, "auto_prune", lambda *_: None)
    for module in (build, lock, verify, shot):
        monkeypatch.setattr(module, "engines_for", lambda *_: ENGINES)
    for module in (build, lock, verify):
        monkeypatch.setattr(module, "worker_count", lambda *_: 0)

    def run(command: str, *arguments: str | Path) -> Result:
        return CliRunner().invoke(COMMANDS[command].command, [*map(str, arguments)], catch_exceptions=False)

    return run


def write(path: str, text: str) -> Path:
    place = Path(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(text)
    return place


def manifest(folder: str) -> dict[str, str]:
    found: dict[str, str] = json.loads((Path(folder) / "manifest.json").read_text())
    return found


@pytest.mark.slow
def test_the_dataset_of_another_recipe_is_not_replaced_without_replace(recipe: Run) -> None:
    write("a.yaml", RECIPE)
    write("b.yaml", OTHER_PLAN.replace("recipe: small", "recipe: other"))
    assert recipe("build", "a.yaml", "--out", "X").exit_code == 0
    before = manifest("X")
    with pytest.raises(
        InputError, match=r"X holds the dataset of another recipe, 'small', and this is 'other'.*or replace it"
    ) as caught:
        recipe("build", "b.yaml", "--out", "X")
    assert caught.value.problems[0].code is Code.OUTPUT_IN_THE_WAY
    assert manifest("X") == before
    assert recipe("build", "b.yaml", "--out", "X", "--replace").exit_code == 0
    assert manifest("X")["recipe"] == "other"


@pytest.mark.slow
def test_the_commands_in_a_datasets_readme_do_not_change_it(recipe: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    write("a.yaml", RECIPE)
    assert recipe("build", "a.yaml").exit_code == 0
    dataset = Path("datasets/small").resolve()
    text = (dataset / "README.md").read_text()
    commands = [line.split()[1:] for line in text.splitlines() if line.startswith("    recipe ")]
    assert [arguments[0] for arguments in commands] == ["verify", "build"]
    monkeypatch.chdir(dataset)
    before = sorted(dataset.rglob("*"))
    for _ in range(2):
        for arguments in commands:
            extra = (
                ["--integrity"] if arguments[0] == "verify" else []
            )  # (the remaining output is meaningless with these engines)
            assert recipe(*arguments, *extra).exit_code == 0
    assert manifest("../small-again") == manifest(".") and sorted(dataset.rglob("*")) == before


def test_a_recipe_whose_name_a_pack_does_not_allow_is_built_without_a_pack(recipe: Run) -> None:
    write("straße.yaml", RECIPE)
    built = recipe("build", "straße.yaml")
    assert "note: the dataset will not contain its recipe: 'straße.yaml' cannot be a file of a pack" in built.stderr
    assert built.exit_code == 0 and "recipe_file" not in manifest("datasets/small")


@pytest.mark.slow
def test_two_recipes_of_one_name_do_not_share_a_dataset(recipe: Run) -> None:
    write("a/r.yaml", RECIPE)
    write("b/r.yaml", OTHER_PLAN)
    assert recipe("build", "a/r.yaml").exit_code == 0
    first = manifest("datasets/small")
    with pytest.raises(
        InputError, match=r"the dataset of a/r\.yaml, another recipe that is named 'small' as b/r\.yaml"
    ):
        recipe("build", "b/r.yaml")
    assert manifest("datasets/small") == first
    assert recipe("build", "b/r.yaml", "--replace").exit_code == 0
    with pytest.raises(InputError, match="or replace it"):  # it belongs to b now
        recipe("build", "a/r.yaml")


@pytest.mark.slow
def test_a_recipe_replaces_its_own_dataset_after_every_edit(recipe: Run) -> None:
    """Also after a build of another recipe with an equal plan, and after the project was moved."""
    write("p/a.yaml", RECIPE)
    os.chdir("p")
    for text in (RECIPE, OTHER_PLAN, RECIPE.replace("seed: 1", "seed: 2")):
        write("a.yaml", text)
        assert recipe("build", "a.yaml").exit_code == 0
    write("copy/same.yaml", RECIPE.replace("seed: 1", "seed: 2"))
    assert "exists (sizes checked" in recipe("build", "copy/same.yaml").stdout
    os.chdir("..")
    Path("p").rename("q")
    os.chdir("q")
    write("a.yaml", RECIPE)
    assert recipe("build", "a.yaml").exit_code == 0


@pytest.mark.slow
def test_a_dataset_of_unknown_origin_is_not_replaced_without_replace(recipe: Run) -> None:
    write("a.yaml", RECIPE)
    assert recipe("build", "a.yaml", "--out", "downloaded").exit_code == 0
    provenance.record_path(Path("downloaded")).unlink()
    write("a.yaml", OTHER_PLAN)
    with pytest.raises(InputError, match=r"not known to be built from a\.yaml; .*or replace it"):
        recipe("build", "a.yaml", "--out", "downloaded")
    write("a.yaml", RECIPE)  # allowed: this recipe builds the same dataset
    assert recipe("build", "a.yaml", "--out", "downloaded").exit_code == 0
    write("a.yaml", OTHER_PLAN)
    assert recipe("build", "a.yaml", "--out", "downloaded").exit_code == 0


@pytest.mark.slow
def test_a_path_with_dots_through_the_dataset_is_replaced(recipe: Run) -> None:
    """While the dataset is renamed, such a path leads nowhere."""
    write("a.yaml", RECIPE)
    assert recipe("build", "a.yaml").exit_code == 0
    before = manifest("datasets/small")["plan"]
    write("a.yaml", OTHER_PLAN)
    assert recipe("build", "a.yaml", "--output", "datasets/small/preview/../../small").exit_code == 0
    assert manifest("datasets/small")["plan"] != before
    assert sorted(path.name for path in Path("datasets").iterdir()) == [".small.source.json", "small"]


@pytest.mark.parametrize(
    ("folder", "message"),
    [(".", "is the current folder or contains it"), ("/", "is a mount point")],
)
def test_a_folder_that_cannot_be_replaced_is_refused_before_the_work(
    recipe: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, message: str
) -> None:
    recipe_file = write("a.yaml", RECIPE).absolute()
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "out" / "cache"))
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty" if folder == "." else tmp_path)
    with pytest.raises(InputError, match=message):
        recipe("build", recipe_file, "--output", folder)
    assert not (tmp_path / "out").exists() and not list((tmp_path / "empty").iterdir())


def test_a_build_succeeds_if_the_record_of_its_recipe_cannot_be_written(
    recipe: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full or read-only: the dataset is complete, and no partial file is left beside it."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    write("a.yaml", RECIPE)
    with monkeypatch.context() as patch:
        patch.setattr(provenance, "write_atomic", full)
        assert recipe("build", "a.yaml", "--out", "sets/small").exit_code == 0
        assert "exists (sizes checked" in recipe("build", "a.yaml", "--out", "sets/small").stdout
    assert [p.name for p in Path("sets").iterdir()] == ["small"]
    assert recipe("build", "a.yaml", "--out", "sets/small").exit_code == 0
    assert provenance.record_path(Path("sets/small")).is_file()


def test_the_dataset_does_not_contain_the_path_of_the_recipe(recipe: Run) -> None:
    write("secret_place/small.yaml", RECIPE)
    assert recipe("build", "secret_place/small.yaml").exit_code == 0
    assert "secret_place" in provenance.record_path(Path("datasets/small")).read_text()
    for path in Path("datasets/small").rglob("*"):
        assert not path.is_file() or b"secret_place" not in path.read_bytes()


@pytest.mark.slow
def test_a_dataset_at_a_url_is_not_replaced_by_a_recipe_of_another_name(recipe: Run, tmp_path: Path) -> None:
    write("a.yaml", RECIPE)
    write("b.yaml", OTHER_PLAN.replace("recipe: small", "recipe: other"))
    url = f"file://{tmp_path}/there"
    assert recipe("build", "a.yaml", "--out", url).exit_code == 0
    before = manifest("there")
    with pytest.raises(InputError, match=r"holds the dataset of another recipe, 'small'.*or replace it"):
        recipe("build", "b.yaml", "--out", url)
    assert not Path("datasets/other").exists()  # reported before the work
    assert manifest("there") == before
    assert recipe("build", "b.yaml", "--out", url, "--replace").exit_code == 0


def test_two_recipes_of_one_name_do_not_share_a_lockfile(recipe: Run) -> None:
    write("a/r.yaml", RECIPE)
    write("b/r.yaml", OTHER_PLAN)
    assert recipe("lock", "a/r.yaml").exit_code == 0
    before = Path("lockfiles/small.lock").read_bytes()
    for command in (
        ["build"],
        ["build", "--locked"],
        ["build", "--frozen"],
        ["lock"],
        ["lock", "--update"],
        ["verify"],
    ):
        with pytest.raises(InputError, match=r"small\.lock is the lockfile of a/r\.yaml, another recipe that is named"):
            recipe(command[0], "b/r.yaml", *command[1:])
    with pytest.raises(InputError, match=r"a/r\.yaml and b/r\.yaml have one name, and so one lockfile"):
        recipe("lock", "a/r.yaml", "b/r.yaml", "--update")
    assert Path("lockfiles/small.lock").read_bytes() == before
    Path("b/lockfiles").mkdir()  # one of the two remedies: a project of its own
    assert recipe("lock", "b/r.yaml").stdout.startswith("b/lockfiles/small.lock written")
    assert recipe("lock", "a/r.yaml").stdout.startswith("lockfiles/small.lock is up to date")


def test_two_recipes_of_one_name_in_one_folder_get_remedies_that_can_be_followed(recipe: Run) -> None:
    write("lockfiles/.keep", "")
    write("a.yaml", RECIPE)
    write("b.yaml", OTHER_PLAN)
    recipe("lock", "a.yaml")
    with pytest.raises(InputError, match=r"another recipe that is named 'small' as b\.yaml") as caught:
        recipe("lock", "b.yaml")
    assert "create the folder" not in str(caught.value) and "another name (`recipe: NAME`); `recipe" in str(
        caught.value
    )


@pytest.mark.parametrize("marker", ["pyproject.toml", ".git", "lockfiles"])
def test_the_lockfile_is_searched_for_beside_the_recipe_and_in_its_project_only(tmp_path: Path, marker: str) -> None:
    (tmp_path / "lockfiles").mkdir()
    (tmp_path / "lockfiles" / "r.lock").touch()
    project = tmp_path / "project"
    (project / "recipes" / "deep").mkdir(parents=True)
    (project / marker).mkdir()
    recipe = project / "recipes" / "deep" / "r.yaml"
    recipe.touch()
    assert lockfile_paths.lockfile_path(recipe, "r").resolve() == project / "lockfiles" / "r.lock"
    (recipe.parent / "r.lock").touch()
    assert lockfile_paths.lockfile_path(recipe, "r").resolve() == recipe.parent / "r.lock"


@pytest.mark.slow
def test_a_comment_or_another_file_name_is_not_another_recipe(recipe: Run) -> None:
    write("small.yaml", RECIPE)
    assert recipe("lock", "small.yaml").exit_code == 0
    locked = Path("lockfiles/small.lock").read_bytes()
    write("renamed.yaml", f"# a remark\n\n{RECIPE}description: The same plan.\n")
    note = "renamed.yaml was locked as small.yaml, with another text; the plan is equal"
    verified = recipe("verify", "renamed.yaml", "--frames", "1")
    assert (verified.exit_code, verified.stdout.splitlines()[0]) == (0, "PASS  renamed.yaml"), verified.stdout
    assert f"  note: {note}" in verified.stdout.splitlines()
    for option in ("--locked", "--frozen"):
        built = recipe("build", "renamed.yaml", option)
        assert (built.exit_code, built.stderr) == (0, f"note: {note}\n")
    kept = recipe("lock", "renamed.yaml")
    assert kept.stdout.startswith(f"lockfiles/small.lock is up to date; {note} (--update records the new text)\n")
    assert Path("lockfiles/small.lock").read_bytes() == locked
    assert recipe("pack", "renamed.yaml").exit_code == 0
    assert "note" not in recipe("verify", "small.recipe", "--frames", "1").stdout  # a pack contains the current text
    write("plain.yaml", RECIPE)
    compared = recipe("diff", "plain.yaml", "renamed.yaml")
    assert (compared.exit_code, compared.stdout) == (0, "nothing differs\n")
    assert "the text of plain.yaml and renamed.yaml differs; the plan does not" in compared.stderr
    assert "written" in recipe("lock", "renamed.yaml", "--update").stdout
    assert "note" not in recipe("verify", "renamed.yaml", "--frames", "1").stdout


def test_the_lockfile_of_a_renamed_recipe_is_protected_from_others(recipe: Run) -> None:
    """Locking the renamed recipe records its new name, so that another recipe cannot replace the lockfile."""
    write("small.yaml", RECIPE)
    recipe("lock", "small.yaml")
    before = lockfile.read(Path("lockfiles/small.lock"))
    Path("small.yaml").rename("renamed.yaml")
    completed = recipe("lock", "renamed.yaml")
    says = "lockfiles/small.lock now names ../renamed.yaml; ../small.yaml, which it named, does not exist\n"
    assert (completed.exit_code, completed.stdout.startswith(says)) == (0, True), completed.stdout
    after = lockfile.read(Path("lockfiles/small.lock"))
    assert after.source == "../renamed.yaml" and set(after.files) == {"renamed.yaml"}
    assert after.equals_but_for_text(before) and after.identity == before.identity
    write("other.yaml", OTHER_PLAN)
    for arguments in (("lock", "other.yaml", "--update"), ("verify", "other.yaml"), ("build", "other.yaml")):
        with pytest.raises(InputError, match=r"small\.lock is the lockfile of renamed\.yaml, another recipe"):
            recipe(*arguments)
    assert recipe("verify", "lockfiles/small.lock", "--frames", "1").exit_code == 0
    assert recipe("build", "renamed.yaml", "--locked").exit_code == 0


def test_the_lockfile_of_a_renamed_recipe_is_protected_before_it_is_locked_again(recipe: Run) -> None:
    write("small.yaml", RECIPE)
    recipe("lock", "small.yaml")
    path = Path("lockfiles/small.lock")
    locked = path.read_bytes()
    Path("small.yaml").rename("renamed.yaml")
    write("other.yaml", OTHER_PLAN)
    with pytest.raises(InputError) as caught:
        recipe("lock", "other.yaml", "--update")
    (problem,) = caught.value.problems
    assert problem.message.startswith("lockfiles/small.lock is the lockfile of small.yaml, which does not exist")
    assert problem.help is not None and "`recipe lock NEW.yaml`" in problem.help and "--replace" in problem.help
    assert path.read_bytes() == locked
    assert "now names ../renamed.yaml" in recipe("lock", "renamed.yaml").stdout  # (the remedy works)
    Path("renamed.yaml").unlink()
    assert recipe("lock", "other.yaml", "--replace").exit_code == 0


@pytest.mark.parametrize("changed", [False, True])
def test_verify_continues_after_a_lockfile_whose_recipe_is_missing(recipe: Run, changed: bool) -> None:
    """The last lockfile is verified too, and a FAIL is not hidden."""
    write("first.yaml", RECIPE.replace("recipe: small", "recipe: aa"))
    write("second.yaml", RECIPE.replace("recipe: small", "recipe: bb"))
    recipe("lock", "first.yaml", "second.yaml")
    Path("first.yaml").unlink()
    if changed:
        write("second.yaml", OTHER_PLAN.replace("recipe: small", "recipe: bb"))
    for options in ([], ["--json"]):
        problems = (
            Problem(
                "lockfiles/aa.lock names first.yaml, which does not exist",
                help="if it was renamed: `recipe verify NEW.yaml`, then `recipe lock NEW.yaml --update`",
                code=Code.FILE_NOT_FOUND,
            ),
        )
        if changed:
            done = recipe("verify", "--frames", "1", *options)
            assert done.exit_code == 1
            if options:
                document = json.loads(done.stdout)
                assert [report["verdict"] for report in document["reports"]] == ["FAIL"]
                assert [error["message"] for error in document["errors"]] == [problems[0].message]
            else:
                assert done.stdout.startswith("FAIL at recipe  lockfiles/bb.lock")
                assert problems[0].message in done.stderr
        else:
            with pytest.raises(InputError) as caught:
                recipe("verify", "--frames", "1", *options)
            assert caught.value.problems == problems


def test_a_pack_cannot_be_locked(recipe: Run) -> None:
    write("small.yaml", RECIPE)
    recipe("pack", "small.yaml")
    with pytest.raises(InputError, match=r"small\.recipe is a pack; unpack it .*, lock the recipe and pack it again"):
        recipe("lock", "small.recipe")


def test_a_changed_plan_still_fails_and_names_the_file(recipe: Run) -> None:
    write("small.yaml", RECIPE)
    recipe("lock", "small.yaml")
    write("small.yaml", OTHER_PLAN)
    failed = recipe("verify", "small.yaml", "--frames", "1", "--json")
    (report,) = json.loads(failed.stdout)
    assert (failed.exit_code, report["stage"], report["notes"]) == (1, "recipe", [])
    with pytest.raises(InputError, match=r"small\.yaml has changed since it was locked"):
        recipe("build", "small.yaml", "--locked")


def test_no_command_overwrites_an_existing_file(recipe: Run, tmp_path: Path) -> None:
    write("small.yaml", RECIPE)
    precious = {name: write(name, "precious") for name in ("a.png", "a.json", "a.recipe", "f/blueprints.jpg")}
    cases = (
        (shot.command, ["small.yaml", "-o", "a.png"]),
        (schema.command, ["-o", "a.json"]),
        (pack.command, ["small.yaml", "-o", "a.recipe"]),
        (blueprints.command, ["vehicle.bicycle.b", "--pictures", "f"]),
    )
    for command, arguments in cases:
        remedy = (
            r"choose another folder \(--pictures\), or replace its files \(--replace\)"
            if command is blueprints.command
            else r"choose another file, or replace it"
        )
        with pytest.raises(InputError, match=rf"exists already; {remedy}$"):
            CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert {path.read_text() for path in precious.values()} == {"precious"}
    assert not Path("f/vehicle.bicycle.b.png").exists()
    for command, arguments in cases[:3]:
        assert CliRunner().invoke(command, [*arguments, "--replace"], catch_exceptions=False).exit_code == 0
    assert "precious" not in {precious[name].read_text(errors="replace") for name in ("a.png", "a.json", "a.recipe")}


def test_no_command_overwrites_a_file_of_the_recipe(recipe: Run) -> None:
    """Not even with --replace: the recipe, a file that it extends, and an image that it uses."""
    Path("wall.png").write_bytes((ROOT / "recipes" / "attacks" / "poster.png").read_bytes())
    Path("base.recipe").write_text(RECIPE + "assets: {wall: {image: wall.png}}\n")
    Path("small.lock").write_text("recipe: small\nextends: base.recipe\n")
    before = {path: path.read_bytes() for path in Path().glob("*.*")}
    cases = (
        ("pack", "base.recipe"), ("shot", "wall.png"), ("shot", "wall.png", "--map"), ("lock", None),
    )  # fmt: skip
    for command, output, *options in cases:
        outputs = [] if output is None else ["--output", output]
        with pytest.raises(InputError, match="is a file that the recipe uses"):
            recipe(command, "small.lock", "--replace", *outputs, *options)
    assert {path: path.read_bytes() for path in before} == before


def test_locking_two_recipes_overwrites_no_file_of_the_other(recipe: Run) -> None:
    base = write("lockfiles/other.lock", RECIPE)
    write("small.yaml", "recipe: small\nextends: lockfiles/other.lock\n")
    write("other.yaml", RECIPE.replace("recipe: small", "recipe: other"))
    with pytest.raises(InputError, match=r"other\.lock is a file that the recipe uses"):
        recipe("lock", "small.yaml", "other.yaml", "--replace")
    assert base.read_text() == RECIPE


def test_a_shot_without_a_name_gets_an_unused_one(recipe: Run) -> None:
    write("small.yaml", RECIPE)
    first = Path("small-weather=dry-street-rgb-000001.png")
    first.write_text("precious")
    for _ in range(2):  # an equal picture has the same name
        assert recipe("shot", "small.yaml").stdout.startswith("small-weather=dry-street-rgb-000001.2.png: ")
    assert first.read_text() == "precious"
    assert recipe("shot", "small.yaml", "--replace").stdout.startswith(f"{first}: ")
    assert first.read_bytes() == Path("small-weather=dry-street-rgb-000001.2.png").read_bytes()


def test_the_unfinished_build_of_another_recipe_is_not_discarded_without_replace(
    recipe: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.cli.test_stops import FRAMES, _stopping

    write("a.yaml", RECIPE.replace("frames: 2", f"frames: {FRAMES // 2}"))
    write("b.yaml", OTHER_PLAN.replace("recipe: small", "recipe: other"))
    with monkeypatch.context() as patched:
        from contextlib import nullcontext

        patched.setattr(build, "_runner", lambda ray: nullcontext(_stopping(1)))
        assert recipe("build", "a.yaml", "--out", "X").exit_code == 130
    with pytest.raises(InputError, match=r"unfinished work of 'small', and this is 'other'.*or replace it"):
        recipe("build", "b.yaml", "--out", "X")
    assert "10 resumed from the stopped build" in recipe("build", "a.yaml", "--out", "X").stdout


def test_a_file_in_place_of_a_parent_folder_is_an_error(recipe: Run) -> None:
    write("a.yaml", RECIPE)
    write("afile", "")
    for output in ("afile/sub", "afile/deep/sub"):
        with pytest.raises(InputError, match=r"/afile is a file; choose another folder") as caught:
            recipe("build", "a.yaml", "-o", output)
        assert caught.value.problems[0].code is Code.OUTPUT_IN_THE_WAY


def test_diff_suggests_no_update_of_the_lockfile_of_another_recipe(recipe: Run) -> None:
    """`recipe lock --update` with the second recipe would replace the lockfile of the first."""
    write("a.yaml", RECIPE)
    write("b.yaml", OTHER_PLAN)
    assert recipe("lock", "a.yaml").exit_code == 0
    found = recipe("diff", "a.yaml", "b.yaml")
    assert "lockfiles/small.lock is the lockfile of" in found.stderr and "--update" not in found.stderr
    write("a.yaml", OTHER_PLAN.replace("WetNight", "SoftRainNight"))
    assert "`recipe lock --update` updates it" in recipe("diff", "a.yaml", "b.yaml").stderr


@pytest.mark.parametrize("place", ["odd\udcff.yaml", "odd\udcff/a.yaml"])
def test_a_recipe_whose_path_is_not_utf_8_is_refused_before_the_work(recipe: Run, place: str) -> None:
    """Lockfiles, packs and records of datasets contain the path; they were not written, after all the work."""
    write(place, RECIPE)
    for command in (["build", place, "-o", "X"], ["lock", place], ["pack", place, "-o", "x.recipe"]):
        with pytest.raises(InputError, match=r"udcff\S*: the path of a recipe is recorded in UTF-8.*rename the file"):
            recipe(*command)
    assert not any(Path(name).exists() for name in ("X", "x.recipe", "lockfiles"))
