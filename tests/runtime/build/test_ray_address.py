"""Before Ray is asked to join a cluster, something must answer there as Ray does: it would itself wait for minutes."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest
from recipe_runtime.build import ray

SETTINGS = bytes([0, 0, 6, 4, 0, 0, 0, 0, 0]) + bytes([0, 3, 0, 0, 0, 100])


@contextmanager
def serving(answer: Callable[[socket.socket], None]) -> Iterator[str]:
    """An address at which one caller is answered so."""
    with socket.create_server(("127.0.0.1", 0)) as door:

        def serve() -> None:
            with suppress(OSError):
                caller, _ = door.accept()
                with caller:
                    answer(caller)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"127.0.0.1:{door.getsockname()[1]}"
        thread.join(10)
        assert not thread.is_alive()


def _silent(caller: socket.socket) -> None:
    while caller.recv(100):
        pass


def _web(caller: socket.socket) -> None:
    caller.recv(100)
    caller.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")


def _dripping(caller: socket.socket) -> None:
    for byte in SETTINGS:
        caller.sendall(bytes([byte]))
        time.sleep(0.15)


@pytest.mark.parametrize("answer", [_silent, _web, _dripping, lambda caller: None])
def test_what_is_no_ray_is_told_from_it_soon(
    answer: Callable[[socket.socket], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray, "TIMEOUT", 0.5)
    with serving(answer) as address:
        start = time.monotonic()
        with pytest.raises(ConnectionError, match="what listens there does not answer as Ray does"):
            ray._check_address(address)
        assert time.monotonic() - start < 3.0


def test_what_speaks_as_ray_does_is_let_through() -> None:
    def answer(caller: socket.socket) -> None:
        assert caller.recv(100).startswith(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
        caller.sendall(SETTINGS)

    with serving(answer) as address:
        ray._check_address(address)
    with serving(answer) as address:
        ray._check_address(f"ray://{address}")


def test_what_hides_behind_keys_is_for_ray_to_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_USE_TLS", "1")
    with serving(_silent) as address:
        ray._check_address(address)
