"""The layout of MOTSChallenge: TrackEval's `GT_FOLDER`.

    MOTS-train/<sequence>/gt/gt.txt   masks
    MOTS-train/<sequence>/seqinfo.ini
    MOTS-train/<sequence>/img1/000001.png
    seqmaps/MOTS-train.txt

Frames count from 1. Pedestrians are class 2 and cars class 1; all other actors form one ignore region, class 10. With
`--categories`, classes are the ids of the map, and actors without one are in the ignore region.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from recipe_runtime.annotate.categories import MOTS_CLASSES
from recipe_runtime.annotate.mots import mots_lines, seqinfo, seqmap
from recipe_runtime.core import layout
from recipe_runtime.transfer.formats.category_map import CategoryMap
from recipe_runtime.transfer.formats.format import Entry, Format, Options, categories_of
from recipe_runtime.transfer.formats.sequence import ExportSequence

_CATEGORIES = CategoryMap(MOTS_CLASSES, {1: "car", 2: "pedestrian"})


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    classes = categories_of(options, _CATEGORIES).ids
    for sequence in sequences:
        camera, fps = sequence.sensor.camera, sequence.variant.scene.clock.fps
        folder = f"{layout.MOTS_SPLIT}/{sequence.name}"
        yield Entry(f"{folder}/gt/gt.txt", mots_lines(sequence.labels(), camera.width, camera.height, classes=classes))
        info = seqinfo(sequence.name, "img1", fps, sequence.length, camera.width, camera.height)
        yield Entry(f"{folder}/seqinfo.ini", info.encode())
        for frame, picture in sequence.pictures():
            yield Entry(f"{folder}/img1/{frame + 1:06d}.png", picture)
    yield Entry(f"seqmaps/{layout.MOTS_SPLIT}.txt", seqmap([sequence.name for sequence in sequences]).encode())


FORMAT = Format(files=_files)
