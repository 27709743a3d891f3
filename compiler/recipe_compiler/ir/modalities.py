"""The registry of modalities: one entry for each, all that the compiler knows of it, and the only list of their names.

The code of a modality is `recipe_runtime.modalities.NAME`. New entries are appended: the order is part of the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal


@dataclass(frozen=True)
class Form:
    """A form of a modality's files.

    Attributes:
        name: The form, as in a recipe's `output`.
        help: The form in words.
        size: Bytes of a file per pixel of the picture, compression included and the copy not.
        seconds: Seconds of one core for a megapixel: to encode it, and to compute it if not every observation has it.
        level_size: The same of a level camera that does not move; None: `size`.
        ending: Ending of the files' names.
        copy: Ending of a copy in another form, which kwcoco needs because it does not read this one.
        copy_size: Bytes of the copy per pixel of the picture.
    """

    name: str
    help: str
    size: float
    seconds: float
    level_size: float | None = None
    ending: str = "png"
    copy: str | None = None
    copy_size: float = 0.0


@dataclass(frozen=True)
class ModalityEntry:
    """A modality, as the compiler knows it.

    Attributes:
        name: Its name, also of its folders.
        help: The modality in words.
        forms: The forms of its files, the default first.
        is_label: Whether it follows from scene and rig. Otherwise, it depends on the appearance.
        always_listed: Whether plans and manifests list its form even if it is the default.
    """

    name: str
    help: str
    forms: tuple[Form, ...]
    is_label: bool = True
    always_listed: bool = False


_KINDS = (
    ModalityEntry("rgb", "colour, antialiased", (Form("png", "8-bit sRGB PNG", 1.52, 0.015),), is_label=False),
    ModalityEntry(
        "depth",
        "metres along the optical axis; the camera's far limit for the sky",
        (
            Form("carla", "CARLA's 24-bit PNG, in which distances end at 1000 m", 0.5, 0.02, level_size=0.15),
            Form("npy", "float32", 4.0, 0.01, ending="npy", copy="tif", copy_size=0.9),
        ),
        always_listed=True,
    ),
    ModalityEntry(
        "instance",
        "CARLA tag * 1000 + number of the actor; 0 for town and sky",
        (Form("png", "16-bit PNG", 0.006, 0.003),),
    ),
    ModalityEntry("semantic", "CARLA 0.9.14+ tag", (Form("png", "8-bit PNG", 0.016, 0.003),)),
    ModalityEntry(
        "normals",
        "unit normal of the surface in the optical frame (x right, y down, z forward); 0 for the sky",
        (
            Form("png", "16-bit RGB PNG", 0.9, 0.1),
            Form("npy", "float32", 12.0, 0.06, ending="npy", copy="png", copy_size=0.9),
        ),
    ),
)

KINDS: Mapping[str, ModalityEntry] = {kind.name: kind for kind in _KINDS}
"""All modalities by name, in the order of a plan's `capture`."""

MODALITIES: tuple[str, ...] = tuple(KINDS)
"""The names of all modalities, in the order of a plan's `capture`."""

LABEL_MODALITIES: tuple[str, ...] = tuple(kind.name for kind in _KINDS if kind.is_label)
"""The modalities that depend on the scene and the rig only, and not on the appearance."""

DIGEST_KINDS: tuple[str, ...] = (*LABEL_MODALITIES, "labels", *(kind.name for kind in _KINDS if not kind.is_label))
"""What a lockfile has digests of for each frame, in pipeline order; `labels` are the annotations."""

CHOICES: Mapping[str, tuple[Form, ...]] = {kind.name: kind.forms for kind in _KINDS if len(kind.forms) > 1}
"""The forms that a recipe chooses from, by modality."""

if TYPE_CHECKING:
    Modality = str
else:
    Modality = Literal[MODALITIES]


def form_of(modality: str, forms: Mapping[str, str]) -> Form:
    """Return the form of a modality's files; `forms` are the chosen ones by modality, as in a plan."""
    known = KINDS[modality].forms
    return next(form for form in known if form.name == forms.get(modality, known[0].name))


def listed(forms: Mapping[str, str]) -> dict[str, str]:
    """Return the forms that plans and manifests list, by modality: all that are not the default, and depth's."""
    rows = {name: forms.get(name, known[0].name) for name, known in CHOICES.items()}
    return {name: form for name, form in rows.items() if KINDS[name].always_listed or form != CHOICES[name][0].name}


def checked(forms: dict[str, str]) -> dict[str, str]:
    """Return the forms that plans list; ValueError if a modality does not have one of them to choose."""
    for name, form in forms.items():
        if form not in [known.name for known in CHOICES.get(name, ())]:
            raise ValueError(f"{name[:40]!r} has no form {form[:40]!r}")
    return listed(forms)
