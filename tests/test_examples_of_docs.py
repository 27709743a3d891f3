"""Every example of README.md and docs/*.md runs as it stands, from the top of its page to the end.

The Python blocks of a page are one session. Commands and Python run in one folder, with recipes and examples of this
repository in it. Only these recipes, and those that the commands write, are made smaller.
"""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import textwrap
import webbrowser
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.runner import run_here
from tests.examples.stand_ins import provide_torchvision
from tests.sources import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCKS = re.compile(r"^```(\w*)\n([\s\S]*?)^```$|(?:^ {4}\S.*\n(?:(?: {4}.*)?\n)*)", re.M)
OTHER_PROGRAMS = (
    "make",
    "source",
    "eval",
    ".venv/bin/pip",
    "python",
    "_RECIPE_COMPLETE=fish_source",
)  # minutes, shells
# What needs a server or a git repository, and where it is tested.
ELSEWHERE = {
    "--ray": "make test-ray",
    "s3://bucket/weather_sweep": "make test-s3",
    "lockfiles/rain_bench.lock": "tests/runtime/lifecycle/test_history.py",
}
OPTIONAL = {"torch", "art"}
SMALLER = (
    (r"width: \d+, height: \d+", "width: 32, height: 24"),
    (r"traffic: {.*?}", "traffic: {vehicles: 0}"),
)
FRAMES = {"weather_sweep": 13, "poster": 10, "universal": 12}  # of recipes whose examples need them


@dataclass(frozen=True)
class Example:
    """A block of Python, a recipe or a command, and the line where it starts."""

    kind: str
    text: str
    line: int
    optional: bool


def examples(page: Path) -> Iterator[Example]:
    """Yield the examples of a page; from an import of an optional library on, the Python of a section is optional."""
    text = page.read_text(encoding="utf-8")
    headings = [match.start() for match in re.finditer(r"^## ", text, re.M)]
    optional_until = 0
    for match in BLOCKS.finditer(text):
        language, body = match[1], textwrap.dedent(match[2] or match[0])
        line = text.count("\n", 0, match.start()) + 1
        if language == "python":
            if imports(body) & OPTIONAL:
                optional_until = next((each for each in headings if each > match.start()), len(text))
            yield Example("python", body, line, match.start() < optional_until)
        elif language == "yaml" or body.startswith("recipe: "):
            yield Example("recipe", body, line, False)
        elif not language:
            for number, each in enumerate(body.splitlines() if match[2] or is_command(body) else ()):
                words = shlex.split(each.removeprefix("$ "), comments=True) if is_command(each) else []
                if words:
                    yield Example("command", shlex.join(words), line + number, False)


def is_command(line: str) -> bool:
    return re.match(r"\$ |(?:recipe|make|python|eval|\.venv/bin/pip|_RECIPE_COMPLETE\S+) [a-z\-\"]", line) is not None


def imports(code: str) -> set[str]:
    """Return the libraries that a block imports; `recipe_runtime.torch` counts as torch."""
    found = set()
    for node in ast.walk(ast.parse(code)):
        names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        found |= {name.removeprefix("recipe_runtime.").split(".")[0] for name in names}
    return found


def shrink(folder: Path, done: set[Path]) -> None:
    """Make the recipes of a folder smaller that are not in `done`, and add them to it."""
    for path in sorted(set(folder.rglob("*.yaml")) - done):
        text = path.read_text(encoding="utf-8")
        if re.search(r"^recipe: ", text, re.M):
            for old, new in (*SMALLER, (r"(?<=frames: )\d+", str(FRAMES.get(path.stem, 3)))):
                text = re.sub(old, new, text)
            path.write_text(text, encoding="utf-8")
        done.add(path)


def run_page(page: Path, folder: Path, *, optional: bool) -> int:
    """Run the examples of a page in a folder and return their number."""
    for part in ("recipes", "examples"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    session: dict[str, object] = {"__name__": "__main__"}
    small: set[Path] = set()
    number = 0
    for example in examples(page):
        where = f"{page.relative_to(ROOT)}:{example.line}"
        shrink(folder, small)
        if example.kind == "python":
            if optional or not example.optional:
                exec(compile("\n" * example.line + example.text, str(page), "exec"), session)
        elif example.kind == "recipe":
            (name,) = re.findall(r"^recipe: (\w+)$", example.text, re.M)
            (folder / f"{name}.yaml").write_text(example.text, encoding="utf-8")
            done = run_here("check", f"{name}.yaml", cwd=folder)
            assert done.returncode == 0, f"{where}: {done.stderr}"
        else:
            program, *arguments = shlex.split(example.text)
            if program in OTHER_PROGRAMS or ELSEWHERE.keys() & set(arguments):
                continue
            assert program == "recipe", f"{where}: {program}"
            done = run_here(*arguments, cwd=folder)
            assert done.returncode == 0, f"{where}: {example.text}\n{done.stderr}"
        number += 1
    return number


PLAIN = [page for page in PAGES if any(not example.optional for example in examples(page))]
WITH_PYTORCH = [page for page in PAGES if any(example.optional for example in examples(page))]


@pytest.mark.slow
@pytest.mark.filterwarnings(  # webdataset does not close its shards
    "ignore::pytest.PytestUnraisableExceptionWarning", "ignore:unclosed:ResourceWarning"
)
@pytest.mark.parametrize("page", PLAIN, ids=lambda page: page.stem)
def test_the_examples_of_a_page_run_as_they_stand(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 6 of 46 stopped, at names that no line defined and files that no line wrote."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(webbrowser, "open", lambda url: True)
    run_page(page, tmp_path, optional=False)


@pytest.mark.torch
@pytest.mark.filterwarnings("ignore:This DataLoader will create")  # more workers than this host has cores
@pytest.mark.parametrize("page", WITH_PYTORCH, ids=lambda page: page.stem)
def test_the_examples_with_pytorch_run_as_they_stand(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in sorted(OPTIONAL):
        pytest.importorskip(library)
    provide_torchvision(monkeypatch)
    monkeypatch.chdir(tmp_path)
    assert run_page(page, tmp_path, optional=True)


def test_the_examples_are_found() -> None:
    """The pages have at least the examples that they had when this test was written."""
    found = [example for page in PAGES for example in examples(page)]
    kinds = [example.kind for example in found]
    assert kinds.count("python") >= 8 and kinds.count("recipe") >= 3 and kinds.count("command") >= 40
    assert sum(example.optional for example in found) >= 4
