"""A streaming reader of JSON documents: only requested values are in memory, and each has a length limit.

    stream = JsonStream(file, 1 << 20)
    for key in stream.members():            # of the next value, an object; read the member's value before the next key
        if key == "files":
            for path in stream.members():   # an object, member by member
                row = stream.value()        # a complete value
        elif key == "digests":
            digests = list(stream.items())  # an array, item by item
    stream.end()

All errors in a document are raised as ValueError.
"""

from __future__ import annotations

import codecs
import json
import re
from collections.abc import Iterator
from typing import Any, BinaryIO, NoReturn

MAX_VALUE = 1 << 14  # characters
_CHUNK = 1 << 18  # bytes
_SPACE = re.compile(r"[ \t\n\r]*")


def _object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("an object has a key twice")
    return found


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number of JSON")


_DECODER = json.JSONDecoder(object_pairs_hook=_object, parse_constant=_refuse)


def loads(body: bytes, most: int) -> Any:
    """Parse a complete document.

    The number of values is limited by counting separators before any memory is allocated.

    Raises:
        ValueError: the document has more than `most` values, or is not JSON.
    """
    if body.count(b",") + body.count(b"[") + body.count(b"{") > most:
        raise ValueError(f"it has more than {most:,} values")
    try:
        text = body.decode()
        found, end = _DECODER.raw_decode(text, _after_space(text, 0))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if _after_space(text, end) < len(text):
        raise ValueError("there is more after its end")
    return found


class JsonStream:
    """A position in a JSON document of at most `most` bytes."""

    def __init__(self, file: BinaryIO, most: int) -> None:
        self._left = most
        self._file, self._decoder = file, codecs.getincrementaldecoder("utf-8")()
        self._text, self._at, self._ended = "", 0, False

    def members(self) -> Iterator[str]:
        """Yield the keys of the next value, an object, including duplicates; the caller reads each key's value."""
        self._expect("{")
        if self._next() == "}":
            self._at += 1
            return
        while True:
            if self._next() != '"':
                raise ValueError("it is not JSON: a key is missing")
            key = str(self.value())
            self._expect(":")
            yield key
            if self._ends("}"):
                return

    def items(self, most: int = MAX_VALUE) -> Iterator[Any]:
        """Yield the items of the next value, an array; none is longer than `most` characters."""
        self._expect("[")
        if self._next() == "]":
            self._at += 1
            return
        while True:
            yield self.value(most)
            if self._ends("]"):
                return

    def value(self, most: int = MAX_VALUE) -> Any:
        """Return the next value; ValueError if it is longer than `most` characters."""
        self._next()
        self._fill(most + 1)
        try:
            found, end = _DECODER.raw_decode(self._text, self._at)
        except RecursionError:
            raise ValueError("it is nested too deeply") from None
        except ValueError as error:
            if len(self._text) - self._at > most and "Unterminated" in str(error):
                raise ValueError(f"a value is longer than {most:,} characters") from None
            raise ValueError(f"it is not JSON: {error}") from None
        if end - self._at > most:
            raise ValueError(f"a value is longer than {most:,} characters")
        self._at = end
        return found

    def end(self) -> None:
        """Check that nothing follows; ValueError otherwise."""
        if self._next():
            raise ValueError("it is not JSON: there is more after its end")

    def _ends(self, closing: str) -> bool:
        """Skip the separator after a member or an item; return whether it closes the object or array."""
        found = self._next()
        if found not in (",", closing) or not found:
            raise ValueError(f"it is not JSON: {found!r} in place of , or {closing}")
        self._at += 1
        return found == closing

    def _expect(self, sign: str) -> None:
        found = self._next()
        if found != sign:
            raise ValueError(f"it is not JSON of the expected form: {found!r} in place of {sign}")
        self._at += 1

    def _next(self) -> str:
        """Skip whitespace and return the next character; empty at the end of the document."""
        while True:
            self._at = _after_space(self._text, self._at)
            if self._at < len(self._text):
                return self._text[self._at]
            if self._ended:
                return ""
            self._fill(1)

    def _fill(self, need: int) -> None:
        """Buffer at least this many characters after the position, or all that remain."""
        while len(self._text) - self._at < need and not self._ended:
            chunk = self._file.read(_CHUNK)
            self._left -= len(chunk)
            if self._left < 0:
                raise ValueError("it is too large")
            self._ended = not chunk
            self._text = self._text[self._at :] + self._decoder.decode(chunk, final=self._ended)
            self._at = 0


def _after_space(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    return found.end() if found else at
