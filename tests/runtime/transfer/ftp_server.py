"""A small FTP server on this host, which answers as the protocol says, stalls, or lists files without end."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_REPLIES = {"USER": "331 password", "PASS": "230 welcome", "TYPE": "200 type", "ABOR": "226 stopped"}


@contextmanager
def serving(root: Path, *, stalls: bool = False, lists_endlessly: bool = False) -> Iterator[str]:
    """Yield the URL of a folder.

    Args:
        root: the folder.
        stalls: whether no file that is asked for is ever sent.
        lists_endlessly: whether the listing of a folder has no end.
    """
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]

        def accept() -> None:
            with suppress(OSError):
                while True:
                    talk, _ = listening.accept()
                    talk.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    session = _Session(root, talk, stalls, lists_endlessly)
                    threading.Thread(target=session.run, daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        yield f"ftp://127.0.0.1:{port}/data"
        with suppress(OSError):
            listening.shutdown(socket.SHUT_RDWR)


class _Session:
    """One control connection."""

    def __init__(self, root: Path, talk: socket.socket, stalls: bool, lists_endlessly: bool) -> None:
        self._root, self._talk, self._stalls, self._lists_endlessly = root, talk, stalls, lists_endlessly
        self._passive: socket.socket | None = None
        self._start = 0

    def run(self) -> None:
        with suppress(OSError), self._talk, self._talk.makefile("r", encoding="utf-8") as lines:
            self._say("220 ready")
            for line in lines:
                command, _, argument = line.strip().partition(" ")
                self._obey(command.upper(), argument)

    def _say(self, text: str) -> None:
        self._talk.sendall(f"{text}\r\n".encode())

    def _obey(self, command: str, argument: str) -> None:
        place = self._root / argument.strip("/").partition("/")[2]
        if command == "PASV":
            self._passive = socket.create_server(("127.0.0.1", 0))
            port = self._passive.getsockname()[1]
            self._say(f"227 port (127,0,0,1,{port >> 8},{port & 255})")
        elif command == "REST":
            self._start = int(argument)
            self._say("350 from there")
        elif command == "MLSD" and place.is_dir():
            rows = [self._row(entry) for entry in os.scandir(place)]
            self._send("".join(rows).encode(), repeats=self._lists_endlessly)
        elif command == "RETR" and place.is_file():
            if self._stalls:
                threading.Event().wait()
            self._send(place.read_bytes()[self._start :])
        else:
            self._say(_REPLIES.get(command, "550 no"))

    @staticmethod
    def _row(entry: os.DirEntry[str]) -> str:
        return f"type={'dir' if entry.is_dir() else 'file'};size={entry.stat().st_size}; {entry.name}\r\n"

    def _send(self, body: bytes, *, repeats: bool = False) -> None:
        assert self._passive is not None
        self._say("150 here it is")
        with self._passive, self._passive.accept()[0] as data:
            data.sendall(body)
            while repeats:
                data.sendall(body)
        self._start = 0
        self._say("226 done")
