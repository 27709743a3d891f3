"""The renderer's packages form layers: none imports from a higher layer or another package of its own layer."""

from __future__ import annotations

import pytest

from tests.sources import PACKAGES, imports, parsed

LAYERS = (
    {"device"},
    {"numeric", "scene"},
    {"raster", "texture"},
    {"linear", "sampling"},
    {"atmosphere", "patches", "shadows"},
    {"lighting"},
    {"camera"},
    {"gpu", "retexture"},
    {"renderer"},
)
LEVEL = {package: level for level, packages in enumerate(LAYERS) for package in packages}
FOLDER = PACKAGES["recipe_runtime"] / "render"
MODULES = {path.relative_to(FOLDER).as_posix()[:-3]: path for path in sorted(FOLDER.rglob("*.py"))}


def test_every_package_has_a_layer() -> None:
    assert {name.split("/")[0] for name in MODULES} - {"__init__"} == set(LEVEL)


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"__init__"}))
def test_no_import_points_up(module: str) -> None:
    own = module.split("/")[0]
    for name in imports(parsed(MODULES[module])):
        head, _, rest = name.partition("recipe_runtime.render.")
        other = rest.split(".")[0]
        if not head and other and other != own:
            assert LEVEL[other] < LEVEL[own], f"{module} imports {name}"


def test_no_package_imports_its_modules() -> None:
    """Importing one module of the renderer loads only what it needs."""
    for module, path in MODULES.items():
        if module.endswith("__init__"):
            assert list(imports(parsed(path))) == [], module
