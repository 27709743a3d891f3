"""The rows of a lockfile: their types, their limits, and the parser that checks them line by line.

`lockfile` describes the format. A lockfile may come from anyone, so the number of rows of each kind, the length of a
line and the form of every cell are checked before anything is stored.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from urllib.parse import unquote

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.modalities import DIGEST_KINDS

FORMAT = 1
MAX_LINE = 1 << 14  # bytes
_MAX_NAME = 100  # characters of a name in rows that there are many of
KEY_LENGTH = 16  # digits of a digest that serve as a key within one lockfile
RESTORE = "restore the file from a copy, or write it again"
_CELLS = {
    "recipe": 3, "identity": 1, "file": 2, "tool": 2, "stage": 2, "variant": 4, "trace": 2, "body": 5, "frame": 5,
    "seal": 1,
}  # fmt: skip
# The maximal number of rows of each kind: those of the largest dataset that can be built.
MAX_ROWS = {
    "recipe": 1, "identity": 1, "file": 10_000, "tool": 100, "stage": 100, "variant": 10_000, "trace": 10_000,
    "body": 100_000, "frame": 600_000, "seal": 1,
}  # fmt: skip
_DIGEST = re.compile(r"[0-9a-f]{64}")
_CHECKPOINTS = re.compile(r"-|[0-9a-f]{8}(,[0-9a-f]{8}){0,63}")
_WHOLE = re.compile(r"[0-9]{1,9}")
_KINDS = {name: name for name in DIGEST_KINDS}

FrameKey = tuple[str, str, str, int]  # key, sensor, modality, frame


@dataclass(frozen=True)
class BodyMotion:
    """An actor's motion: the digest of all of it, and short digests of its first k * stride frames."""

    digest: str
    stride: int
    checkpoints: tuple[str, ...]


@dataclass(frozen=True)
class VariantRow:
    """The digests of a variant's three plans."""

    scene: str
    rig: str
    appearance: str

    @property
    def observation_key(self) -> str:
        """Key of the frames that all variants with this scene and rig share."""
        return digest("plan/observation/1", [self.scene, self.rig])[:KEY_LENGTH]

    @property
    def scenario_key(self) -> str:
        """Key of the frames whose colours are this variant's."""
        return digest("plan/scenario/1", [self.scene, self.rig, self.appearance])[:KEY_LENGTH]

    def frame_key(self, modality: str) -> str:
        """Key of a modality's frames: colour follows from all three plans, labels from scene and rig."""
        return self.scenario_key if modality == "rgb" else self.observation_key


@dataclass
class Rows:
    """The parsed rows of a lockfile, as the fields of a `Lockfile`."""

    recipe: str = ""
    source: str = ""
    plan: str = ""
    files: dict[str, str] = field(default_factory=dict)
    tools: dict[str, str] = field(default_factory=dict)
    stages: dict[str, int] = field(default_factory=dict)
    variants: dict[str, VariantRow] = field(default_factory=dict)
    traces: dict[str, str] = field(default_factory=dict)
    bodies: dict[tuple[str, str], BodyMotion] = field(default_factory=dict)
    frames: dict[FrameKey, str] = field(default_factory=dict)


class RowParser:
    """Parses the lines of a lockfile, one by one, into `Rows`."""

    def __init__(self, name: str) -> None:
        """Start at the first line of a file with this name."""
        self._name = name
        self._rows = Rows()
        self._counts = dict.fromkeys(_CELLS, 0)
        self._interned: dict[str, str] = {}  # keys and names occur in many rows
        self._lines = 0

    @property
    def source(self) -> str:
        """The path of the recipe, if the row with it was added; else empty."""
        return self._rows.source

    def add(self, number: int, line: str) -> None:
        """Parse one line.

        Raises:
            InputError: the line cannot be in a lockfile; the message has its number.
        """
        self._lines = number
        if number == 1:
            if line.split()[:1] != ["recipe-lock"]:
                raise invalid_line(self._name, 1, "this is not a lockfile: its first line is not `recipe-lock 1`")
            if line != f"recipe-lock {FORMAT}":
                found = line[12:60]
                raise invalid_line(
                    self._name, 1, f"lockfile format {found!r} is not format {FORMAT}, the one this release reads"
                )
            return
        kind, *cells = line.split(" ")
        if kind not in _CELLS:
            raise invalid_line(self._name, number, f"unknown row {kind[:40]!r}", RESTORE)
        if len(cells) != _CELLS[kind]:
            message = f"a {kind} row has {_CELLS[kind]} cells after its kind, this one {len(cells)}"
            raise invalid_line(self._name, number, message, RESTORE)
        self._counts[kind] += 1
        if self._counts[kind] > MAX_ROWS[kind]:
            raise invalid_line(self._name, number, f"there are more than {MAX_ROWS[kind]:,} {kind} rows")
        try:
            self._row(kind, cells)
        except ValueError as error:
            raise invalid_line(self._name, number, f"a broken {kind} row: {error}", RESTORE) from None

    def rows(self) -> Rows:
        """All rows, once every line was added.

        Raises:
            InputError: there was no line, or the `recipe` row is missing.
        """
        if not self._lines:
            raise invalid_line(self._name, 1, "this is not a lockfile: its first line is not `recipe-lock 1`")
        if not self._rows.recipe:
            raise invalid_line(self._name, 1, "the lockfile names no recipe: its `recipe` row is missing", RESTORE)
        return self._rows

    def _row(self, kind: str, cells: list[str]) -> None:
        rows = self._rows
        if kind == "frame":
            key, sensor, modality, number, value = cells
            if modality not in _KINDS:
                raise ValueError(f"there is no modality {modality[:40]!r}")
            place = (self._unquoted(key), self._unquoted(sensor), _KINDS[modality], _whole(number))
            rows.frames[place] = _digest(value)
        elif kind == "body":
            scene, stride, actor, value, checkpoints = cells
            if not _CHECKPOINTS.fullmatch(checkpoints):
                raise ValueError("its checkpoints are not at most 64 of 8 hexadecimal digits")
            points = () if checkpoints == "-" else tuple(checkpoints.split(","))
            motion = BodyMotion(_digest(value), _whole(stride), points)
            rows.bodies[self._unquoted(_digest(scene)), self._unquoted(actor)] = motion
        elif kind == "variant":
            values = dict(cell.split("=", 1) for cell in cells[1:])
            if sorted(values) != ["appearance", "rig", "scene"]:
                raise ValueError("it needs scene=, rig= and appearance=")
            rows.variants[unquote(cells[0])] = VariantRow(**{k: self._unquoted(_digest(v)) for k, v in values.items()})
        elif kind == "trace":
            rows.traces[_digest(cells[0])] = _digest(cells[1])
        elif kind == "file":
            rows.files[unquote(cells[0])] = _digest(cells[1])
        elif kind == "tool":
            rows.tools[cells[0]] = cells[1]
        elif kind == "stage":
            rows.stages[cells[0]] = _whole(cells[1])
        elif kind == "recipe":
            rows.recipe, rows.source, rows.plan = unquote(cells[0]), unquote(cells[1]), cells[2]

    def _unquoted(self, cell: str) -> str:
        """A cell without its percent escapes; equal cells give the same object."""
        found = self._interned.get(cell)
        if found is None:
            found = unquote(cell)
            if len(found) > _MAX_NAME:
                raise ValueError(f"the name {found[:20]!r}... has more than {_MAX_NAME} characters")
            self._interned[cell] = found
        return found


def _digest(cell: str) -> str:
    if not _DIGEST.fullmatch(cell):
        raise ValueError(f"{cell[:20]!r} is not a SHA-256 digest")
    return cell


def _whole(cell: str) -> int:
    if not _WHOLE.fullmatch(cell):
        raise ValueError(f"{cell[:20]!r} is not a whole number of at most nine digits")
    return int(cell)


def invalid_line(name: str, line: int, message: str, help: str | None = None) -> InputError:
    """The error of a line of a lockfile."""
    return InputError(Problem(message, Place(name, line, 1), help, Code.INVALID_LOCKFILE))
