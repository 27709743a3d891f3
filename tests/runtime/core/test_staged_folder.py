"""A staged folder loses no file that the program did not make, wherever it is stopped."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.core import staged_folder
from recipe_runtime.core.staged_folder import Index, StagedFolder, check_place, holds_only, is_free

from tests.runtime.fakes import tree

OLD, NEW = {"a.txt": b"old", "below/b.txt": b"old"}, {"a.txt": b"new", "below/c.txt": b"new"}
_PATHS = st.sampled_from(["a.txt", "below/b.txt", "notes.txt", "below/notes.txt"])


def write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files and, last, the index of the folder."""
    for path, body in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(body)
    rows = {path: [len(body), hashlib.sha256(body).hexdigest()] for path, body in files.items()}
    (folder / "index.json").write_text(json.dumps(rows))


def _rows(folder: Path) -> dict[str, tuple[int, str]] | None:
    try:
        found: dict[str, tuple[int, str]] = json.loads((folder / "index.json").read_bytes())
    except FileNotFoundError:
        return None
    return found


INDEX = Index("index.json", _rows)


def staged(out: Path, *, owner: str = "small", key: str = "1", replace: bool = False) -> StagedFolder:
    return StagedFolder(out, INDEX, owner=owner, key=key, replace=replace)


def make(out: Path, files: Mapping[str, bytes] = NEW) -> list[str]:
    """Put a folder at a place; return the notices."""
    notices = list[str]()
    staged(out).settle()
    with StagedFolder(out, INDEX, owner="small", key="1", notice=notices.append) as work:
        write(work.files, files)
        work.publish()
    return notices


@given(changed=st.dictionaries(_PATHS, st.sampled_from([b"old", b"own", b"longer", None])), index=st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_replaced_folder_is_kept_if_it_has_a_file_besides_its_own(
    changed: dict[str, bytes | None], index: bool
) -> None:
    """Files were added, changed or removed (None), or the index is missing."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        write(out, OLD)
        for path, body in changed.items():
            (out / path).unlink(missing_ok=True)
            if body is not None:
                (out / path).write_bytes(body)
                os.utime(out / path, ns=(1 << 62, 1 << 62))  # after the index, whatever the clock's resolution
        if not index:
            (out / "index.json").unlink()
        before = tree(out)
        own = before.items() <= {**OLD, "index.json": before.get("index.json")}.items() and (index or not before)
        notices = make(out)
        kept = out.with_name("out.replaced")
        assert tree(out).items() > NEW.items() and not out.with_name(".out.partial").exists()
        assert kept.exists() != own and (own or tree(kept) == before)
        assert notices == ([] if own else [notices[0]]) and all(str(kept) in notice for notice in notices)


def test_kept_folders_get_different_names(tmp_path: Path) -> None:
    for number in range(3):
        write(tmp_path / "out", OLD)
        (tmp_path / "out" / "notes.txt").write_text(str(number))
        make(tmp_path / "out")
    kept = ["out.replaced", "out.replaced.2", "out.replaced.3"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", *kept]
    assert [(tmp_path / name / "notes.txt").read_text() for name in kept] == ["0", "1", "2"]


@pytest.mark.parametrize("there", ["nothing", "own files", "another file"])
def test_a_process_may_be_killed_at_every_change_of_a_folder(tmp_path: Path, there: str) -> None:
    """Then the old or the new folder is there, complete, and the next process replaces it."""
    found, last = set[str](), _killed(lambda: _replace(tmp_path / "count", there), 0)
    for change in range(1, last + 1):
        out = tmp_path / str(change) / "out"
        assert _killed(lambda folder=out.parent: _replace(folder, there), change) == change  # type: ignore[misc]
        staged(out).settle()
        files = tree(out)
        found.add("nothing" if not files else "new" if files["a.txt"] == b"new" else "old")
        own = {path: body for path, body in files.items() if path not in ("index.json", "notes.txt")}
        assert own in ({}, OLD, NEW)
        make(out)
        assert tree(out).items() > NEW.items()
        rest = ["out", "out.replaced"] if there == "another file" else ["out"]
        assert sorted(path.name for path in out.parent.iterdir()) == rest
        if there == "another file":
            assert tree(out.with_name("out.replaced")).items() > {**OLD, "notes.txt": b"mine"}.items()
    assert found == ({"nothing", "new"} if there == "nothing" else {"old", "new"})


def _replace(folder: Path, there: str) -> None:
    if there != "nothing":
        write(folder / "out", OLD)
    if there == "another file":
        (folder / "out" / "notes.txt").write_bytes(b"mine")
    sys.audit("test.start")
    make(folder / "out")


def _killed(action: Callable[[], None], most: int) -> int:
    """Run an action in a child process that is killed at the n-th change of a folder; return the number of changes."""
    child = os.fork()
    if child == 0:
        count = -1

        def audit(event: str, arguments: tuple[object, ...]) -> None:
            nonlocal count
            writes = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & os.O_CREAT)
            if event == "test.start":
                count = 0
            elif count >= 0 and (writes or event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir")):
                count += 1
                if count == most:
                    os._exit(count)

        try:
            sys.addaudithook(audit)
            action()
            os._exit(count)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_a_failed_rename_leaves_the_old_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, rename = tmp_path / "out", Path.rename
    make(out, OLD)
    before = tree(out)

    def renamed(path: Path, target: Path) -> Path:
        if path.name == "dataset":
            raise OSError("no space")
        return rename(path, target)

    with monkeypatch.context() as patch, pytest.raises(OSError, match="no space"):
        patch.setattr(Path, "rename", renamed)
        make(out)
    assert tree(out) == before
    assert make(out) == []


def test_unfinished_work_is_continued_only_with_the_same_key(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with staged(out, key="1") as work:
        (work.files / "a.txt").touch()
    with staged(out, key="1") as work:
        assert work.is_continued() and not is_free(work.files)
    with staged(out, key="2") as work:
        assert is_free(work.files)
        (work.files / "a.txt").touch()
    with staged(out, key="") as work:
        assert is_free(work.files)
        work.remove()
    assert not list(tmp_path.iterdir())


def test_unfinished_work_of_another_recipe_is_kept(tmp_path: Path) -> None:
    with staged(tmp_path / "out") as work:
        (work.files / "a.txt").touch()
    with (
        pytest.raises(InputError, match="holds unfinished work of 'small', and this is 'other'"),
        staged(tmp_path / "out", owner="other"),
    ):
        raise AssertionError
    assert (work.files / "a.txt").exists()
    with staged(tmp_path / "out", owner="other", replace=True):
        assert is_free(work.files)


def test_a_second_process_is_refused(tmp_path: Path) -> None:
    with (
        staged(tmp_path / "out"),
        pytest.raises(RunError, match="another process is writing"),
        staged(tmp_path / "out"),
    ):
        raise AssertionError


def test_files_of_the_user_in_a_work_folder_stay(tmp_path: Path) -> None:
    notes = tmp_path / ".out.partial" / "notes.txt"
    notes.parent.mkdir()
    notes.write_text("mine")
    with pytest.raises(InputError, match=r"\.out\.partial is in the way .*; move it away"):
        make(tmp_path / "out")
    notes.unlink()
    with staged(tmp_path / "out") as work:
        notes.write_text("mine")
        write(work.files, NEW)
        work.publish()
    assert notes.read_text() == "mine" and holds_only(tmp_path / "out", INDEX)


def test_links_are_not_own_files(tmp_path: Path) -> None:
    write(tmp_path / "out", OLD)
    (tmp_path / "out" / "a.txt").rename(tmp_path / "a.txt")
    (tmp_path / "out" / "a.txt").symlink_to(tmp_path / "a.txt")
    assert not holds_only(tmp_path / "out", INDEX)


def test_a_place_that_cannot_be_replaced_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path)
    (tmp_path / "broken").symlink_to(tmp_path / "nowhere")
    (tmp_path / "current" / "below").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "current" / "below")
    for path, message in (
        ("file", "is not a folder"),
        ("link", "is not a folder"),
        ("broken", "is not a folder"),
        ("file/out", "file is a file"),
        ("broken/out", "leads to no folder"),
        ("current", "is the current folder or contains it"),
        ("current/below", "is the current folder or contains it"),
    ):
        with pytest.raises(InputError, match=message):
            check_place(tmp_path / path)
    with pytest.raises(InputError, match="is a mount point"):
        check_place(Path("/proc"))
    check_place(tmp_path / "current" / "other")


@pytest.mark.parametrize("changed", [False, True])
def test_a_replacement_that_fails_is_completed_by_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: bool
) -> None:
    """Regression: `remove` after an error left the replaced folder without its marker, and so in the way."""
    out = tmp_path / "out"
    write(out, OLD)
    if changed:
        (out / "own.txt").write_text("mine")

    def stopped(*_: object, **__: object) -> bool:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, staged(out) as work:
        write(work.files, NEW)
        patch.setattr(staged_folder, "holds_only" if changed else "remove_tree", stopped)
        with pytest.raises(KeyboardInterrupt):
            work.publish()
        patch.undo()
        work.remove()
    make(out)
    assert tree(out).items() > NEW.items() and not (tmp_path / ".out.partial").exists()
    assert (tmp_path / "out.replaced" / "own.txt").exists() == changed


def test_what_appears_at_the_place_meanwhile_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with staged(out) as work:
        write(work.files, NEW)
        out.write_text("important")
        with pytest.raises(InputError, match="is not a folder"):
            work.publish()
    assert out.read_text() == "important"
