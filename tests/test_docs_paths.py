"""Every path, module, target and anchor that the documentation names exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from recipe_runtime.annotate.records import LabelRecord

from tests.sources import PACKAGES, ROOT
from tests.test_layers import LAYERS

PAGES = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")]
PAGES += [page for top in ("docs", "examples") for page in sorted((ROOT / top).rglob("*.md"))]
PAGES += [ROOT / "requirements" / "README.md"]
TOPS = {".ci", "benchmarks", "cli", "compiler", "docs", "examples", "lockfiles", "recipes", "requirements", "runtime"}
TOPS |= {"tests"}
PLACEHOLDER = re.compile(r"[<>*{}$]|NAME|RECIPE|DATASET|FOLDER|rain_bench")  # `commands/NAME.py` stands for any name
pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def code_spans(text: str) -> set[str]:
    """Return the words in backticks and in indented and fenced blocks."""
    fenced = re.findall(r"^```.*?\n(.*?)^```", text, re.M | re.S)
    indented = re.findall(r"^ {4,}(.*)$", text, re.M)
    spans = re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))
    return {word.rstrip(",:;") for span in (*fenced, *indented, *spans) for word in span.split()}


def missing_paths(text: str) -> set[str]:
    """Return words that look like files of this repository but do not exist."""
    roots = {**{top: ROOT / top for top in TOPS}, **PACKAGES}
    absent = set()
    for word in code_spans(text):
        top, slash, rest = word.partition("/")
        if slash and top in roots and not PLACEHOLDER.search(rest) and not (roots[top] / rest).exists():
            absent.add(word)
    return absent


def missing_modules(text: str) -> set[str]:
    """Return dotted names in the three packages that are neither modules nor names that modules define."""
    return {name for name in re.findall(r"\brecipe_(?:compiler|runtime|cli)(?:\.\w+)+", text) if not _resolves(name)}


def _resolves(name: str) -> bool:
    top, *parts = name.split(".")
    place = PACKAGES[top]
    for number, part in enumerate(parts):
        if (place / part).is_dir():
            place = place / part
            continue
        module = place / f"{part}.py"
        if module.exists():
            rest = parts[number + 1 :]
        else:
            module, rest = place / "__init__.py", parts[number:]
        source = module.read_text(encoding="utf-8")
        return not rest or re.search(rf"\b{rest[0]}\b", source) is not None
    return True


def slugs(page: Path) -> set[str]:
    """Return the anchors of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pages
def test_paths_exist(page: Path) -> None:
    assert not missing_paths(page.read_text(encoding="utf-8"))


@pages
def test_modules_exist(page: Path) -> None:
    assert not missing_modules(page.read_text(encoding="utf-8"))


def test_names_are_in_the_files_that_the_steps_give() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    pairs = re.findall(r"`(\w+)`(?:,? (?:in|of)|, to)\s+`([a-z]+/[\w/]+\.py)`", text)
    assert len(pairs) > 5
    for name, path in pairs:
        assert re.search(rf"\b{name}\b", (ROOT / path).read_text(encoding="utf-8")), f"{name} is not in {path}"


@pages
def test_links_have_existing_targets(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        assert not anchor or anchor in slugs(there), target


@pages
def test_make_targets_and_python_modules_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.M))
    assert set(re.findall(r"(?:`|^ {4}|^)make ([a-z][a-z0-9-]*)", text, re.M)) <= targets
    for module in re.findall(r"python -m ((?:benchmarks|examples|tests)[\w.]*)", text):
        place = ROOT / module.replace(".", "/")
        assert place.is_dir() or place.with_suffix(".py").exists(), module


@pytest.mark.parametrize("top", LAYERS)
def test_the_tables_of_the_architecture_list_every_package_and_real_modules(top: str) -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    section = text.partition(f"### {top.removeprefix('recipe_').title()}\n")[2].partition("\n### ")[0]
    rows = re.findall(r"^\| \d+ \| `(\w+)` \| .* \| (.*?) ?\|$", section, re.M)
    root = {"torch", "webdataset", "__init__"}
    assert {name for name, _ in rows} == {part for layer in LAYERS[top] for part in layer} - root
    for package, named in rows:
        folder = PACKAGES[top] / package
        for module in re.findall(r"`([\w./]+)`", named):
            place = folder / module
            assert place.exists() or place.with_suffix(".py").exists(), f"{package}: {module}"


def test_missing_names_are_detected() -> None:
    assert missing_paths("see `docs/no_such_page.md` and `recipe_runtime/core/gone.py`") == {
        "docs/no_such_page.md",
        "recipe_runtime/core/gone.py",
    }
    assert missing_modules("`recipe_runtime.core.gone`, `recipe_runtime.core.trace.gone`") == {
        "recipe_runtime.core.gone",
        "recipe_runtime.core.trace.gone",
    }
    assert not missing_paths("`lockfiles/<recipe>.lock`, `cli/recipe_cli/commands/NAME.py`, `README.md`")
    assert not missing_modules("`recipe_runtime.open`, `recipe_runtime.torch.RecipeDataset`")


def test_the_dataset_page_names_every_key_of_a_label_record() -> None:
    page = (ROOT / "docs" / "dataset.md").read_text(encoding="utf-8")
    assert [key for key in LabelRecord.__annotations__ if f"`{key}`" not in page] == []
