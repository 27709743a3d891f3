"""The same questions for every export format."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from recipe_cli.commands.export import command
from recipe_compiler.ir.errors import InputError
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer import formats
from recipe_runtime.transfer.export import INDEX, export

from tests.runtime.fakes import quiet, tree
from tests.sources import ROOT

every_format = pytest.mark.parametrize("name", formats.FORMATS)


@pytest.mark.slow
@every_format
def test_equal_datasets_give_equal_exports(attacked: Dataset, tmp_path: Path, name: str) -> None:
    """The index lists exactly the files, with size and digest. An existing export is not written again."""
    ticks: list[tuple[str, int, int]] = []
    made = export(attacked, tmp_path / "a", name, lambda *tick: ticks.append(tick))
    assert ticks[-1] == ("export", 12, 12)
    copy = tmp_path / "elsewhere" / "copy"
    shutil.copytree(attacked.root, copy)
    export(read(copy), tmp_path / "b", name, quiet)
    files = tree(tmp_path / "a")
    assert tree(tmp_path / "b") == files
    assert json.loads(files.pop(INDEX)) == json.loads(json.dumps(made.index))
    assert made.index["dataset"] == attacked.lock.identity
    listed = {row["file"]: (row["size"], row["sha256"]) for row in made.rows}
    assert listed == {path: (len(body), hashlib.sha256(body).hexdigest()) for path, body in files.items()}
    assert made.size == sum(map(len, files.values()))
    inodes = [path.stat().st_ino for path in (tmp_path / "a").rglob("*")]
    assert export(attacked, tmp_path / "a", name, quiet).index == made.index
    assert [path.stat().st_ino for path in (tmp_path / "a").rglob("*")] == inodes


@pytest.mark.slow
@every_format
def test_a_changed_export_is_replaced_only_on_request(attacked: Dataset, tmp_path: Path, name: str) -> None:
    """So are the export of another format, and files of the user, which are kept."""
    whole = export(attacked, tmp_path / "out", name, quiet)
    before = tree(tmp_path / "out")
    largest = max((path for path in (tmp_path / "out").rglob("*") if path.is_file()), key=lambda p: p.stat().st_size)
    largest.write_bytes(bytes(largest.stat().st_size))
    with pytest.raises(InputError, match="exists already, and is not this export"):
        export(attacked, tmp_path / "out", name, quiet)
    assert export(attacked, tmp_path / "out", name, quiet, replace=True).index == whole.index
    assert tree(tmp_path / "out") == before
    shutil.rmtree(tmp_path / "out.replaced")
    other = next(other for other in formats.FORMATS if other != name)
    with pytest.raises(InputError, match="exists already, and is not this export"):
        export(attacked, tmp_path / "out", other, quiet)
    export(attacked, tmp_path / "out", other, quiet, replace=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
@every_format
@pytest.mark.parametrize("damage", ["bytes", "missing", "link", "labels"])
def test_a_damaged_dataset_is_not_exported(attacked: Dataset, tmp_path: Path, name: str, damage: str) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(attacked.root, copy)
    dataset, variant = read(copy), attacked.plan.variants[0].variant
    victim = copy / layout.frame_file(variant, "street", "rgb", 2, attacked.plan.forms)
    if damage == "labels":
        victim = copy / layout.labels_file(variant, "street")
    body = victim.read_bytes()
    victim.unlink()  # it may be a hard link
    if damage == "link":
        victim.symlink_to("/etc/hostname")
    elif damage != "missing":
        victim.write_bytes(body[:-40] + b"?" + body[-39:])
    with pytest.raises(InputError, match="repair the dataset, then export it"):
        export(dataset, tmp_path / "out", name, quiet)
    assert [path.name for path in tmp_path.iterdir()] == ["copy"]


@pytest.mark.slow
@every_format
def test_the_command_exports_and_reports(attacked: Dataset, tmp_path: Path, name: str) -> None:
    call = [str(attacked.root), str(tmp_path / "out"), "--format", name]
    done = CliRunner().invoke(command, call, catch_exceptions=False)
    index = json.loads((tmp_path / "out" / INDEX).read_text())
    size = sum(len(body) for path, body in tree(tmp_path / "out").items() if path != INDEX)
    assert done.exit_code == 0 and done.stdout.splitlines()[-1] == index["dataset"]
    report = json.loads(CliRunner().invoke(command, [*call, "--json"], catch_exceptions=False).stdout)
    assert (report["dataset"], report["format"], report["bytes"]) == (index["dataset"], index["format"], size)


def test_the_help_imports_no_format() -> None:
    code = "import sys; from recipe_cli.commands.export import command; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "pydantic", "recipe_runtime.transfer.formats.format"} & {*loaded}


@every_format
def test_the_help_and_the_documentation_describe_it(name: str) -> None:
    text = CliRunner().invoke(command, ["--help"], terminal_width=2000, max_content_width=2000).stdout
    assert f"{name}: {formats.FORMATS[name].help}" in text
    assert f"- [`{name}`](dataset.md#{name}): {formats.FORMATS[name].help}." in (ROOT / "docs/cli.md").read_text()
    assert f"\n### {name}\n" in (ROOT / "docs/dataset.md").read_text()


@every_format
def test_options_are_refused_by_formats_that_do_not_take_them(tmp_path: Path, name: str) -> None:
    for option in formats.options():
        if option not in formats.FORMATS[name].options:
            call = [str(tmp_path), str(tmp_path / "out"), "--format", name, f"--{option.name}", "1"]
            done = CliRunner().invoke(command, call)
            assert (done.exit_code, f"--{option.name} needs --format " in done.output) == (2, True)
