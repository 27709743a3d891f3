"""COCO annotation files: kwcoco with videos, tracks and assets, and flat COCO for one modality.

Ids count from 1 in the order of videos, frames and instances. A track's id is the instance value of its actor: an actor
has one track in the whole file, also across videos. No wall-clock time is written: `date_captured` is empty, and a
timestamp is the time of the frame in seconds from the start. `iscrowd` is always 0, also for an object whose visible
part is in several pieces.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence

from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.categories import CATEGORY_IDS, category_rows
from recipe_runtime.annotate.records import LabelRecord, Video
from recipe_runtime.annotate.rows import tables
from recipe_runtime.core import layout

Row = dict[str, object]

_CHANNELS = {
    ("rgb", "png"): "red|green|blue",
    ("depth", "png"): "depth_low|depth_middle|depth_high",
    ("depth", "npy"): "depth",
    ("instance", "png"): "instance",
    ("semantic", "png"): "semantic",
}


def kwcoco(dataset: DatasetPlan, identity: str, videos: Sequence[Video]) -> Iterator[str]:
    """Yield the text of the kwcoco file: a video per sensor and variant, a track per actor visible in any.

    Args:
        dataset: The plan of the dataset.
        identity: The dataset's identity line, written as its version.
        videos: All videos, in the plan's order.
    """
    return tables(
        {
            "info": _info(dataset, identity),
            "licenses": _LICENSES,
            "categories": category_rows(),
            "videos": [_video(video, number) for number, video in enumerate(videos, start=1)],
            "tracks": _tracks(videos),
            "images": _images(dataset, videos),
            "annotations": _annotations(videos),
        }
    )


def flat_coco(dataset: DatasetPlan, identity: str, videos: Sequence[Video], modality: str) -> Iterator[str]:
    """Yield the text of the flat COCO file for the images of one modality.

    File names are relative to the dataset's folder.
    """
    return tables(
        {
            "info": _info(dataset, identity),
            "licenses": _LICENSES,
            "categories": category_rows(),
            "images": _flat_images(dataset, videos, modality),
            "annotations": _annotations([video for video in videos if modality in video.sensor.capture]),
        }
    )


_LICENSES: list[Row] = [{"id": 1, "name": "not stated", "url": ""}]


def _info(dataset: DatasetPlan, identity: str) -> Row:
    return {
        "description": dataset.description,
        "version": identity,
        "url": "",
        "contributor": "",
        "date_created": "",
    }


def _tracks(videos: Sequence[Video]) -> list[Row]:
    """Return a row for every visible actor.

    kwcoco requires unique names: the instance value is appended to a name that two instances share.
    """
    items = (item for video in videos for record in video.frames for item in record["objects"])
    actors: dict[int, str] = {}
    for item in items:
        actors.setdefault(item["instance"], item["actor"])
    count = Counter(actors.values())
    return [
        {
            "id": instance,
            "name": actor if count[actor] == 1 else f"{actor}#{instance}",
            "actor": actor,
            "instance": instance,
            "category_id": CATEGORY_IDS[instance // 1000],
        }
        for instance, actor in sorted(actors.items())
    ]


def _video(video: Video, number: int) -> Row:
    camera = video.sensor.camera
    row = {"id": number, "name": video.name, "variant": video.variant, "sensor": video.sensor.name}
    return {**row, "framerate": video.fps, "width": camera.width, "height": camera.height}


def _images(dataset: DatasetPlan, videos: Sequence[Video]) -> Iterator[Row]:
    number = itertools.count(1)
    for video_id, video in enumerate(videos, start=1):
        for frame in range(0, video.length, video.sensor.interval):
            yield _image(dataset, video, video_id, frame, next(number))


def _flat_images(dataset: DatasetPlan, videos: Sequence[Video], modality: str) -> Iterator[Row]:
    number = itertools.count(1)
    for video_id, video in enumerate(videos, start=1):
        camera = video.sensor.camera
        taken = range(0, video.length, video.sensor.interval)
        for frame in taken if modality in video.sensor.capture else ():
            name = layout.frame_file(video.variant, video.sensor.name, modality, frame, dataset.depth)
            row: Row = {"id": next(number), "file_name": name, "width": camera.width, "height": camera.height}
            row |= {"license": 1, "date_captured": "", "coco_url": "", "flickr_url": ""}
            yield {**row, "video_id": video_id, "frame_index": frame}


def _annotations(videos: Sequence[Video]) -> Iterator[Row]:
    """Yield the annotations of all frames, with ids that count the frames of these videos."""
    number, image_id = itertools.count(1), 0
    for video in videos:
        camera = video.sensor.camera
        for record in video.frames:
            image_id += 1
            for item in record["objects"]:
                yield _annotation(item, image_id, next(number), camera.width, camera.height)


def _image(dataset: DatasetPlan, video: Video, video_id: int, frame: int, image_id: int) -> Row:
    size = {"width": video.sensor.camera.width, "height": video.sensor.camera.height}
    assets = []
    for modality in video.sensor.capture:
        path = layout.frame_file(video.variant, video.sensor.name, modality, frame, dataset.depth)
        channels = _CHANNELS[modality, path.rpartition(".")[2]]
        assets.append({"file_name": f"../{path}", "channels": channels, "modality": modality, **size})
    return {
        "id": image_id,
        "name": f"{video.name}/{frame:06d}",
        "file_name": None,
        "video_id": video_id,
        "frame_index": frame,
        "timestamp": round(frame / video.fps, 6),
        "assets": assets,
        **size,
    }


def _annotation(item: LabelRecord, image_id: int, annotation_id: int, width: int, height: int) -> Row:
    kept = {key: value for key, value in item.items() if key != "counts"}
    return {
        **kept,
        "id": annotation_id,
        "image_id": image_id,
        "category_id": CATEGORY_IDS[item["instance"] // 1000],
        "track_id": item["instance"],
        "segmentation": {"size": [height, width], "counts": item["counts"]},
        "iscrowd": 0,
    }
