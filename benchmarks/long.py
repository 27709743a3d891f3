"""`make bench-long`: the cost of ten thousand frames that exist already, and of their verification.

Two figures: a build with nothing to do (of small pictures, because it checks files and not pixels), and the
verification of 60 frames of 800 x 600 out of 10,000 against a lockfile with an empty cache, including the simulation of
the clip. Making the dataset and the lockfile takes most of the time, five to ten minutes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from recipe_runtime.cache.store import kernel_cache

RECIPE = Path(__file__).parent / "long.yaml"
SMALL = "width: 64, height: 48"


def main() -> None:
    """Make the dataset and the lockfile, and print both figures."""
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as name:
        folder, text = Path(name), RECIPE.read_text()
        (folder / "long.yaml").write_text(text)
        (folder / "small.yaml").write_text(
            text.replace("recipe: long", "recipe: small").replace("width: 800, height: 600", SMALL)
        )
        timed(folder, "making 10,000 small frames", "build", "small.yaml")
        timed(folder, "a build with nothing to do", "build", "small.yaml")
        timed(folder, "locking 10,000 frames of 800 x 600", "lock", "long.yaml")
        timed(folder, "verifying 60 of them, the cache empty", "verify", "long.yaml", "--frames", "60", cache="empty")


def timed(folder: Path, what: str, *arguments: str, cache: str = "cache") -> None:
    """Run a `recipe` command in a folder, and print its time in seconds."""
    start = time.perf_counter()
    environment = {"RECIPE_KERNEL_CACHE": str(kernel_cache()), **os.environ, "RECIPE_CACHE": str(folder / cache)}
    subprocess.run(
        [sys.executable, "-m", "recipe_cli", *arguments],
        cwd=folder,
        env=environment,
        check=True,
        capture_output=True,
    )
    print(f"{what}: {time.perf_counter() - start:.2f} s", flush=True)


if __name__ == "__main__":
    main()
