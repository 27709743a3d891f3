"""The address of a Ray cluster is checked before joining, because Ray itself waits for minutes."""

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
    """Yield an address that answers one connection with the given function."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):
                connection, _ = server.accept()
                with connection:
                    answer(connection)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        thread.join(10)
        assert not thread.is_alive()


def _silent(connection: socket.socket) -> None:
    while connection.recv(100):
        pass


def _web(connection: socket.socket) -> None:
    connection.recv(100)
    connection.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")


def _dripping(connection: socket.socket) -> None:
    for byte in SETTINGS:
        connection.sendall(bytes([byte]))
        time.sleep(0.15)


@pytest.mark.parametrize("answer", [_silent, _web, _dripping, lambda connection: None])
def test_a_server_that_is_not_ray_is_soon_an_error(
    answer: Callable[[socket.socket], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray, "TIMEOUT", 0.5)
    with serving(answer) as address:
        start = time.monotonic()
        with pytest.raises(ConnectionError, match="what listens there does not answer as Ray does"):
            ray._check_address(address)
        assert time.monotonic() - start < 3.0


def test_a_server_that_answers_like_ray_is_accepted() -> None:
    def answer(connection: socket.socket) -> None:
        assert connection.recv(100).startswith(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
        connection.sendall(SETTINGS)

    with serving(answer) as address:
        ray._check_address(address)
    with serving(answer) as address:
        ray._check_address(f"ray://{address}")


def test_an_address_with_tls_is_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_USE_TLS", "1")
    with serving(_silent) as address:
        ray._check_address(address)
