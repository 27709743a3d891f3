"""Renew tests/golden/render.json: `python -m tests.golden.renew_render`.

Do so only after an intended change of pixels. With a folder (`python -m tests.golden.renew_render pictures/`) it also
saves the pictures: look at them, and state the cause of the change in the commit.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

from tests.runtime.render.street import golden_digests, golden_pictures

GOLDEN = Path(__file__).with_name("render.json")


def main() -> None:
    """Renew the digests; save the pictures if a folder is given."""
    GOLDEN.write_text(json.dumps(golden_digests(), indent=2, sort_keys=True) + "\n")
    for folder in map(Path, sys.argv[1:]):
        folder.mkdir(parents=True, exist_ok=True)
        for name, picture in golden_pictures().items():
            Image.fromarray(picture).save(folder / f"{name}.png")


if __name__ == "__main__":
    main()
