"""Renew all golden digests after an intended change of bytes: `make golden`. State the cause in the commit."""

from __future__ import annotations

import tempfile
from pathlib import Path

from recipe_compiler.compile import compile_recipe
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.verify import self_test
from recipe_runtime.verify.locking import lock

from tests.golden import renew_render

TINY = Path(__file__).with_name("tiny.yaml")


def _silent(stage: str, done: int, total: int) -> None:
    pass


def _lock(recipe: Path, path: Path, source: str) -> None:
    compiled = compile_recipe(recipe)
    lock(compiled.plan, source, compiled.files, workers=1, progress=_silent).write(path)


def main() -> None:
    """Renew the digests of pictures, the lockfile of the tests, and the digests of `recipe doctor`."""
    renew_render.main()
    _lock(TINY, TINY.with_name("lockfiles") / "tiny.lock", "../tiny.yaml")
    _lock(self_test.RECIPE, self_test.LOCK, self_test.RECIPE.name)
    with tempfile.TemporaryDirectory() as folder:
        made = build(
            compile_recipe(self_test.RECIPE).plan, Path(folder) / "made", BuildOptions(cache=Path(folder) / "cache")
        )
    rows = self_test.file_rows(made.manifest["files"])
    self_test.FILES.write_text("".join(f"{value}  {path}\n" for path, value in rows.items()))


if __name__ == "__main__":
    main()
