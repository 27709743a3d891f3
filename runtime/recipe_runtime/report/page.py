"""The page of a dataset, `preview/index.html`: static files of this package, and data that they load.

A page that is opened from a file system can read nothing but scripts and pictures. A data file is therefore a script of
one call, `recipe.add("KEY", 'JSON')`, and nothing else; `faults` refuses any other. Labels are in files of a few frames
each, so that a page of a long dataset opens fast.

    preview/index.html, preview/page/      the static files, equal in all datasets
    preview/data/index.js                  variants, views, modalities, histograms, how to build it again
    preview/data/view-N.js, view-N-F.js    poses and counts of all frames of a view; labels from frame F on
    preview/data/scene-N.js, scene-N-F.js  actors and their paths; their poses from frame F on
    preview/data/scene-N.png               the town from above
    preview/data/events-N.js               events of the variants that share them
    preview/data/patches-V-S-F.js          patches of a sensor of a variant, from frame F on
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import Video
from recipe_runtime.core import layout
from recipe_runtime.core.files import open_inside, read_inside
from recipe_runtime.dataset.card import commands
from recipe_runtime.dataset.schedule import View, views
from recipe_runtime.report import page_data
from recipe_runtime.report.statistics import QUANTITIES, LabelStatistics, plan_statistics

_SITE = Path(__file__).parent / "site"
_CALL = re.compile(rb"recipe\.add\(\"[a-z0-9-]+\", '([^\r\n]*)'\);\n")  # of JSON in ASCII
_LARGEST = 1 << 28  # bytes of a data file

PageFile = tuple[str, Iterable[bytes]]  # path in the dataset, and its pieces


def site() -> dict[str, bytes]:
    """Return the static files, by path in the dataset."""
    files = sorted(path for path in _SITE.iterdir() if path.suffix in (".html", ".css", ".js"))
    return {layout.PAGE if path.suffix == ".html" else layout.page_file(path.name): path.read_bytes() for path in files}


def page_files(
    dataset: DatasetPlan, identity: str, videos: Sequence[Video], root: Path, recipe_file: str | None
) -> Iterator[PageFile]:
    """Yield the files of the page.

    Args:
        dataset: The plan.
        identity: The dataset's identity line.
        videos: The labels of all videos.
        root: The dataset's folder, with `tracks.csv`, `events.csv` and the truth of patches.
        recipe_file: The path of the recipe's pack in the dataset, if it is included.

    Raises:
        ValueError: A file of the dataset is not what a build writes.
        OSError: It cannot be read.
    """
    for path, body in site().items():
        yield path, [body]
    by_name = {(video.variant, video.sensor.name): video for video in videos}
    seen, found = views(dataset), LabelStatistics()
    for number, view in enumerate(seen):
        video = by_name[dataset.variants[view.variants[0]].variant, view.sensor.name]
        yield from _view(number, view, video, found)
    for number, scene in enumerate(page_data.scenes(dataset)):
        yield from _scene(number, dataset, scene, root)
    events: dict[bytes, int] = {}
    for index, variant in enumerate(dataset.variants):
        body = read_inside(root, layout.events_file(variant.variant), _LARGEST)
        if body not in events:
            events[body] = len(events)
            yield data_file(f"events-{events[body]}", page_data.events(body))
        yield from _patches(index, dataset, root)
    shared = [events[read_inside(root, layout.events_file(v.variant), _LARGEST)] for v in dataset.variants]
    document = page_data.overview(dataset, seen, shared) | {
        "identity": identity,
        "commands": commands(dataset, recipe_file),
        "chunk": layout.PAGE_FRAMES,
        "plan": plan_statistics(dataset),
        "statistics": found.document(),
        "quantities": {name: {"title": q.title, "unit": q.unit} for name, q in QUANTITIES.items()},
        "examples": {
            name: [[quantity, number, places] for (quantity, number), places in sorted(counts.examples.items())]
            for name, counts in sorted(found.classes.items())
        },
    }
    yield data_file("index", document)


def _view(number: int, view: View, video: Video, found: LabelStatistics) -> Iterator[PageFile]:
    """Yield the files of a view, and count its labels."""
    poses: list[list[float]] = []
    counts: list[int] = []
    chunk: list[object] = []
    for place, frame in enumerate(video.frames):
        found.add(number, view, frame)
        poses.append(page_data.pose(frame["calibration"]))
        counts.append(len(frame["objects"]))
        chunk.append(page_data.labels(frame))
        if len(chunk) == layout.PAGE_FRAMES:
            yield data_file(f"view-{number}-{place + 1 - layout.PAGE_FRAMES}", chunk)
            chunk = []
    if chunk:
        yield data_file(f"view-{number}-{len(video.frames) - len(chunk)}", chunk)
    poses = poses[:1] if all(pose == poses[0] for pose in poses) else poses
    yield data_file(f"view-{number}", {"poses": poses, "counts": counts})


def _scene(number: int, dataset: DatasetPlan, scene: page_data.Scene, root: Path) -> Iterator[PageFile]:
    """Yield the files of a scene, from the `tracks.csv` of one of its variants."""
    overview = page_data.Paths(scene.plan.clock.frames)
    with open_inside(root, layout.tracks_file(scene.variant)) as file:
        start, chunk = 0, list[object]()
        for frame in overview.read(file):
            chunk.append(frame)
            if len(chunk) == layout.PAGE_FRAMES:
                yield data_file(f"scene-{number}-{start}", chunk)
                start, chunk = start + layout.PAGE_FRAMES, []
        if chunk:
            yield data_file(f"scene-{number}-{start}", chunk)
    picture, box = page_data.ground(scene, overview, dataset)
    yield f"{layout.PAGE_DATA}/scene-{number}.png", [picture]
    yield data_file(f"scene-{number}", {**overview.document(), "box": box})


def _patches(index: int, dataset: DatasetPlan, root: Path) -> Iterator[PageFile]:
    """Yield the files with the patches of a variant."""
    variant = dataset.variants[index]
    for place, sensor in enumerate(variant.rig.sensors if variant.appearance.patches else ()):
        frames = sensor.frames(variant.scene.clock.frames)
        for start in range(0, len(frames), layout.PAGE_FRAMES):
            paths = [
                layout.patches_file(variant.variant, sensor.name, k) for k in frames[start : start + layout.PAGE_FRAMES]
            ]
            rows = [page_data.patches(read_inside(root, path, _LARGEST)) for path in paths]
            yield data_file(f"patches-{index}-{place}-{start}", rows)


def data_file(key: str, value: Mapping[str, object] | Sequence[object]) -> PageFile:
    """Return a data file. The JSON is ASCII, and parsed as such: no key of it has a meaning in a script."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("\\", "\\\\").replace("'", "\\'")
    return f"{layout.PAGE_DATA}/{key}.js", [f"recipe.add(\"{key}\", '{text}');\n".encode()]


def is_data(script: bytes) -> bool:
    """Return whether a script is one call of `recipe.add` with two literals, which does nothing else."""
    call = _CALL.fullmatch(script)
    if call is None or not script.isascii():
        return False
    rest = call[1].replace(b"\\\\", b"_").replace(b"\\'", b"_")  # the escapes that `data_file` writes
    return b"'" not in rest and b"\\" not in rest


def faults(root: Path) -> list[str]:
    """Return what makes a page unsafe to open: a static file that is not this release's, or data with code.

    The folder is not trusted: whoever made a dataset could put a script into its page.
    """
    found = []
    for path, body in site().items():
        try:
            same = read_inside(root, path, len(body) + 1) == body
        except (OSError, ValueError):
            same = False
        if not same:
            found.append(f"{path} is missing, or is not the one of this release")
    folder = root / layout.PAGE_DATA
    for name in sorted(path.name for path in folder.iterdir()) if folder.is_dir() and not folder.is_symlink() else ():
        path = f"{layout.PAGE_DATA}/{name}"
        try:
            safe = not name.endswith(".js") or is_data(read_inside(root, path, _LARGEST))
        except (OSError, ValueError):
            safe = False
        if not safe:
            found.append(f"{path} is not data of a page")
    return found
