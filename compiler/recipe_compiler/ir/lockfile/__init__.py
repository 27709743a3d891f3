"""The lockfile: the digests of all that a recipe produces, as text that can be reviewed as a diff.

One row per line, kinds in a fixed order and sorted within; the format's version comes first. It contains no time, host,
user or absolute path. Rows:

    recipe-lock 1
    recipe NAME PATH DATASET-PLAN-DIGEST                   PATH leads from the lockfile's folder to the recipe
    identity NAME@sha256:DIGEST                            the dataset, for citing it
    file PATH SHA256                                       the recipe, every file it includes, and every asset
    tool NAME VERSION                                      what it was made with
    stage NAME VERSION                                     of each stage that bytes depend on
    variant NAME scene=D rig=D appearance=D                plan digests
    trace SCENE DIGEST                                     the motion of a scene
    body SCENE STRIDE ACTOR DIGEST CHECKPOINTS             an actor's motion, and its first eight digits so far
    frame KEY SENSOR MODALITY NUMBER DIGEST                pixels; KEY is the observation of labels, the scenario
                                                           of colour: labels that variants share are listed once
    seal DIGEST                                            over all rows above; detects damage
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import itertools
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from urllib.parse import quote

from recipe_compiler.ir.bounded_reads import open_regular
from recipe_compiler.ir.canonical import canonical_bytes, digest_chunks
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.lockfile.rows import FORMAT, MAX_LINE, RESTORE, RowParser, invalid_line
from recipe_compiler.ir.lockfile.rows import BodyMotion as BodyMotion
from recipe_compiler.ir.lockfile.rows import FrameKey as FrameKey
from recipe_compiler.ir.lockfile.rows import VariantRow as VariantRow
from recipe_compiler.ir.plan import DatasetPlan

_HEAD = b"recipe-lock "
MAX_BYTES = 1 << 28


@dataclass(frozen=True)
class Lockfile:
    """A lockfile's rows. Two that are equal, and have their variants in equal order, have equal text."""

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
    sealed: bool = field(default=True, compare=False)  # whether the text that it was read from has a valid seal

    @cached_property
    def identity(self) -> str:
        """The identity of the dataset, for citation: the recipe's name and a digest over plans, traces and pixels."""
        return f"{quote(self.recipe)}@sha256:{digest_chunks('dataset/1', self._identity_chunks())}"

    def _identity_chunks(self) -> Iterator[bytes]:
        """The canonical bytes that the identity is a digest of, frame by frame to save memory."""
        yield b'{"frames":['
        for number, (key, value) in enumerate(sorted(self.frames.items())):
            yield (b"," if number else b"") + canonical_bytes([*key, value])
        variants = [[n, v.scene, v.rig, v.appearance] for n, v in self.variants.items()]
        rest = {"plan": self.plan, "variants": variants, "traces": dict(self.traces)}
        yield b"]," + canonical_bytes(rest)[1:]

    def dumps(self) -> str:
        """The text of the lockfile."""
        return "".join(self._lines())

    def equals_but_for_tools(self, other: Lockfile) -> bool:
        """Return whether this lockfile is undamaged and differs from the other at most in tool versions."""
        same = list(self.variants) == list(other.variants)  # their order is part of the identity
        return same and self.sealed and replace(self, tools={}) == replace(other, tools={})

    def equals_but_for_text(self, other: Lockfile) -> bool:
        """As `equals_but_for_tools`, but names and content of the recipe's files may differ too."""
        return self.equals_but_for_tools(replace(other, source=self.source, files=self.files))

    def other_recipe(self, path: Path, recipe: Path, plan: str) -> Path | None:
        """Return the other recipe that this lockfile belongs to.

        Args:
            path: the path of this lockfile.
            recipe: the recipe file in question.
            plan: the digest of its plan.

        Returns:
            The recipe file from which the lockfile was made, if it exists, is not `recipe`, and the plans differ; else
                None. A recipe that was renamed or moved keeps its lockfile.
        """
        source = path.parent / self.source
        try:
            if self.plan == plan or Path(self.source).is_absolute() or not source.is_file():
                return None
            return None if recipe.exists() and source.samefile(recipe) else Path(os.path.normpath(source))
        except (OSError, ValueError):  # an invalid path
            return None

    def missing_recipe(self, path: Path, recipe: Path, plan: str) -> Path | None:
        """Return the deleted recipe file from which this lockfile was made, unless it has the same name or plan.

        The recipe may have been renamed and not locked since; then this is its only lockfile.

        Args:
            path: the path of this lockfile.
            recipe: the recipe file in question.
            plan: the digest of its plan.
        """
        if self.plan == plan or Path(self.source).is_absolute():
            return None
        source = Path(os.path.normpath(path.parent / self.source))
        try:
            return None if os.path.lexists(source) or source.resolve() == recipe.resolve() else source
        except (OSError, ValueError):  # an invalid path
            return None

    def write(self, path: Path) -> bool:
        """Write it in place of any file, unless that differs in tool versions at most; whether it was written."""
        with contextlib.suppress(InputError):
            if path.exists() and read(path).equals_but_for_tools(self):
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
    """The lockfile of a compiled recipe, without traces and frames."""
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
    """Whether a file starts like a lockfile.

    Raises:
        OSError: it cannot be read.
    """
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_HEAD)) == _HEAD


def read(path: Path) -> Lockfile:
    """Read a lockfile.

    Raises:
        InputError: it is not a valid lockfile; the place is the line.
    """
    with _lines_of(path) as lines:
        return _parse(lines, str(path))


def read_source(path: Path) -> str:
    """The path of the recipe that a lockfile names, from its first rows; the others are not read.

    Raises:
        InputError: it is not a lockfile, or names no recipe there.
    """
    parser = RowParser(str(path))
    with _lines_of(path) as lines:
        for number, line in enumerate(itertools.islice(lines, 2), start=1):
            parser.add(number, line.decode().rstrip("\r\n"))
    if not parser.source:
        raise invalid_line(str(path), 2, "the second row names no recipe", RESTORE)
    return parser.source


@contextlib.contextmanager
def _lines_of(path: Path) -> Iterator[Iterator[bytes]]:
    """The lines of a lockfile; InputError if it is absent, too large or unreadable."""
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size > MAX_BYTES:
                raise ValueError(f"it has {size:,} bytes, and at most {MAX_BYTES >> 20} MiB are read")
            yield iter(lambda: file.readline(MAX_LINE), b"")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no lockfile; `recipe lock` writes it", code=Code.FILE_NOT_FOUND) from None
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        refused = isinstance(error, PermissionError)
        raise InputError(
            f"{path}: cannot be read as a lockfile: {reason}",
            help="allow this user to read it" if refused else "",
            code=Code.INVALID_LOCKFILE,
        ) from None


def loads(text: str, name: str) -> Lockfile:
    """A lockfile from its text; `name` is the file that errors point at."""
    return _parse(io.BytesIO(text.encode()), name)


def _parse(lines: Iterable[bytes], name: str) -> Lockfile:
    """Parse lines. They are not stored; the lockfile's own text is compared with them by digest.

    Lines may all end with CR LF, as git writes them on Windows.
    """
    parser, seen, ends = RowParser(name), hashlib.sha256(), set[bool]()
    for number, line in enumerate(lines, start=1):
        ends.add(line.endswith(b"\r\n"))
        seen.update(line[:-2] + b"\n" if line.endswith(b"\r\n") else line)
        if len(line) >= MAX_LINE:
            raise invalid_line(name, number, f"the line is longer than {MAX_LINE:,} bytes", RESTORE)
        try:
            parser.add(number, line.decode("ascii").rstrip("\r\n"))
        except UnicodeDecodeError:
            raise invalid_line(name, number, "the line is not ASCII text", RESTORE) from None
    lock, again = Lockfile(**vars(parser.rows())), hashlib.sha256()
    for text in lock._lines():
        again.update(text.encode())
    # the text is canonical: order, duplicates, seal
    return replace(lock, sealed=len(ends) == 1 and again.digest() == seen.digest())
