"""Error of each method that inserts a patch into a picture, relative to the patch rendered in the scene.

    python -m benchmarks.insertion
    python -m benchmarks.insertion --frames 2 --figure docs/insertion.jpg

For each weather of recipes/attacks/poster.yaml: the mean absolute difference from mode `rendered`, in 8-bit levels,
over the pixels that show the patch, all channels, and frames spread over the clip. `--figure` writes a JPEG with a
column for each method. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import json
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

RECIPE = Path(__file__).parents[1] / "recipes" / "attacks" / "poster.yaml"
WEATHERS = ("clear", "rainy", "foggy", "night")
TITLES = {
    "rendered": "rendered",
    "green": "placeholder",
    "digital": "digital",
    "armory": "Armory's ratio",
    "dapricot": "D-APRICOT",
    "matrix": "matrix",
    "reap": "REAP's lines",
}
MARGIN, WIDTH, CAPTION = 12, 190, 20  # pixels: margin around the patch, width of a picture, height of a caption
QUALITY = 88  # of the JPEG

Picture = NDArray[np.uint8]


def main() -> None:
    """Measure every method in every weather and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=4, help="frames to compare, spread over the clip")
    parser.add_argument("--figure", type=Path, help="a JPEG file to write")
    arguments = parser.parse_args()
    plan, engines = opened(RECIPE)
    scene = plan.variants[0].scene
    source = SceneSource(scene, engines.simulate(scene), engines=engines)
    step = scene.clock.frames // arguments.frames
    errors: dict[str, dict[str, float]] = {}
    rows: list[list[Picture]] = []
    print(
        f"| weather | {' | '.join(name for name in TITLES if name != 'rendered')} |\n|---|{'---|' * (len(TITLES) - 1)}"
    )
    for weather in WEATHERS:
        variants = variants_of(plan, weather)
        found: dict[str, list[float]] = {}
        for frame in range(step // 2, step * arguments.frames, step):
            mask, pictures = compared(source, variants, frame)
            for name, picture in pictures.items():
                difference = np.abs(picture.astype(int) - pictures["rendered"])[mask]
                found.setdefault(name, []).append(float(difference.mean()))
        rows.append([cropped(picture, mask) for picture in pictures.values()])
        errors[weather] = {name: sum(values) / len(values) for name, values in found.items() if name != "rendered"}
        print(f"| {weather} | {' | '.join(f'{value:.1f}' for value in errors[weather].values())} |", flush=True)
    if arguments.figure is not None:
        sheet(rows).save(arguments.figure, quality=QUALITY, optimize=True)
    print(json.dumps(errors))


def variants_of(plan: DatasetPlan, weather: str) -> dict[str, ScenarioPlan]:
    """Return the variants of a weather by insertion method; colour transfer has one for each transfer method."""
    by_name = {variant.variant: variant for variant in plan.variants}
    found = {mode: by_name[f"weather={weather},insertion={mode}"] for mode in ("rendered", "green", "digital")}
    transfer = by_name[f"weather={weather},insertion=color_transfer"]
    for method in sorted(get_args(TransferMethod), key=list(TITLES).index):
        patches = tuple(p.model_copy(update={"transfer": method}) for p in transfer.appearance.patches)
        appearance = transfer.appearance.model_copy(update={"patches": patches})
        found[method] = transfer.model_copy(update={"appearance": appearance})
    return found


def compared(
    source: SceneSource, variants: dict[str, ScenarioPlan], frame: int
) -> tuple[NDArray[np.bool_], dict[str, Picture]]:
    """Return the pixels of a frame that show the patch, and the frame's picture by insertion method."""
    sensor = variants["green"].rig.sensors[0]
    seen = source.observe(sensor, frame)
    mask = source.patch_map(seen, variants["green"].appearance, frame) > 0
    return mask, {name: source.shade(seen, v.appearance, sensor, frame).copy() for name, v in variants.items()}


def cropped(picture: Picture, mask: NDArray[np.bool_]) -> Picture:
    """Return the part of a picture around the pixels of a mask."""
    rows, columns = np.nonzero(mask)
    top, left = max(0, int(rows.min()) - MARGIN), max(0, int(columns.min()) - MARGIN)
    return picture[top : int(rows.max()) + MARGIN, left : int(columns.max()) + MARGIN]


def sheet(rows: Sequence[Sequence[Picture]]) -> Image.Image:
    """Return the pictures as a table: a row for each weather, a column with a title for each method."""
    height = WIDTH * rows[0][0].shape[0] // rows[0][0].shape[1]
    table = Image.new("RGB", (WIDTH * len(rows[0]), CAPTION + height * len(rows)), (24, 26, 31))
    pen, font = ImageDraw.Draw(table), ImageFont.load_default(14)
    for column, title in enumerate(TITLES.values()):
        pen.text((column * WIDTH + 6, 1), title, fill=(226, 230, 237), font=font)
        for row, pictures in enumerate(rows):
            small = Image.fromarray(pictures[column]).resize((WIDTH - 2, height - 2), Image.Resampling.LANCZOS)
            table.paste(small, (column * WIDTH + 1, CAPTION + row * height + 1))
    return table


if __name__ == "__main__":
    main()
