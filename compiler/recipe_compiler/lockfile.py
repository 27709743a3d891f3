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
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from urllib.parse import quote, unquote

from recipe_compiler.canonical import digest, digest_bytes
from recipe_compiler.errors import InputError, Place, Problem
from recipe_compiler.files import read_regular
from recipe_compiler.plan import DatasetPlan

FORMAT = 1
_HEAD = b"recipe-lock "
MAX_BYTES = 1 << 28
SHORT = 16  # digits of a digest that serve as a key within one lockfile
_WIDTHS = {
    "recipe": 3, "identity": 1, "file": 2, "tool": 2, "stage": 2, "variant": 4, "trace": 2, "body": 5, "frame": 5,
    "seal": 1,
}  # fmt: skip

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
        pixels = [[*key, value] for key, value in sorted(self.frames.items())]
        variants = [[n, v.scene, v.rig, v.appearance] for n, v in self.variants.items()]
        body = {"plan": self.plan, "variants": variants, "traces": dict(self.traces), "frames": pixels}
        return f"{quote(self.recipe)}@sha256:{digest('dataset/1', body)}"

    def dumps(self) -> str:
        """The text of the lockfile."""
        body = "\n".join(" ".join(row) for row in self._rows()) + "\n"
        return f"{body}seal {_seal(body)}\n"

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
        text = self.dumps()
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
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


def read(path: Path) -> Lockfile:
    """A lockfile from its text; InputError, with the line, if it is not one."""
    try:
        content = read_regular(path, MAX_BYTES)
        if len(content) > MAX_BYTES:
            raise ValueError(f"it is larger than {MAX_BYTES >> 20} MiB")
        text = content.decode()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no lockfile; `recipe lock` writes it") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read as a lockfile: it is not UTF-8 text") from None
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise InputError(f"{path}: cannot be read as a lockfile: {reason}") from None
    return loads(text, str(path))


def loads(text: str, name: str) -> Lockfile:
    """A lockfile from its text; `name` is the file that errors point at."""
    lines = text.splitlines()
    if not lines or lines[0].split()[:1] != ["recipe-lock"]:
        raise _bad(name, 1, "this is not a lockfile: its first line is not `recipe-lock 1`")
    if lines[0] != f"recipe-lock {FORMAT}":
        raise _bad(name, 1, f"lockfile format {lines[0][12:]!r} is not format {FORMAT}, the one this release reads")
    lock = Lockfile(recipe="", source="", plan="", files={}, tools={}, stages={}, variants={})
    head = [""] * 3
    for number, line in enumerate(lines[1:], start=2):
        kind, *cells = line.split(" ")
        if kind not in _WIDTHS:
            raise _bad(name, number, f"unknown row {kind[:40]!r}; rows are {', '.join(_WIDTHS)}")
        if len(cells) != _WIDTHS[kind]:
            raise _bad(name, number, f"a {kind} row has {_WIDTHS[kind]} cells after its kind, this one {len(cells)}")
        try:
            if kind == "recipe":
                head = [unquote(cells[0]), unquote(cells[1]), cells[2]]
            elif kind not in ("identity", "seal"):
                _add_row(lock, kind, cells)
        except ValueError as error:
            raise _bad(name, number, f"a broken {kind} row: {error}") from None
    if not head[0]:
        raise _bad(name, 1, "the lockfile names no recipe: its `recipe` row is missing")
    lock = replace(lock, recipe=head[0], source=head[1], plan=head[2])
    return replace(lock, sealed=lock.dumps() == text)  # one text for one meaning: order, doubles and the seal count


def _seal(body: str) -> str:
    return digest_bytes("lockfile/1", body.encode())


def _add_row(lock: Lockfile, kind: str, cells: list[str]) -> None:
    if kind == "file":
        lock.files[unquote(cells[0])] = cells[1]
    elif kind == "tool":
        lock.tools[cells[0]] = cells[1]
    elif kind == "stage":
        lock.stages[cells[0]] = int(cells[1])
    elif kind == "variant":
        values = dict(cell.split("=", 1) for cell in cells[1:])
        if sorted(values) != ["appearance", "rig", "scene"]:
            raise ValueError("it needs scene=, rig= and appearance=")
        lock.variants[unquote(cells[0])] = VariantRow(**values)
    elif kind == "trace":
        lock.traces[cells[0]] = cells[1]
    elif kind == "body":
        checkpoints = () if cells[4] == "-" else tuple(cells[4].split(","))
        lock.bodies[cells[0], unquote(cells[2])] = BodyMotion(cells[3], int(cells[1]), checkpoints)
    else:
        if len(cells[3]) > 9:
            raise ValueError("its frame number is too large")
        lock.frames[cells[0], unquote(cells[1]), cells[2], int(cells[3])] = cells[4]


def _bad(name: str, line: int, message: str) -> InputError:
    return InputError(Problem(message, Place(name, line, 1)))
