"""Where everything lies in a dataset's folder. Paths are relative, with `/`."""

from __future__ import annotations

from recipe_compiler.errors import InputError
from recipe_compiler.plan import DatasetPlan

MANIFEST = "manifest.json"
CARD = "README.md"
KWCOCO = "annotations/kwcoco.json"
MOTS_SPLIT = "MOTS-train"
MOTS_SEQUENCES = f"mots/{MOTS_SPLIT}"
MOTS_SEQMAP = f"mots/seqmaps/{MOTS_SPLIT}.txt"
CONTACT_SHEET = "preview/contact_sheet.png"
OVERLAY_SHEET = "preview/overlay_sheet.png"


def folder(variant: str) -> str:
    """A variant's folder: its name without dots, which readers take for a file's ending."""
    return variant.replace(".", "_")


def frame_file(variant: str, sensor: str, modality: str, frame: int, depth: str) -> str:
    """A frame's file; `depth` is the plan's choice of a form for depth."""
    ending = "npy" if modality == "depth" and depth == "npy" else "png"
    return f"{folder(variant)}/{folder(sensor)}/{modality}/{frame:06d}.{ending}"


def tracks_file(variant: str) -> str:
    """Pose and velocity of a variant's actors."""
    return f"{folder(variant)}/tracks.csv"


def plan_file(variant: str) -> str:
    """A variant's expanded plan."""
    return f"plans/{folder(variant)}.json"


def coco_file(modality: str) -> str:
    """The flat COCO file over the pictures of one modality."""
    return f"annotations/coco/{modality}.json"


def sequence(variant: str, sensor: str) -> str:
    """The MOTS name of one variant's one sensor; without commas, for TrackEval reads lists of them as CSV."""
    return f"{folder(variant)}+{folder(sensor)}".replace(",", "_")


def mots_png_file(variant: str, sensor: str, frame: int) -> str:
    """A frame in MOTS's PNG form; MOTS counts frames from 1."""
    return f"mots/instances/{sequence(variant, sensor)}/{frame + 1:06d}.png"


def check_names(dataset: DatasetPlan) -> None:
    """InputError if two variants, or two sensors of one, would share a folder, or a name cannot be a folder's."""
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
