"""Paths of all files in a dataset's folder, relative to it, with `/`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.modalities import form_of
from recipe_compiler.ir.plan import DatasetPlan, SensorPlan

MANIFEST = "manifest.json"
CARD = "README.md"
CROISSANT = "croissant.json"
CITATION = "CITATION.cff"
DESCRIPTIONS = (CARD, CROISSANT, CITATION)  # texts for people and catalogues, which may change with a release
KWCOCO = "annotations/kwcoco.json"
MOTS_SPLIT = "MOTS-train"
MOTS_SEQUENCES = f"mots/{MOTS_SPLIT}"
MOTS_SEQMAP = f"mots/seqmaps/{MOTS_SPLIT}.txt"
CONTACT_SHEET = "preview/contact_sheet.png"
OVERLAY_SHEET = "preview/overlay_sheet.png"
PAGE = "preview/index.html"
PAGE_DATA = "preview/data"
PAGE_FRAMES = 32  # of a data file of the page
_OF_PAGE = re.compile(r"preview/(page|data)/[a-z0-9-]{1,100}\.(css|js|png)")


def folder(variant: str) -> str:
    """Return a variant's folder: its name without dots, which readers take for a file extension."""
    return variant.replace(".", "_")


def frame_file(variant: str, sensor: str, modality: str, frame: int, forms: Mapping[str, str]) -> str:
    """A frame's file; `forms` are the plan's."""
    return modality_file(variant, sensor, modality, frame, form_of(modality, forms).ending)


def modality_file(variant: str, sensor: str, modality: str, frame: int, ending: str) -> str:
    """Return the file of a modality of a frame in the form with that ending."""
    return f"{folder(variant)}/{folder(sensor)}/{modality}/{frame:06d}.{ending}"


def patches_file(variant: str, sensor: str, frame: int) -> str:
    """Return the file with the truth of a frame's patches."""
    return f"{folder(variant)}/{folder(sensor)}/patches/{frame:06d}.json"


def labels_file(variant: str, sensor: str) -> str:
    """Return the labels file of a sensor, one line per frame."""
    return f"{folder(variant)}/{folder(sensor)}/labels.jsonl"


def tracks_file(variant: str) -> str:
    """Pose, velocity and box of a variant's actors."""
    return f"{folder(variant)}/tracks.csv"


def events_file(variant: str) -> str:
    """Return the file of a variant's events."""
    return f"{folder(variant)}/events.csv"


def plan_file(variant: str) -> str:
    """A variant's expanded plan."""
    return f"plans/{folder(variant)}.json"


def coco_file(modality: str) -> str:
    """The flat COCO file over the pictures of one modality."""
    return f"annotations/coco/{modality}.json"


def sequence(variant: str, sensor: str) -> str:
    """The MOTS name of one variant's one sensor; without commas, because TrackEval reads lists of names as CSV."""
    return f"{folder(variant)}+{folder(sensor)}".replace(",", "_")


def mots_text_file(variant: str, sensor: str) -> str:
    """A sequence in MOTS's text form."""
    return f"{MOTS_SEQUENCES}/{sequence(variant, sensor)}/gt/gt.txt"


def seqinfo_file(variant: str, sensor: str) -> str:
    """Return the `seqinfo.ini` of a sequence."""
    return f"{MOTS_SEQUENCES}/{sequence(variant, sensor)}/seqinfo.ini"


def mots_png_file(variant: str, sensor: str, frame: int) -> str:
    """A frame in MOTS's PNG form; MOTS counts frames from 1."""
    return f"mots/instances/{sequence(variant, sensor)}/{frame + 1:06d}.png"


def kwcoco_endings(plan: DatasetPlan, sensor: SensorPlan) -> dict[str, str]:
    """Return the ending of the copy for kwcoco of each modality that needs one, by modality."""
    if "kwcoco" not in plan.annotations:
        return {}
    return {name: copy for name in sensor.capture if (copy := form_of(name, plan.forms).copy) is not None}


def label_copies(plan: DatasetPlan, variant: str, sensor: SensorPlan, frame: int) -> dict[str, str]:
    """Return the files of a frame that hold a label modality in another form, by modality; MOTS by `mots_png`."""
    files = {}
    if "mots_png" in plan.annotations:
        files["mots_png"] = mots_png_file(variant, sensor.name, frame)
    for name, ending in kwcoco_endings(plan, sensor).items():
        files[name] = modality_file(variant, sensor.name, name, frame, ending)
    return files


def page_file(name: str) -> str:
    """Return a static file of the page, beside `PAGE`."""
    return f"preview/page/{name}"


def is_of_page(path: str) -> bool:
    """Return whether a path can be a file of the page, besides `PAGE`; their number is not part of the plan."""
    return _OF_PAGE.fullmatch(path) is not None


def recipe_file(name: str) -> str:
    """Return the pack of the recipe of that name."""
    return f"{name}.recipe"


def expected_files(plan: DatasetPlan) -> set[str]:
    """The path of every file of a plan's dataset: no more and no fewer are in it, but for the recipe and the page."""
    files = {MANIFEST, CARD, CROISSANT, CONTACT_SHEET, OVERLAY_SHEET, PAGE}
    files |= {CITATION} if plan.about.authors else set()
    files |= {KWCOCO} if "kwcoco" in plan.annotations else set()
    files |= {coco_file("rgb")} if "coco" in plan.annotations else set()
    files |= {MOTS_SEQMAP} if "mots_txt" in plan.annotations else set()
    for variant in plan.variants:
        name = variant.variant
        files |= {plan_file(name), tracks_file(name), events_file(name)}
        for sensor in variant.rig.sensors:
            frames = sensor.frames(variant.scene.clock.frames)
            files.add(labels_file(name, sensor.name))
            files |= {frame_file(name, sensor.name, m, k, plan.forms) for m in sensor.capture for k in frames}
            if variant.appearance.patches:
                files |= {patches_file(name, sensor.name, k) for k in frames}
            if "mots_txt" in plan.annotations:
                files |= {mots_text_file(name, sensor.name), seqinfo_file(name, sensor.name)}
            files |= {path for k in frames for path in label_copies(plan, name, sensor, k).values()}
    return files


def check_names(dataset: DatasetPlan) -> None:
    """Check that names of recipe, variants and sensors are valid and distinct as folder names.

    Raises:
        InputError: A name cannot be a folder's, or two variants or sensors would share a folder.
    """
    _claim({}, dataset.recipe, "recipe")
    taken: dict[str, str] = {"plans": "plans", "annotations": "annotations", "mots": "mots", "preview": "preview"}
    sequences: dict[str, str] = {}
    for variant in dataset.variants:
        _claim(taken, variant.variant, "variant")
        sensors: dict[str, str] = {}
        for sensor in variant.rig.sensors:
            _claim(sensors, sensor.name, "sensor")
            _claim(sequences, sequence(variant.variant, sensor.name), "sequence")


def _claim(taken: dict[str, str], name: str, what: str) -> None:
    place = folder(name)
    if not place or "/" in place or "\\" in place or not place.isprintable() or len(place.encode()) > 240:
        raise InputError(f"the {what} name {name!r} cannot be a folder's name; give it a plain and shorter one")
    if place in taken:
        raise InputError(f"the {what} {name!r} would share the folder {place}/ with {taken[place]!r}; rename one")
    taken[place] = name
