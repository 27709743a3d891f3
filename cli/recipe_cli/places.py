"""The files of a recipe, and the folders to which commands write."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled


def check_default_folder(folder: Path, option: str = "--output") -> Path:
    """Return the folder to which a command writes unless `option` names one, such as `datasets`.

    Raises:
        InputError: it is a symbolic link, which may have come with a recipe; only a folder that is named may be one.
    """
    from recipe_compiler.ir.errors import Code, InputError

    if folder.is_symlink():
        raise InputError(
            f"{folder} is a symbolic link, and files are written through a link only if it is named",
            help=f"replace the link with a folder, or choose one with {option}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    return folder


def recipe_files(recipe: Path, compiled: Compiled) -> dict[str, bytes]:
    """Return the bytes of the recipe and of every file that it uses."""
    return {path: (recipe.parent / path).read_bytes() for path in compiled.files}


def check_utf8(recipe: Path) -> None:
    """Check that the path of a recipe can be recorded.

    Raises:
        InputError: it has bytes that are not UTF-8.
    """
    from recipe_compiler.ir.errors import InputError

    for path in (str(recipe), os.path.realpath(recipe)):
        try:
            path.encode()
        except UnicodeEncodeError:
            raise InputError(
                f"{path!r}: the path of a recipe is recorded in UTF-8", help="rename the file or its folder"
            ) from None


def used_files(recipe: Path, compiled: Compiled) -> list[Path]:
    """Return the paths of the recipe and of every file that it uses."""
    return [recipe, *(recipe.parent / path for path in compiled.files)]
