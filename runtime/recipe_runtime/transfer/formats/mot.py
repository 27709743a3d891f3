"""The layout of MOTChallenge (MOT16, MOT17, MOT20), with boxes: TrackEval's `GT_FOLDER`.

    MOT17-train/<sequence>/gt/gt.txt   a line `frame, id, x, y, width, height, counts, class, visibility` for an object
    MOT17-train/<sequence>/seqinfo.ini
    MOT17-train/<sequence>/img1/000001.png
    seqmaps/MOT17-train.txt

Frames, and the pixels of x and y, count from 1. The box is `amodal_bbox`, as MOTChallenge has the box of a whole
person, but within the picture; `visibility` is `visible_fraction`. The id is the instance value. Classes are pedestrian
(1), person on vehicle (2: bicycles and motorcycles, which have riders), car (3) and other vehicle (6: trucks, buses and
trains). `counts` is 1 for class 1, and 0 for all others, which the benchmark does not score.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from recipe_runtime.annotate.mots import seqinfo, seqmap
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.transfer.formats.category_map import CategoryMap, of_benchmark
from recipe_runtime.transfer.formats.format import Entry, Format, Options, categories_of
from recipe_runtime.transfer.formats.sequence import ExportSequence

_SPLIT = "MOT17-train"  # TrackEval's default
_SCORED = 1
_CATEGORIES = of_benchmark(
    {1: "pedestrian", 2: "person_on_vehicle", 3: "car", 6: "non_mot_vehicle"},
    {"Pedestrian": 1, "Rider": 2, "Car": 3, "Truck": 6, "Bus": 6, "Train": 6, "Motorcycle": 2, "Bicycle": 2},
)


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    categories = categories_of(options, _CATEGORIES)
    for sequence in sequences:
        camera, fps = sequence.sensor.camera, sequence.variant.scene.clock.fps
        folder = f"{_SPLIT}/{sequence.name}"
        yield Entry(f"{folder}/gt/gt.txt", box_lines(sequence.labels(), categories))
        info = seqinfo(sequence.name, "img1", fps, sequence.length, camera.width, camera.height)
        yield Entry(f"{folder}/seqinfo.ini", info.encode())
        for frame, picture in sequence.pictures():
            yield Entry(f"{folder}/img1/{frame + 1:06d}.png", picture)
    yield Entry(f"seqmaps/{_SPLIT}.txt", seqmap([sequence.name for sequence in sequences]).encode())


def box_lines(frames: Iterable[LabelledFrame], categories: CategoryMap) -> Iterator[str]:
    """Yield the lines of `gt.txt`, in the order of frames."""
    for frame in frames:
        for item in frame["objects"]:
            category = categories.id(item["instance"])
            if category is not None:
                x, y, width, height = item["amodal_bbox"]
                box = f"{x + 1},{y + 1},{width},{height}"
                last = f"{int(category == _SCORED)},{category},{item['visible_fraction']:.6f}"
                yield f"{frame['frame'] + 1},{item['instance']},{box},{last}\n"


FORMAT = Format(files=_files)
