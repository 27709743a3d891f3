"""Error of each method that inserts a patch into a picture, relative to the patch rendered in the scene.

    python -m benchmarks.insertion              # print the table, and write it and the figure into docs/
    python -m benchmarks.insertion --check      # write nothing; exit with 1 if the table is outdated

For each weather and hour of recipes/attacks/poster_hours.yaml: the mean absolute difference from mode `rendered`, in
8-bit levels, over the pixels that show the patch, all channels, and all frames. The figure has a row for each weather
and hour and a column for each method, and shows one frame.

A second table has the pixels of `digital` that do not show the patch and differ from `rendered`, since wet ground
reflects the placeholder. Its last columns are errors of `dapricot` with what Armory does to a texture before it is
warped: enlargement by 3 %, then OpenCV's cubic filter, which does not average when it downsamples.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir.patches import TransferMethod
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.insertion.warp import reduced, sampled
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes

from benchmarks.pages import markdown, table_of, write_table

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "recipes" / "attacks" / "poster_hours.yaml"
PAGE, FIGURE = ROOT / "docs" / "attacks.md", ROOT / "docs" / "insertion.jpg"
COMMAND = "python -m benchmarks.insertion"
BESIDE = f"{COMMAND}, other pixels"
TEXTURE = ROOT / "recipes" / "attacks" / "poster.png"
ENLARGED = 1.06  # by Armory: 3 % of the extent on each side
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
    scenes = Scenes("cpu", engines)
    source = SceneSource(scene, engines.simulate(scene), engines=engines)
    table: list[dict[str, str]] = []
    beside: list[dict[str, str]] = []
    rows: list[tuple[str, list[Picture]]] = []
    for weather, hour in itertools.product(WEATHERS, HOURS):
        variants = variants_of(plan, weather, hour)
        found: dict[str, list[float]] = {}
        armory: dict[str, list[float]] = {}
        beyond = Differences()
        for frame in range(scene.clock.frames):
            mask, pictures = compared(source, variants, frame)
            for name, picture in pictures.items():
                difference = np.abs(picture.astype(int) - pictures["rendered"])[mask]
                found.setdefault(name, []).append(float(difference.mean()))
            beyond.add(pictures["digital"], pictures["rendered"], ~mask)
            for name, error in armory_errors(variants["dapricot"], scenes, frame, pictures["rendered"]).items():
                armory.setdefault(name, []).append(error)
            if frame == SHOWN:
                rows.append((f"{weather} {hour}", [cropped(picture, mask) for picture in pictures.values()]))
        means = {f"`{name}`": f"{np.mean(values):.1f}" for name, values in found.items() if name != "rendered"}
        table.append({"weather": weather, "hour": hour, **means})
        errors = {name: f"{np.mean(values):.1f}" for name, values in armory.items()}
        beside.append({"weather": weather, "hour": hour, **beyond.row(scene.clock.frames), **errors})
    return written({COMMAND: table, BESIDE: beside}, rows, check)


def written(tables: dict[str, list[dict[str, str]]], rows: Sequence[tuple[str, Sequence[Picture]]], check: bool) -> int:
    """Print tables, and write them and the figure, or compare them with the page; return the exit code."""
    for table in tables.values():
        print(markdown(table), end="\n\n")
    if check:
        wrong = [command for command, table in tables.items() if table_of(PAGE, command) != markdown(table)]
        if wrong:
            print(f"{PAGE}: the table of {wrong[0]} differs from what was measured", file=sys.stderr)
        return 1 if wrong else 0
    for command, table in tables.items():
        write_table(PAGE, command, table)
    sheet(rows).save(FIGURE, quality=QUALITY, optimize=True)
    return 0


@dataclass
class Differences:
    """Pixels of pictures that differ from a reference."""

    sums: list[int] = field(default_factory=list)  # of the absolute differences of a pixel's channels
    largest: int = 0

    def add(self, picture: Picture, reference: Picture, where: NDArray[np.bool_]) -> None:
        """Count the pixels of a mask that differ."""
        difference = np.abs(picture.astype(int) - reference)[where]
        self.sums += difference.sum(axis=1)[difference.any(axis=1)].tolist()
        self.largest = max(self.largest, int(difference.max()))

    def row(self, frames: int) -> dict[str, str]:
        """Return the number in a frame, their mean difference and the largest one, in levels."""
        mean = sum(self.sums) / (3 * max(len(self.sums), 1))
        return {"other pixels": f"{len(self.sums) // frames}", "mean": f"{mean:.1f}", "largest": f"{self.largest}"}


def armory_errors(variant: ScenarioPlan, scenes: Scenes, frame: int, rendered: Picture) -> dict[str, float]:
    """Return the errors of `dapricot` as it is, with Armory's enlargement, and with its cubic filter as well.

    The quadrilateral is enlarged in the plane of the patch, not to whole pixels as in Armory.
    """
    shown, name = Scenario(variant, scenes).retextured(frame), variant.appearance.patches[0].name
    pixels, found = shown.inserted_pixels(name), shown.color_change(name)
    assert pixels is not None and found is not None
    (change, ratios), texture = found, np.asarray(Image.open(TEXTURE).convert("RGB"))
    size = pixels.reduced_size(texture.shape[1], texture.shape[0])
    averaged = change.texture(reduced(texture, *size))
    cubic = np.clip(resized(resized(change.texture(texture.astype(float)), size[1], 0), size[0], 1), 0, 255)
    middle = 0.5 - 0.5 / ENLARGED
    inward = np.array([[1 / ENLARGED, 0, middle], [0, 1 / ENLARGED, middle], [0, 0, 1]])
    enlarged = replace(pixels, homography=inward @ pixels.homography)
    cases = {"`dapricot`": (averaged, pixels), "enlarged": (averaged, enlarged), "enlarged, cubic": (cubic, enlarged)}
    truth, errors = rendered[pixels.rows, pixels.columns].astype(float), {}
    for case, (image, places) in cases.items():
        values = np.floor(np.clip(sampled(image, *places.places()) * ratios, 0, 255) + 0.5)
        errors[case] = float(np.abs(values - truth).mean())
    return errors


def resized(image: NDArray[np.float64], size: int, axis: int) -> NDArray[np.float64]:
    """Resize an axis of an image by cubic convolution, as OpenCV does: four texels, also when it becomes smaller."""
    at = (np.arange(size) + 0.5) * image.shape[axis] / size - 0.5
    first = np.floor(at).astype(int)
    total = np.zeros(())
    for step in range(-1, 3):
        distance = np.abs(at - first - step)
        near = (1.25 * distance - 2.25) * distance * distance + 1.0
        far = -0.75 * (((distance - 5.0) * distance + 8.0) * distance - 4.0)
        weight = np.expand_dims(np.where(distance <= 1.0, near, far), tuple(a for a in range(3) if a != axis))
        total = total + weight * np.take(image, np.clip(first + step, 0, image.shape[axis] - 1), axis)
    return total


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
