"""Import configurations of tests, and compile the recipes."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path

from recipe_compiler.carla import File, Imported, Options, import_configurations
from recipe_compiler.carla.report import Node
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.source import yaml_reader

from tests.sources import ROOT

CONFIGS = Path(__file__).parent / "configs"
PAPER = tuple(ROOT / "examples" / "carla" / f"{name}.yaml" for name in ("config", "rainy", "foggy"))
OSCAR = tuple(CONFIGS / f"oscar_{name}.yaml" for name in ("scene", "context"))
SINGLE = tuple(sorted(path for path in CONFIGS.glob("*.yaml") if path.stem != "oscar_context"))
SEVEN = tuple(sorted((CONFIGS / "collector").glob("*.yaml")))
"""Configurations of the form of the seven that the data collector was published with."""
TOGETHER = {"paper": PAPER, "oscar": OSCAR, **{path.stem: (path,) for path in SINGLE}}
TOGETHER |= {f"collector/{path.stem}": (path,) for path in SEVEN}
"""The files of each import of the tests, by name."""


@functools.cache
def import_files(*paths: Path, options: Options | None = None) -> tuple[Imported, ...]:
    """Return the imports of files, which reports name without folders."""
    return import_configurations([File(path.name, path.read_bytes()) for path in paths], options)


def import_text(text: str, *weathers: str, options: Options | None = None) -> Imported:
    """Return the import of one configuration, `config.yaml`, with weathers `weather0.yaml` and so on."""
    files = [File("config.yaml", text.encode())]
    files += [File(f"weather{number}.yaml", each.encode()) for number, each in enumerate(weathers)]
    (one,) = import_configurations(files, options)
    return one


def compiled(one: Imported, folder: Path) -> Compiled:
    """Return the compiled recipe of an import."""
    path = folder / f"{one.name}.yaml"
    path.write_text(one.text, encoding="utf-8")
    return compile_recipe(path)


def leaves(path: Path) -> Iterator[tuple[str, int, str]]:
    """Return the file, line and path of every scalar and every empty map or list of a file."""
    root, problems = yaml_reader.parse(path.read_bytes(), path.name)
    assert root is not None and not problems
    for leaf in Node.root(root).leaves():
        yield path.name, leaf.place.line, leaf.key
