"""Copies an export to a store, such as a bucket.

`index.json` is written last and removed first, so an export is complete if its index exists. A copy that was stopped
starts again. Files that no index lists are never removed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.interfaces import Progress
from recipe_runtime.transfer.export import INDEX, parsed_rows
from recipe_runtime.transfer.formats.format import Row
from recipe_runtime.transfer.stores import Store

_MAX_INDEX = 256 << 20  # bytes of an index that is read


class ExportTarget:
    """A place in a store for one export.

    Args:
        url: The place.

    Attributes:
        url: The place, without secrets.
        folder: The place, if it is on a disk of this host; else None.

    Raises:
        InputError: The URL does not lead to a usable place.
        RunError: Access is refused.
    """

    def __init__(self, url: str) -> None:
        self._store = Store(url)
        self.url, self.folder = self._store.url, self._store.folder
        with self._store.reported("try again"):
            self._sizes = self._store.sizes() if self.folder is None else {}

    def put(self, folder: Path, rows: Sequence[Row], progress: Progress, *, replace: bool = False) -> int:
        """Copy a complete export, in place of an earlier one if `replace` is set.

        Args:
            folder: The export on this host.
            rows: Its files.
            progress: Called to report progress, in files.
            replace: Whether another export may be replaced.

        Returns:
            How many files were sent; 0 if the place has this export already.

        Raises:
            InputError: The place holds other files, or another export and `replace` is not set.
            RunError: The copy failed.
        """
        store, body = self._store, (folder / INDEX).read_bytes()
        sizes = {row["file"]: row["size"] for row in rows}
        with store.reported("try again"):
            there = self._index()
            if there == body and self._sizes == {**sizes, INDEX: len(body)}:
                return 0
            earlier = {row["file"] for row in parsed_rows(there)} if there else set()
            foreign = sorted(self._sizes.keys() - earlier - sizes.keys() - {INDEX})
            if foreign or (there not in (b"", body) and not replace):
                what = f"a file that is not this export's, {foreign[0]!r}" if foreign else "another export"
                remedy = "choose another place, or " + ("move the file away" if foreign else "replace it")
                raise InputError(f"{self.url} holds {what}", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
            if INDEX in self._sizes:
                store.remove(INDEX)
            store.each(store.remove, sorted(self._sizes.keys() - sizes.keys() - {INDEX}))
            store.each(lambda path: store.send(folder / path, path), sizes, lambda n: progress("copy", n, len(sizes)))
            store.write(INDEX, body)
        return len(sizes)

    def _index(self) -> bytes:
        """Return the index at the place; empty if there is none."""
        if INDEX not in self._sizes:
            return b""
        with self._store.open(INDEX) as file:
            return file.read(_MAX_INDEX)
