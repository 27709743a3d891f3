"""Draw docs/presets.jpg: CARLA's presets, each with the cameras of recipes/presets.yaml at one moment.

`make presets` runs it. A row of the sheet has two presets. No digest depends on this picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource

ROOT = Path(__file__).parents[1]
RECIPE, SHEET = ROOT / "recipes" / "presets.yaml", ROOT / "docs" / "presets.jpg"
WIDTH, HEIGHT = 320, 200  # of a picture on the sheet
STRIP, GAP = 20, 4  # of a caption, between pictures
ABREAST = 2  # presets in a row
LARGEST = 700_000  # bytes


def pictures(variants: tuple[ScenarioPlan, ...]) -> dict[str, list[NDArray[np.uint8]]]:
    """Every variant's picture from every sensor, at the middle frame; uint8 [H, W, 3]."""
    scene, rig = variants[0].scene, variants[0].rig
    source, frame = SceneSource(scene, real_engines().simulate(scene)), scene.clock.frames // 2
    shown: dict[str, list[NDArray[np.uint8]]] = {variant.variant: [] for variant in variants}
    for sensor in rig.sensors:
        seen = source.observe(sensor, frame)
        for variant in variants:
            shown[variant.variant].append(source.shade(seen, variant.appearance, sensor, frame))
    return shown


def sheet(shown: dict[str, list[NDArray[np.uint8]]]) -> Image.Image:
    """The pictures laid out, a caption strip below each preset's."""
    views = max(len(row) for row in shown.values())
    block = views * WIDTH + (views - 1) * GAP, HEIGHT + STRIP
    rows = -(-len(shown) // ABREAST)
    laid = Image.new("RGB", (ABREAST * (block[0] + 4 * GAP), rows * (block[1] + GAP)), (24, 26, 31))
    pen, font = ImageDraw.Draw(laid), ImageFont.load_default(14)
    for n, (name, row) in enumerate(shown.items()):
        left, top = (n // rows) * (block[0] + 4 * GAP) + 2 * GAP, (n % rows) * (block[1] + GAP) + GAP
        for k, pixels in enumerate(row):
            small = Image.fromarray(pixels).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
            laid.paste(small, (left + k * (WIDTH + GAP), top))
        pen.text((left, top + HEIGHT + 1), name.removeprefix("preset="), fill=(196, 200, 207), font=font)
    return laid


def save(laid: Image.Image, path: Path) -> None:
    """Write a JPEG of the best quality that stays below the limit."""
    for quality in range(88, 30, -4):
        laid.save(path, quality=quality, optimize=True)
        if path.stat().st_size < LARGEST:
            return


def main() -> None:
    """Draw the sheet, into the file that is named or into docs/."""
    shown = pictures(compile_recipe(RECIPE).plan.variants)
    save(sheet(shown), Path(sys.argv[1]) if len(sys.argv) > 1 else SHEET)


if __name__ == "__main__":
    main()
