"""The lockfile: what a recipe stands for, digest by digest, as text that a diff reviews.

One row a line, kinds in a fixed order and sorted within; the format's version comes first. No time, host, user
or path is in it. Rows:

    recipe-lock 1
    recipe NAME PATH DATASET-PLAN-DIGEST                   PATH leads from the lockfile's folder to the recipe
    identity NAME@sha256:DIGEST                            what a paper prints
    file PATH SHA256                                       the recipe, every file it includes, and every asset
    tool NAME VERSION                                      what it was made with
    stage NAME VERSION                                     of each stage that bytes depend on
    variant NAME scene=D rig=D appearance=D                plan digests
    trace SCENE DIGEST                                     the motion of a scene
    body SCENE STRIDE ACTOR DIGEST CHECKPOINTS             an actor's motion, and its first eight digits so far
    frame KEY SENSOR MODALITY NUMBER DIGEST                pixels; KEY is the observation of labels, the scenario
                                                           of colour: labels that variants share are listed once
    seal DIGEST                                            over all rows above: a damaged lockfile is known as one
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from urllib.parse import quote, unquote

from recipe_compiler.ir.bounded_reads import open_regular
from recipe_compiler.ir.canonical import canonical_bytes, digest, digest_chunks
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.plan import DatasetPlan

FORMAT = 1
_HEAD = b"recipe-lock "
MAX_BYTES = 1 << 28
MAX_LINE = 1 << 14  # bytes
SHORT = 16  # digits of a digest that serve as a key within one lockfile
_WIDTHS = {
    "recipe": 3, "identity": 1, "file": 2, "tool": 2, "stage": 2, "variant": 4, "trace": 2, "body": 5, "frame": 5,
    "seal": 1,
}  # fmt: skip
# The most rows of each kind that are read: those of the largest dataset that is built.
_MOST = {
    "recipe": 1, "identity": 1, "file": 10_000, "tool": 100, "stage": 100, "variant": 10_000, "trace": 10_000,
    "body": 100_000, "frame": 600_000, "seal": 1,
}  # fmt: skip
_DIGEST = re.compile(r"[0-9a-f]{64}")
_CHECKPOINTS = re.compile(r"-|[0-9a-f]{8}(,[0-9a-f]{8}){0,63}")
_WHOLE = re.compile(r"[0-9]{1,9}")
_MODALITIES = {name: name for name in ("rgb", "depth", "instance", "semantic", "labels")}

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
        return digest("plan/observation/1", [self.scene, self.rig])[:SHORT]

    @property
    def scenario_key(self) -> str:
        """Key of the frames whose colours are this variant's."""
        return digest("plan/scenario/1", [self.scene, self.rig, self.appearance])[:SHORT]

    def frame_key(self, modality: str) -> str:
        """Key of a modality's frames: colour follows from all three plans, labels from scene and rig."""
        return self.scenario_key if modality == "rgb" else self.observation_key


@dataclass(frozen=True)
class Lockfile:
    """A lockfile's rows. Two that are equal have equal text."""

    recipe: str
    source: str  # the recipe's path, from the lockfile's folder
    plan: str
    files: dict[str, str]
    tools: dict[str, str]
    stages: dict[str, int]
    variants: dict[str, VariantRow]  # in the recipe's order
    traces: dict[str, str] = field(default_factory=dict)  # scene digest -> trace digest
    bodies: dict[tuple[str, str], BodyMotion] = field(default_factory=dict)  # (scene digest, actor)
    frames: dict[FrameKey, str] = field(default_factory=dict)
    sealed: bool = field(default=True, compare=False)  # whether the text it was read from was whole

    @cached_property
    def identity(self) -> str:
        """What a paper prints: the recipe's name and one digest over plans, traces and pixels."""
        return f"{quote(self.recipe)}@sha256:{digest_chunks('dataset/1', self._identity_chunks())}"

    def _identity_chunks(self) -> Iterator[bytes]:
        """The canonical bytes of what the identity is over, frame by frame: all of them would fill the memory."""
        yield b'{"frames":['
        for number, (key, value) in enumerate(sorted(self.frames.items())):
            yield (b"," if number else b"") + canonical_bytes([*key, value])
        variants = [[n, v.scene, v.rig, v.appearance] for n, v in self.variants.items()]
        rest = {"plan": self.plan, "variants": variants, "traces": dict(self.traces)}
        yield b"]," + canonical_bytes(rest)[1:]

    def dumps(self) -> str:
        """The text of the lockfile."""
        return "".join(self._lines())

    def says_the_same(self, other: Lockfile) -> bool:
        """Whether two lockfiles differ in nothing but the tools that they were made with, and this one is whole."""
        return self.sealed and replace(self, tools={}) == replace(other, tools={})

    def means_the_same(self, other: Lockfile) -> bool:
        """Whether two lockfiles differ in nothing but tools and the text and name of the recipe's files."""
        return self.says_the_same(replace(other, source=self.source, files=self.files))

    def other_recipe(self, path: Path, recipe: Path, plan: str) -> Path | None:
        """The other recipe that this lockfile belongs to.

        Args:
            path: where this lockfile is.
            recipe: the recipe file at hand.
            plan: the digest of its plan.

        Returns:
            The recipe file that the lockfile was made of, if it is there, is not `recipe`, and the plans differ;
            else None. A recipe that was renamed or moved keeps its lockfile.
        """
        source = path.parent / self.source
        try:
            if self.plan == plan or Path(self.source).is_absolute() or not source.is_file():
                return None
            return None if recipe.exists() and source.samefile(recipe) else Path(os.path.normpath(source))
        except (OSError, ValueError):  # a name that cannot be
            return None

    def write(self, path: Path, *, replace: bool = False) -> bool:
        """Write it unless the file already says the same (tools aside); whether it was written.

        Raises:
            InputError: the file there is not a lockfile, or is the lockfile of another recipe, and not `replace`.
        """
        if os.path.lexists(path):
            if not replace:
                self._check_replaceable(path)
            with contextlib.suppress(InputError):
                if read(path).says_the_same(self):
                    return False
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.writelines(self._lines())
            temporary.chmod(0o644)
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        return True

    def _check_replaceable(self, path: Path) -> None:
        """InputError unless the file at `path` is a lockfile, whole or damaged, of this very recipe."""
        if not is_lockfile(path):
            raise InputError(f"{path} is there already and is not a lockfile; move it away, or replace it (--replace)")
        try:
            there = read(path)
        except InputError:
            return  # damaged: nothing to lose
        ours = Path(os.path.normpath(path.parent / self.source))
        other = there.other_recipe(path, ours, self.plan)
        if there.recipe != self.recipe or other is not None:
            raise InputError(
                f"{path} is the lockfile of another recipe, {other or there.recipe}, and not of {ours};"
                " give one of them another name, or replace it (--replace)"
            )

    def _lines(self) -> Iterator[str]:
        """The lockfile's lines, the seal last."""
        seal = hashlib.sha256(b"recipe/lockfile/1\n")
        for row in self._rows():
            line = " ".join(row) + "\n"
            seal.update(line.encode())
            yield line
        yield f"seal {seal.hexdigest()}\n"

    def _rows(self) -> Iterator[tuple[str, ...]]:
        yield "recipe-lock", str(FORMAT)
        yield "recipe", quote(self.recipe), quote(self.source), self.plan
        yield "identity", self.identity
        for path, value in sorted(self.files.items()):
            yield "file", quote(path), value
        for tool, version in sorted(self.tools.items()):
            yield "tool", tool, version
        for stage, number in sorted(self.stages.items()):
            yield "stage", stage, str(number)
        for name, v in self.variants.items():
            yield (
                "variant",
                quote(name, safe="=,#"),
                f"scene={v.scene}",
                f"rig={v.rig}",
                f"appearance={v.appearance}",
            )
        for scene, value in sorted(self.traces.items()):
            yield "trace", scene, value
        for (scene, actor), motion in sorted(self.bodies.items()):
            checkpoints = ",".join(motion.checkpoints) or "-"
            yield "body", scene, str(motion.stride), quote(actor), motion.digest, checkpoints
        for (key, sensor, modality, number), value in sorted(self.frames.items()):
            yield "frame", key, quote(sensor), modality, f"{number:06d}", value


def skeleton(
    plan: DatasetPlan, source: str, files: dict[str, str], tools: dict[str, str], stages: dict[str, int]
) -> Lockfile:
    """A lockfile of everything that compiling alone decides: no trace and no frame yet."""
    return Lockfile(
        recipe=plan.recipe,
        source=source,
        plan=plan.digest,
        files=files,
        tools=tools,
        stages=stages,
        variants={v.variant: VariantRow(v.scene.digest, v.rig.digest, v.appearance.digest) for v in plan.variants},
    )


def is_lockfile(path: Path) -> bool:
    """Whether a file begins as a lockfile does. OSError if it cannot be read."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_HEAD)) == _HEAD


def read(path: Path, plan: DatasetPlan | None = None) -> Lockfile:
    """A lockfile from its file; InputError, with the line, if it is not one.

    With the plan that it is to be compared with, it may have a few times as many rows as that stands for, and no more.
    """
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size > MAX_BYTES:
                raise ValueError(f"it has {size:,} bytes, and at most {MAX_BYTES >> 20} MiB are read")
            lines = iter(lambda: file.readline(MAX_LINE), b"")
            return _parse(lines, str(path), _MOST if plan is None else _most_for(plan))
    except FileNotFoundError:
        raise InputError(f"{path}: there is no lockfile; `recipe lock` writes it", code=Code.FILE_NOT_FOUND) from None
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(f"{path}: cannot be read as a lockfile: {reason}", code=Code.INVALID_LOCKFILE) from None


def loads(text: str, name: str) -> Lockfile:
    """A lockfile from its text; `name` is the file that errors point at."""
    return _parse(io.BytesIO(text.encode()), name)


def _most_for(plan: DatasetPlan) -> dict[str, int]:
    """The most rows of each kind that are read where they are compared with a plan: more than differ by an edit."""
    scenes = {variant.scene.digest: variant.scene for variant in plan.variants}.values()
    numbers = {
        "variant": len(plan.variants),
        "trace": len(scenes),
        "body": sum(len(scene.actors) for scene in scenes),
        "frame": sum(
            variant.scene.clock.frames * (len(sensor.capture) + 1)
            for variant in plan.variants
            for sensor in variant.rig.sensors
        ),
    }
    return {kind: min(most, 4 * numbers[kind] + 10_000) if kind in numbers else most for kind, most in _MOST.items()}


def _parse(lines: Iterable[bytes], name: str, most: Mapping[str, int] = _MOST) -> Lockfile:
    """A lockfile from its lines, which are not kept: a second text of it is compared by its digest."""
    reader, seen = _Reader(name, most), hashlib.sha256()
    for number, line in enumerate(lines, start=1):
        seen.update(line)
        if len(line) >= MAX_LINE:
            raise _bad(name, number, f"the line is longer than {MAX_LINE:,} bytes")
        try:
            reader.add(number, line.decode().rstrip("\r\n"))
        except UnicodeDecodeError:
            raise _bad(name, number, "the line is not UTF-8 text") from None
    lock, again = reader.lock(), hashlib.sha256()
    for text in lock._lines():
        again.update(text.encode())
    return replace(lock, sealed=again.digest() == seen.digest())  # one text for one meaning: order, doubles, the seal


class _Reader:
    """The rows of a lockfile, read one by one."""

    def __init__(self, name: str, most: Mapping[str, int]) -> None:
        self._name, self._most, self._head = name, most, ("", "", "")
        self._lock = Lockfile(recipe="", source="", plan="", files={}, tools={}, stages={}, variants={})
        self._numbers = dict.fromkeys(_WIDTHS, 0)
        self._shared: dict[str, str] = {}  # keys and names, each of which is in many rows
        self._lines = 0

    def add(self, number: int, line: str) -> None:
        """One more line; InputError, with its number, if it cannot be in a lockfile."""
        self._lines = number
        if number == 1:
            if line.split()[:1] != ["recipe-lock"]:
                raise _bad(self._name, 1, "this is not a lockfile: its first line is not `recipe-lock 1`")
            if line != f"recipe-lock {FORMAT}":
                found = line[12:60]
                raise _bad(
                    self._name, 1, f"lockfile format {found!r} is not format {FORMAT}, the one this release reads"
                )
            return
        kind, *cells = line.split(" ")
        if kind not in _WIDTHS:
            raise _bad(self._name, number, f"unknown row {kind[:40]!r}; rows are {', '.join(_WIDTHS)}")
        if len(cells) != _WIDTHS[kind]:
            message = f"a {kind} row has {_WIDTHS[kind]} cells after its kind, this one {len(cells)}"
            raise _bad(self._name, number, message)
        self._numbers[kind] += 1
        if self._numbers[kind] > self._most[kind]:
            raise _bad(self._name, number, f"there are more than {self._most[kind]:,} {kind} rows")
        try:
            self._row(kind, cells)
        except ValueError as error:
            raise _bad(self._name, number, f"a broken {kind} row: {error}") from None

    def lock(self) -> Lockfile:
        """All of them."""
        if not self._lines:
            raise _bad(self._name, 1, "this is not a lockfile: its first line is not `recipe-lock 1`")
        recipe, source, plan = self._head
        if not recipe:
            raise _bad(self._name, 1, "the lockfile names no recipe: its `recipe` row is missing")
        return replace(self._lock, recipe=recipe, source=source, plan=plan)

    def _row(self, kind: str, cells: list[str]) -> None:
        lock = self._lock
        if kind == "frame":
            key, sensor, modality, number, value = cells
            if modality not in _MODALITIES:
                raise ValueError(f"there is no modality {modality[:40]!r}")
            place = (self._name_of(key), self._name_of(sensor), _MODALITIES[modality], _whole(number))
            lock.frames[place] = _digest(value)
        elif kind == "body":
            scene, stride, actor, value, checkpoints = cells
            if not _CHECKPOINTS.fullmatch(checkpoints):
                raise ValueError("its checkpoints are not at most 64 of 8 hexadecimal digits")
            points = () if checkpoints == "-" else tuple(checkpoints.split(","))
            motion = BodyMotion(_digest(value), _whole(stride), points)
            lock.bodies[self._name_of(_digest(scene)), self._name_of(actor)] = motion
        elif kind == "variant":
            values = dict(cell.split("=", 1) for cell in cells[1:])
            if sorted(values) != ["appearance", "rig", "scene"]:
                raise ValueError("it needs scene=, rig= and appearance=")
            lock.variants[unquote(cells[0])] = VariantRow(**{k: self._name_of(_digest(v)) for k, v in values.items()})
        elif kind == "trace":
            lock.traces[_digest(cells[0])] = _digest(cells[1])
        elif kind == "file":
            lock.files[unquote(cells[0])] = cells[1]
        elif kind == "tool":
            lock.tools[cells[0]] = cells[1]
        elif kind == "stage":
            lock.stages[cells[0]] = _whole(cells[1])
        elif kind == "recipe":
            self._head = unquote(cells[0]), unquote(cells[1]), cells[2]

    def _name_of(self, cell: str) -> str:
        """A cell without its escapes; the same object for the same text."""
        found = self._shared.get(cell)
        if found is None:
            found = self._shared[cell] = unquote(cell)
        return found


def _digest(cell: str) -> str:
    if not _DIGEST.fullmatch(cell):
        raise ValueError(f"{cell[:20]!r} is not a SHA-256 digest")
    return cell


def _whole(cell: str) -> int:
    if not _WHOLE.fullmatch(cell):
        raise ValueError(f"{cell[:20]!r} is not a whole number of at most nine digits")
    return int(cell)


def _bad(name: str, line: int, message: str) -> InputError:
    return InputError(Problem(message, Place(name, line, 1), code=Code.INVALID_LOCKFILE))
