"""Error of each method that inserts a patch into a picture, relative to the patch rendered in the scene.

    python -m benchmarks.insertion              # print the table, and write it and the figure into docs/
    python -m benchmarks.insertion --check      # write nothing; exit with 1 if the table is outdated

For each weather and hour of recipes/attacks/poster_hours.yaml: the mean absolute difference from mode `rendered`, in
8-bit levels, over the pixels that show the patch, all channels, and all frames. The figure has a row for each weather
and hour and a column for each method, and shows one frame.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir.patches import TransferMethod
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.loading import opened

from benchmarks.pages import markdown, table_of, write_table

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "recipes" / "attacks" / "poster_hours.yaml"
PAGE, FIGURE = ROOT / "docs" / "attacks.md", ROOT / "docs" / "insertion.jpg"
COMMAND = "python -m benchmarks.insertion"
WEATHERS, HOURS = ("clear", "rainy", "foggy"), ("08h", "12h", "16h", "21h")
TITLES = {
    "rendered": "rendered",
    "green": "placeholder",
    "digital": "digital",
    "armory": "Armory's ratio",
    "dapricot": "D-APRICOT",
    "matrix": "matrix",
    "reap": "REAP's lines",
}
MARGIN, WIDTH, CAPTION, SIDE, QUALITY = 12, 150, 22, 74, 75  # pixels: around the patch, of a picture, of captions
SHOWN = 2  # the frame of the figure

Picture = NDArray[np.uint8]


def main() -> int:
    """Measure every method in every weather at every hour, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare with the page, and write nothing")
    check = parser.parse_args().check
    plan, engines = opened(RECIPE)
    scene = plan.variants[0].scene
    source = SceneSource(scene, engines.simulate(scene), engines=engines)
    table: list[dict[str, str]] = []
    rows: list[tuple[str, list[Picture]]] = []
    for weather, hour in itertools.product(WEATHERS, HOURS):
        variants = variants_of(plan, weather, hour)
        found: dict[str, list[float]] = {}
        for frame in range(scene.clock.frames):
            mask, pictures = compared(source, variants, frame)
            for name, picture in pictures.items():
                difference = np.abs(picture.astype(int) - pictures["rendered"])[mask]
                found.setdefault(name, []).append(float(difference.mean()))
            if frame == SHOWN:
                rows.append((f"{weather} {hour}", [cropped(picture, mask) for picture in pictures.values()]))
        means = {f"`{name}`": f"{np.mean(values):.1f}" for name, values in found.items() if name != "rendered"}
        table.append({"weather": weather, "hour": hour, **means})
    print(markdown(table))
    if not check:
        write_table(PAGE, COMMAND, table)
        sheet(rows).save(FIGURE, quality=QUALITY, optimize=True)
    elif table_of(PAGE, COMMAND) != markdown(table):
        print(f"{PAGE}: the table differs from what was measured", file=sys.stderr)
        return 1
    return 0


def variants_of(plan: DatasetPlan, weather: str, hour: str) -> dict[str, ScenarioPlan]:
    """Return the variants of a weather and hour by method; colour transfer has one for each transfer method."""
    by_name = {variant.variant: variant for variant in plan.variants}
    modes = ("rendered", "green", "digital", "color_transfer")
    found = {mode: by_name[f"weather={weather},insertion={mode},hour={hour}"] for mode in modes}
    transfer = found.pop("color_transfer")
    for method in sorted(get_args(TransferMethod), key=list(TITLES).index):
        patches = tuple(p.model_copy(update={"transfer": method}) for p in transfer.appearance.patches)
        appearance = transfer.appearance.model_copy(update={"patches": patches})
        found[method] = transfer.model_copy(update={"appearance": appearance})
    return found


def compared(
    source: SceneSource, variants: dict[str, ScenarioPlan], frame: int
) -> tuple[NDArray[np.bool_], dict[str, Picture]]:
    """Return the mask of a frame's pixels that show the patch, and the frame's picture by method of insertion."""
    sensor = variants["green"].rig.sensors[0]
    seen = source.observe(sensor, frame)
    mask = source.patch_map(seen, variants["green"].appearance, frame) > 0
    return mask, {name: source.shade(seen, v.appearance, sensor, frame).copy() for name, v in variants.items()}


def cropped(picture: Picture, mask: NDArray[np.bool_]) -> Picture:
    """Return the part of a picture around the pixels of a mask."""
    rows, columns = np.nonzero(mask)
    top, left = max(0, int(rows.min()) - MARGIN), max(0, int(columns.min()) - MARGIN)
    return picture[top : int(rows.max()) + MARGIN, left : int(columns.max()) + MARGIN]


def sheet(rows: Sequence[tuple[str, Sequence[Picture]]]) -> Image.Image:
    """Return the pictures as a table: a row for each weather and hour, a column with a title for each method."""
    height = WIDTH * rows[0][1][0].shape[0] // rows[0][1][0].shape[1]
    picture_table = Image.new("RGB", (SIDE + WIDTH * len(TITLES), CAPTION + height * len(rows)), (255, 255, 255))
    pen, font = ImageDraw.Draw(picture_table), ImageFont.load_default(14)
    for column, title in enumerate(TITLES.values()):
        pen.text((SIDE + column * WIDTH + WIDTH / 2, 3), title, fill=(24, 26, 31), font=font, anchor="ma")
    for row, (name, pictures) in enumerate(rows):
        top = CAPTION + row * height
        for line, word in enumerate(name.split()):
            pen.text((4, top + height / 2 + 18 * (line - 1)), word, fill=(24, 26, 31), font=font)
        for column, picture in enumerate(pictures):
            small = Image.fromarray(picture).resize((WIDTH - 3, height - 3), Image.Resampling.LANCZOS)
            picture_table.paste(small, (SIDE + column * WIDTH + 1, top + 1))
    return picture_table


if __name__ == "__main__":
    sys.exit(main())
