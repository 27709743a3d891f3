"""The lockfile: one text per value, and clear errors for broken text."""

import contextlib
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.lockfile import BodyMotion, Lockfile, VariantRow

A, B, C, D = ("a" * 64, "b" * 64, "c" * 64, "d" * 64)
LOCK = Lockfile(
    recipe="rain bench",
    source="../x y.yaml",
    plan=A,
    files={"x y.yaml": B},
    tools={"numpy": "2.2.6"},
    stages={"plan": 1, "shade": 2},
    variants={"weather=wet,hour=#2": VariantRow(A, B, C), "base": VariantRow(A, B, D)},
    traces={A: D},
    bodies={(A, "hero 1"): BodyMotion(D, 5, ("01234567", "89abcdef")), (A, "still"): BodyMotion(C, 1, ())},
    frames={("k" * 16, "street cam", "rgb", 7): B, ("k" * 16, "street cam", "depth", 7): C},
)


def test_text_and_value_round_trip() -> None:
    assert lockfile.loads(LOCK.dumps(), "x.lock") == LOCK
    assert lockfile.loads(LOCK.dumps(), "x.lock").dumps() == LOCK.dumps()


def test_variants_keep_the_order_of_the_recipe() -> None:
    assert list(lockfile.loads(LOCK.dumps(), "x.lock").variants) == ["weather=wet,hour=#2", "base"]


def test_a_file_with_equal_rows_is_not_rewritten(tmp_path: Path) -> None:
    path = tmp_path / "locks" / "x.lock"
    assert LOCK.write(path)
    before = path.stat()
    assert not LOCK.write(path)
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert not replace(LOCK, tools={"numpy": "3.0"}).write(path)
    assert replace(LOCK, plan=B).write(path)


def test_a_file_with_other_order_of_variants_is_rewritten(tmp_path: Path) -> None:
    """The identity covers the order. `recipe lock` called such a file up to date, and --update did not repair it."""
    path, other = tmp_path / "x.lock", replace(LOCK, variants=dict(reversed(LOCK.variants.items())))
    assert other.write(path) and other.identity != LOCK.identity
    assert not lockfile.read(path).equals_but_for_text(LOCK)
    assert LOCK.write(path) and lockfile.read(path).identity == LOCK.identity


def test_a_flipped_digit_breaks_the_seal() -> None:
    text = LOCK.dumps()
    places = [i for i, c in enumerate(text) if c in "abcd0" and i > 20]
    for place in places[:: len(places) // 40]:
        flipped = text[:place] + ("e" if text[place] != "0" else "1") + text[place + 1 :]
        with contextlib.suppress(InputError):  # a changed kind of row is refused on reading
            assert not lockfile.loads(flipped, "x.lock").sealed
    assert lockfile.loads(text, "x.lock").sealed


def test_line_ends_of_windows_do_not_break_the_seal() -> None:
    """Git writes CR LF where core.autocrlf is set. Some lines with it are an edit."""
    text = LOCK.dumps()
    read = lockfile.loads(text.replace("\n", "\r\n"), "x.lock")
    assert read.sealed and read == LOCK
    for edited in (text.replace("\n", "\r\n", 1), text.replace("\n", "\r\r\n"), text.replace("\n", "\r\n")[:-2]):
        assert not lockfile.loads(edited, "x.lock").sealed


def test_labels_are_keyed_by_scene_and_rig_and_colours_by_all_three() -> None:
    wet, dry = LOCK.variants.values()
    assert wet.frame_key("depth") == dry.frame_key("depth") != wet.frame_key("rgb") != dry.frame_key("rgb")


def test_the_identity_covers_every_pixel_and_no_tools() -> None:
    changed = replace(LOCK, frames={**LOCK.frames, ("k" * 16, "street cam", "rgb", 7): A})
    assert changed.identity != LOCK.identity == replace(LOCK, tools={}).identity


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "x.lock:1:1: this is not a lockfile"),
        ("hello", "x.lock:1:1: this is not a lockfile"),
        ("recipe-lock 9\n", "x.lock:1:1: lockfile format '9' is not format 1"),
        ("recipe-lock 1\nbananas 3\n", "x.lock:2:1: unknown row 'bananas'"),
        ("recipe-lock 1\nfile a\n", "x.lock:2:1: a file row has 2 cells after its kind, this one 1"),
        ("recipe-lock 1\nstage shade one\n", "x.lock:2:1: a broken stage row"),
        ("recipe-lock 1\nvariant v a=1 b=2 c=3\n", "x.lock:2:1: a broken variant row: it needs scene="),
        ("recipe-lock 1\n", "x.lock:1:1: the lockfile names no recipe"),
    ],
)
def test_a_broken_lockfile_is_refused_with_its_line(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        lockfile.loads(text, "x.lock")
    assert str(caught.value).startswith(says)


def test_the_error_for_a_missing_lockfile_names_the_command_that_writes_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="`recipe lock` writes it"):
        lockfile.read(tmp_path / "none.lock")


def test_names_take_little_memory() -> None:
    """Regression: names of 350 characters, one of them beyond U+FFFF, made 256 MiB of lockfile 1.5 GB of memory."""
    head = f"recipe-lock 1\nrecipe x x.yaml {'0' * 64}\n"
    row = f"frame {'a' * 16} {{}} rgb 000000 {'0' * 64}\n"
    assert lockfile.loads(head + row.format("%F0%9F%98%80" + "a" * 99), "x.lock").frames
    with pytest.raises(InputError, match="has more than 100 characters"):
        lockfile.loads(head + row.format("%F0%9F%98%80" + "a" * 100), "x.lock")
    with pytest.raises(InputError, match="the line is not ASCII text"):
        lockfile.loads(head + row.format("\U0001f600"), "x.lock")
