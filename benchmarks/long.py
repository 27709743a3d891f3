"""`make bench-long`: what ten thousand frames cost whoever has them already, and whoever checks them.

Two figures: a build with nothing to do (of small pictures: it looks at files and not at pixels), and the
verification of 60 frames of 800 x 600 out of 10,000 against a lockfile, with an empty cache: the clip is simulated
again. Making the dataset and the lockfile takes the rest of the time, five to ten minutes.
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
    """Make what is needed, and print both figures."""
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
    """Run a command of `recipe` in a folder, and print its seconds."""
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
