"""Exports to stores: complete or without an index, equal to those in a folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest
from click.testing import CliRunner
from recipe_cli.commands.export import command
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import INDEX, export
from recipe_runtime.transfer.export_upload import ExportTarget
from recipe_runtime.transfer.stores import Store

from tests.runtime.fakes import quiet, tree
from tests.runtime.transfer.test_upload import remote_files

URL = "memory://bucket/small"


@pytest.fixture(autouse=True)
def _empty_store() -> Iterator[None]:
    yield
    fsspec.filesystem("memory").store.clear()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["memory", "file"])
def test_the_command_writes_to_a_store(tiny: Dataset, tmp_path: Path, scheme: str) -> None:
    url = URL if scheme == "memory" else f"file://{tmp_path}/remote"
    export(tiny, tmp_path / "here", "mot", quiet)
    call = [str(tiny.root), "--output", url, "--format", "mot"]
    for _ in range(2):
        done = CliRunner().invoke(command, call, catch_exceptions=False)
        assert done.exit_code == 0 and done.stdout.splitlines()[-1] == tiny.lock.identity
        assert remote_files(url) == tree(tmp_path / "here")
    assert json.loads(CliRunner().invoke(command, [*call, "--json"]).stdout)["dataset"] == tiny.lock.identity


@pytest.mark.slow
def test_only_other_exports_are_replaced_and_only_on_request(tiny: Dataset, tmp_path: Path) -> None:
    made = {name: export(tiny, tmp_path / name, name, quiet) for name in ("mot", "mots")}
    assert ExportTarget(URL).put(tmp_path / "mot", made["mot"].rows, quiet) == len(made["mot"].rows)
    assert ExportTarget(URL).put(tmp_path / "mot", made["mot"].rows, quiet) == 0
    with pytest.raises(InputError, match="memory://bucket/small holds another export"):
        ExportTarget(URL).put(tmp_path / "mots", made["mots"].rows, quiet)
    ExportTarget(URL).put(tmp_path / "mots", made["mots"].rows, quiet, replace=True)
    assert remote_files(URL) == tree(tmp_path / "mots")
    Store(URL).write("mine.txt", b"mine")
    for name in made:
        with pytest.raises(InputError, match=r"holds a file that is not this export's, 'mine\.txt'"):
            ExportTarget(URL).put(tmp_path / name, made[name].rows, quiet, replace=True)
    assert remote_files(URL) == {**tree(tmp_path / "mots"), "mine.txt": b"mine"}


@pytest.mark.slow
def test_a_copy_that_was_stopped_has_no_index_and_starts_again(
    tiny: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = export(tiny, tmp_path / "out", "mot", quiet)

    def fail(self: Store, source: Path, path: str) -> None:
        if path.endswith("gt.txt"):
            raise OSError("the line is dead")

    with monkeypatch.context() as patch, pytest.raises(RunError, match="the line is dead; try again"):
        patch.setattr(Store, "send", fail)
        ExportTarget(URL).put(tmp_path / "out", made.rows, quiet)
    assert INDEX not in remote_files(URL)
    ExportTarget(URL).put(tmp_path / "out", made.rows, quiet)
    assert remote_files(URL) == tree(tmp_path / "out")
