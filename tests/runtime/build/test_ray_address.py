"""The address of a Ray cluster is checked before joining, because Ray itself waits for minutes."""

from __future__ import annotations

import socket

import pytest
from recipe_runtime.build import ray


def test_an_address_must_answer() -> None:
    with pytest.raises(ConnectionRefusedError):
        ray._check_address("127.0.0.1:1")
    with pytest.raises(ValueError, match="'head' is not a port"):
        ray._check_address("10.0.0.1:head")
    with socket.create_server(("127.0.0.1", 0)) as server:
        ray._check_address(f"ray://127.0.0.1:{server.getsockname()[1]}")
