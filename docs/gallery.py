"""Draw docs/gallery.jpg: four towns at noon, at dusk, at night, in rain and in fog.

`make gallery` runs it. The pictures are those of `make evidence-pictures`. No digest depends on this picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont
from recipe_runtime.loading import compiled
from recipe_runtime.scenario import Scenario, Scenes

ROOT = Path(__file__).parents[1]
SHEET = ROOT / "docs" / "gallery.jpg"
SHOWN = {"downtown": "along", "plaza": "square", "suburb": "street", "highway": "verge"}  # the camera of each town
WEATHERS = ("noon", "dusk", "night", "rain", "fog")
FRAME = 12
WIDTH, HEIGHT, STRIP, GAP = 480, 270, 20, 4  # of a picture, of a caption, between pictures; pixels


def main() -> None:
    """Draw the sheet, into the file that is named or into docs/."""
    page = Image.new("RGB", (len(SHOWN) * (WIDTH + GAP), len(WEATHERS) * (HEIGHT + STRIP)), (24, 26, 31))
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(14)
    for column, (town, sensor) in enumerate(SHOWN.items()):
        variants = compiled(ROOT / "benchmarks" / "pictures" / f"crowd_{town}.yaml").variants
        scenes, plans = Scenes(), {variant.variant: variant for variant in variants}
        for row, weather in enumerate(WEATHERS):
            scenario = Scenario(plans[f"streets=full,weather={weather}"], scenes)
            picture = Image.fromarray(scenario.render(FRAME, sensor).astype("uint8"))
            place = column * (WIDTH + GAP), row * (HEIGHT + STRIP)
            page.paste(picture.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS), place)
            pen.text((place[0] + 4, place[1] + HEIGHT + 1), f"{town}, {weather}", fill=(196, 200, 207), font=font)
    page.save(Path(sys.argv[1]) if len(sys.argv) > 1 else SHEET, quality=84, optimize=True)


if __name__ == "__main__":
    main()
