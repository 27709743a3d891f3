"""The rules of ARCHITECTURE.md: imports lead one way, and each engine is imported by few modules."""

import pytest

from tests.sources import PACKAGES, imports, modules

ABOVE = {
    "recipe_compiler": {"recipe_runtime", "recipe_cli"},
    "recipe_runtime": {"recipe_cli"},
    "recipe_cli": set(),
}
# What the runtime may import of the compiler: values and arithmetic, never the language.
# Only the module through which Python opens a recipe's file may compile one.
COMPILES = "recipe_runtime/loading.py"
DOORS = {
    "pybullet": {"recipe_runtime/simulation/bullet.py"},
    "warp": {"recipe_runtime/render/"},
    "click": {"recipe_cli/"},
    "yaml": {"recipe_compiler/source/yaml_reader.py"},
    "astral": {"recipe_compiler/lowering/sun.py"},
    "zlib_ng": {"recipe_runtime/core/codecs.py"},
    "pycocotools": {"recipe_runtime/annotate/"},
    "PIL": {"recipe_compiler/ir/assets/png.py", "recipe_runtime/report/", "recipe_runtime/modalities/reading.py"},
    "msgspec": {"recipe_runtime/core/documents.py", "recipe_runtime/dataset/plan_reader.py"},
    "fsspec": {"recipe_runtime/transfer/stores.py"},
    "av": {"recipe_runtime/report/film.py"},
    "ray": {"recipe_runtime/build/ray.py"},
    "fiftyone": {"recipe_runtime/fiftyone.py"},
    "torch": {"recipe_runtime/torch/"},
    "multiprocessing": {"recipe_runtime/build/local.py"},
}


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_lead_one_way(package: str) -> None:
    for path, tree in modules(package):
        wrong = {name for name in imports(tree) if name.split(".")[0] in ABOVE[package]}
        assert not wrong, f"{path} imports {sorted(wrong)}"


def test_the_runtime_imports_plans_and_not_the_language() -> None:
    for path, tree in modules("recipe_runtime"):
        for name in imports(tree):
            head, _, rest = name.partition(".")
            if head == "recipe_compiler" and rest:
                known = {"ir", "compile"} if path == COMPILES else {"ir"}
                assert rest.split(".")[0] in known, f"{path} imports {name}"


@pytest.mark.parametrize("engine", DOORS)
def test_each_engine_is_imported_by_its_listed_modules_only(engine: str) -> None:
    entered = set()
    for package in PACKAGES:
        for path, tree in modules(package):
            if any(name.split(".")[0] == engine for name in imports(tree)):
                doors = {door for door in DOORS[engine] if path == door or (door[-1] == "/" and path.startswith(door))}
                assert doors, f"{path} imports {engine}; only {sorted(DOORS[engine])} may"
                entered |= doors
    assert entered == DOORS[engine], f"listed, but without an import: {sorted(DOORS[engine] - entered)}"
