"""The dataset card: a README.md that describes the content of the folder and how to build the same dataset again."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence

from recipe_compiler.ir.about import About
from recipe_compiler.ir.modalities import MODALITIES, form_of
from recipe_compiler.ir.plan import DatasetPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.annotate.records import Video
from recipe_runtime.core import layout
from recipe_runtime.dataset.markdown import code_block, one_line, paragraphs
from recipe_runtime.modalities import declared


def card(dataset: DatasetPlan, identity: str, videos: Sequence[Video], recipe_file: str | None = None) -> str:
    """Return the text of README.md; `recipe_file` is the recipe's path in the dataset, if it is included."""
    parts = [
        f"# {one_line(dataset.recipe)}",
        paragraphs(dataset.description),
        f"    {identity}",
        f"![every variant]({layout.CONTACT_SHEET})",
        _counts(videos),
        _objects(videos),
        _layout(dataset),
        *rights(dataset.about),
        *_again(dataset, recipe_file),
        f"`{layout.MANIFEST}` holds the SHA-256 of every file and a digest of every frame's pixels; "
        "`plans/` holds the plan of each variant, fully expanded.",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _again(dataset: DatasetPlan, recipe_file: str | None) -> list[str]:
    """Return the commands that build the dataset again, with arguments quoted for the shell."""
    return [
        "## How to rebuild it",
        "This dataset was built from a recipe by Dataset Recipe (`manifest.json` names the version). The same version "
        "verifies it, and builds it again from the recipe alone, byte for byte:",
        "\n".join(f"    {line}" for line in commands(dataset, recipe_file)),
        *([f"`{recipe_file}` is a pack of the recipe and every file that it uses."] if recipe_file else []),
    ]


def commands(dataset: DatasetPlan, recipe_file: str | None) -> list[str]:
    """Return the commands that verify the dataset in the current folder and build it again, quoted for the shell."""
    recipe, again = shlex.quote(recipe_file or f"{dataset.recipe}.yaml"), shlex.quote(f"../{dataset.recipe}-again")
    return ["recipe verify .", f"recipe build {recipe} --output {again}"]


def rights(about: About) -> list[str]:
    """Return licence, authors and citation, if the recipe states them."""
    rows = {
        "Licence": about.licence,
        "Authors": ", ".join(about.authors),
        "Web page": about.url,
        "Version": about.version,
    }
    lines = "\n".join(f"- {name}: {one_line(text)}" for name, text in rows.items() if text)
    cited = ["Cite it as", code_block(about.citation)] if about.citation else []
    return ["## Licence and citation", *([lines] if lines else []), *cited] if lines or cited else []


def _counts(videos: Sequence[Video]) -> str:
    rows = ["| variant | sensor | frames | size | captured |", "|---|---|---|---|---|"]
    for video in videos:
        camera, captured = video.sensor.camera, ", ".join(video.sensor.capture)
        size = f"{camera.width}x{camera.height}"
        names = f"{one_line(video.variant)} | {one_line(video.sensor.name)}"
        rows.append(f"| {names} | {len(video.frames)} | {size} | {captured} |")
    frames = sum(len(v.frames) for v in videos)
    pictures = sum(len(v.frames) * len(v.sensor.capture) for v in videos)
    variants = len({v.variant for v in videos})
    words = f"{count(variants, 'variant')}, {count(frames, 'frame')}, {count(pictures, 'picture')}."
    return f"## Content\n\n{words}\n\n" + "\n".join(rows)


def _objects(videos: Sequence[Video]) -> str:
    seen: Counter[int] = Counter()
    actors: dict[int, set[int]] = {}
    for video in videos:
        for record in video.frames:
            for item in record["objects"]:
                tag = item["instance"] // 1000
                seen[tag] += 1
                actors.setdefault(tag, set()).add(item["instance"])
    rows = [f"| {CATEGORIES[tag]} | {tag} | {len(actors[tag])} | {seen[tag]} |" for tag in sorted(seen)]
    return "\n".join(["| class | CARLA tag | actors | annotations |", "|---|---|---|---|", *rows])


def _layout(dataset: DatasetPlan) -> str:
    sensors = [sensor for variant in dataset.variants for sensor in variant.rig.sensors]
    captured = [name for name in MODALITIES if any(name in sensor.capture for sensor in sensors)]
    endings = dict.fromkeys(form_of(name, dataset.forms).ending for name in captured)
    files = " or ".join(f"`<variant>/<sensor>/<modality>/000000.{ending}`" for ending in endings)
    lines = [
        "## Files",
        "",
        f"- {files}, frames from 0; labels that variants share are hard links.",
        *(line for name in captured if (line := declared(name).card(dataset))),
        "- `<variant>/<sensor>/labels.jsonl`: one line per frame, the source of every annotation file.",
        "- `<variant>/tracks.csv`: pose, lean, velocity and box of every actor at every frame, in the world: x, y "
        "on the ground, z up, metres and seconds; `events.csv`: collisions, lights, tracks that begin and end.",
    ]
    if any(variant.appearance.patches for variant in dataset.variants):
        lines.append("- `<variant>/<sensor>/patches/000000.json`: corners, mask, depth and homography of every patch.")
    described = {
        "kwcoco": f"- `{layout.KWCOCO}`: videos, tracks, boxes, masks, amodal boxes, 3-D boxes, distances.",
        "coco": "- `annotations/coco/rgb.json`: flat COCO; its paths are relative to this folder.",
        "mots_txt": f"- `{layout.MOTS_SEQUENCES}/`: MOTSChallenge text; `mots/` is TrackEval's GT_FOLDER.",
        "mots_png": "- `mots/instances/`: MOTS PNG, frames from 1; pedestrian 2, car 1, other vehicles 10 (ignored).",
    }
    lines += [described[name] for name in sorted(set(dataset.annotations))]
    return "\n".join(lines)
