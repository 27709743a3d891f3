"""The error for a path without a recipe states what the path is, and suggests a recipe."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.source.file_help import recipe_of_folder
from recipe_compiler.source.similar_names import similar_names


def _files(folder: Path, *names: str, text: str = "recipe: a\n") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(text)


def test_for_a_folder_a_recipe_in_it_is_suggested(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "mine"
    _files(folder, "notes.txt")
    assert recipe_of_folder(folder) == "name a recipe file, such as NAME.yaml"
    _files(folder, "b.yaml", "c.yml")
    assert recipe_of_folder(folder) == f'did you mean "{folder}/b.yaml"?'
    _files(tmp_path, "mine.yaml")
    assert recipe_of_folder(folder) == f'did you mean "{tmp_path}/mine.yaml"?'
    monkeypatch.chdir(folder)
    assert recipe_of_folder(Path()) == 'did you mean "b.yaml"?'


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (b"recipe-lock 1\nrecipe a\n", "is a lockfile, and not a recipe; name its recipe"),
        (b"PK\x03\x04\x14", "is a pack or another archive, and not a recipe; `recipe check`, .* take packs"),
        (b"\xff\xd8\xff\xe0", "is a picture, and not a recipe; name a recipe file"),
    ],
)
def test_files_of_other_kinds_are_recognised(tmp_path: Path, body: bytes, message: str) -> None:
    """Regression: they were refused with `not a text file in UTF-8`."""
    path = tmp_path / "a.yaml"
    path.write_bytes(body)
    with pytest.raises(InputError, match=message):
        compile_recipe(path)


def test_long_names_are_compared_in_part() -> None:
    assert similar_names("a" * 5000, ["b", "a" * 100], 1, 0.9) == ["a" * 100]
