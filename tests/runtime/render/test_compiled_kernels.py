"""Compiled kernels are checked by digest when loaded: damaged ones are compiled again, with one warning."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import no_type_check

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.errors import RunError
from recipe_runtime.render.device import compiled
from recipe_runtime.render.device import launch as launch_module
from recipe_runtime.render.device.arrays import zeros
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp

from tests.sources import ROOT

NOTICE = "are damaged, or from an earlier version; compiling them again"
FIRST = "compiling kernels, once for this version: about 30 s"


@no_type_check  # written in Warp's language
@wp.kernel
def count_up(out: wp.array(dtype=wp.int32)):
    """Write each thread's number."""
    i = wp.tid()
    out[i] = i


def drawn() -> list[int]:
    """Return the kernel's output after loading it as a new process does."""
    count_up.module.unload()
    launch_module._loaded.clear()
    out = zeros(4, wp.int32, "cpu")
    launch(count_up, 4, "cpu", out=out)
    return list(map(int, out.numpy()))


@pytest.mark.slow
def test_the_first_compilation_logs_that_it_takes_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Without the notice, the first picture on a machine took a minute without any output."""
    folder = tmp_path / "kernels" / "0.1.0-x86_64" / wp.config.version
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    for messages in ([FIRST], []):
        monkeypatch.setattr(compiled, "_announced", set())  # as in a new process
        drawn()
        assert caplog.messages == messages
        caplog.clear()
    next(folder.glob("wp_*")).rename(folder / "wp_other_1234567")  # another module is present
    drawn()
    assert caplog.messages == []


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the kernel, compiled into the test's own cache."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "kernels" / "0.1.0-x86_64" / wp.config.version))
    monkeypatch.setattr(compiled, "_warned", set())
    assert drawn() == [0, 1, 2, 3]
    (folder,) = tmp_path.glob("kernels/*/*/wp_*")
    assert compiled.is_whole(folder)
    return folder


def _object(folder: Path) -> Path:
    (found,) = folder.glob("*.o")
    return found


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        path.write_bytes(b"")


def _flip(folder: Path) -> None:
    body = bytearray(_object(folder).read_bytes())
    body[len(body) // 2] ^= 1
    _object(folder).write_bytes(body)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "empty files, as power loss leaves them": _empty,
    "an empty object": lambda folder: _object(folder).write_bytes(b""),
    "a truncated object": lambda folder: os.truncate(_object(folder), 100),
    "a bit of an object": _flip,
    "the metadata": lambda folder: next(folder.glob("*.meta")).write_text("{}"),
    "no object": lambda folder: _object(folder).unlink(),
    "no list of digests, as of an earlier version": lambda folder: next(folder.glob("*.sha256")).unlink(),
    "a list that cannot be read": lambda folder: next(folder.glob("*.sha256")).write_bytes(b"\xff\n"),
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_kernel_is_compiled_again(module: Path, damage: str, caplog: pytest.LogCaptureFixture) -> None:
    """Regression: an empty kernel file caused a traceback in every run; an altered one rendered wrong pixels."""
    DAMAGES[damage](module)
    assert not compiled.is_whole(module)
    assert drawn() == [0, 1, 2, 3]
    assert [NOTICE in message for message in caplog.messages] == [True]
    assert compiled.is_whole(module)
    caplog.clear()
    assert drawn() == [0, 1, 2, 3]
    assert caplog.messages == []


def test_an_intact_kernel_is_not_compiled_again(module: Path, caplog: pytest.LogCaptureFixture) -> None:
    before = _object(module).stat().st_mtime_ns
    assert drawn() == [0, 1, 2, 3]
    assert _object(module).stat().st_mtime_ns == before
    assert caplog.messages == []


def test_many_damaged_kernels_give_one_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("wp_a_0000000", "wp_b_0000000"):
        folder = tmp_path / "kernels" / "0.1.0-x86_64" / "1.19.0" / name
        folder.mkdir(parents=True)
        (folder / f"{name}.o").write_bytes(b"")
        compiled._discard(folder)
        assert not folder.exists()
    assert len(caplog.messages) == 1


def test_a_damaged_kernel_that_cannot_be_removed_is_a_run_error(module: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def sealed(path: Path) -> None:
        raise OSError(30, "Read-only file system", str(path))

    _flip(module)
    monkeypatch.setattr(compiled, "remove_tree", sealed)
    with pytest.raises(
        RunError, match="damaged and cannot be removed: Read-only file system; remove it, or set RECIPE_K"
    ):
        drawn()


@pytest.mark.slow
def test_an_unwritable_digest_list_is_not_an_error(module: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, body: bytes) -> None:
        raise OSError(28, "No space left on device", str(path))

    _flip(module)
    monkeypatch.setattr(compiled, "write_atomic", full)
    assert drawn() == [0, 1, 2, 3]
    assert not compiled.is_whole(module)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_every_changed_byte_is_detected(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("kernels") / "wp_a_0000000"
    folder.mkdir()
    bodies = data.draw(st.fixed_dictionaries({end: st.binary(min_size=1, max_size=40) for end in ("o", "meta")}))
    for end, body in bodies.items():
        (folder / f"wp_a_0000000.{end}").write_bytes(body)
    compiled._note(folder)
    assert compiled.is_whole(folder)
    end = data.draw(st.sampled_from(sorted(bodies)))
    other = data.draw(st.binary(max_size=41).filter(lambda body: body != bodies[end]))
    (folder / f"wp_a_0000000.{end}").write_bytes(other)
    assert not compiled.is_whole(folder)


CHILD = f"""
import sys
import warp._src.build as build
compile = build.build_cpu
build.build_cpu = lambda *a, **k: (print("compiled", flush=True), compile(*a, **k))
sys.path.insert(0, {str(ROOT)!r})
from tests.runtime.render.test_compiled_kernels import drawn
print("ready", flush=True)
sys.stdin.readline()
assert drawn() == [0, 1, 2, 3]
"""


@pytest.mark.slow
def test_processes_that_start_at_once_compile_once(tmp_path: Path) -> None:
    """The second process waits for the first; neither mistakes the other's unfinished files for damage."""
    environment = {**os.environ, "RECIPE_KERNEL_CACHE": str(tmp_path)}
    pipe = subprocess.PIPE
    children = [
        subprocess.Popen(
            [sys.executable, "-c", CHILD], env=environment, text=True, stdin=pipe, stdout=pipe, stderr=pipe
        )
        for _ in range(2)
    ]
    for child in children:
        assert child.stdout is not None and child.stdout.readline() == "ready\n"
    for child in children:
        assert child.stdin is not None
        child.stdin.write("go\n")
        child.stdin.flush()
    reported = [child.communicate(timeout=120) for child in children]
    assert [child.returncode for child in children] == [0, 0], reported
    assert "".join(out for out, _ in reported) == "compiled\n"
    assert "".join(err for _, err in reported) == f"{FIRST}\n"
