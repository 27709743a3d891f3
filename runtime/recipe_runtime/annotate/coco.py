"""COCO annotation files: kwcoco with videos, tracks and assets, and flat COCO for one modality.

Ids are digests of names (`annotate.ids`): an image has one id in every file, and ids stay when variants, sensors or
frames are added. An actor has one track in all sensors of a variant. No wall-clock time is written: `date_captured` is
empty, and a timestamp is the time of the frame in seconds from the start. `iscrowd` is always 0, also for an object
whose visible part is in several pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from recipe_compiler.ir.modalities import form_of
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.categories import CATEGORY_IDS, category_rows
from recipe_runtime.annotate.ids import UniqueIds, annotation_id, image_id, track_id, video_id
from recipe_runtime.annotate.records import FrameRecord, Video, by_variant
from recipe_runtime.annotate.rows import tables
from recipe_runtime.core import layout
from recipe_runtime.modalities import declared

Row = dict[str, object]


def kwcoco(dataset: DatasetPlan, identity: str, videos: Sequence[Video]) -> Iterator[str]:
    """Yield the text of the kwcoco file: a video per sensor and variant, a track per variant and visible actor.

    Args:
        dataset: The plan of the dataset.
        identity: The dataset's identity line, written as its version.
        videos: All videos, in the plan's order.

    Raises:
        InputError: Two rows of a table have one id.
    """
    return tables(
        {
            "info": _info(dataset, identity),
            "licenses": _licenses(dataset),
            "categories": category_rows(),
            "videos": _videos(videos),
            "tracks": _tracks(videos),
            "images": _images(dataset, videos),
            "annotations": _annotations(videos),
        }
    )


def flat_coco(dataset: DatasetPlan, identity: str, videos: Sequence[Video], captured: str) -> Iterator[str]:
    """Yield the text of the flat COCO file for the images of one modality.

    File names are relative to the dataset's folder.

    Raises:
        InputError: Two rows of a table have one id.
    """
    chosen = [video for video in videos if captured in video.sensor.capture]
    return tables(
        {
            "info": _info(dataset, identity),
            "licenses": _licenses(dataset),
            "categories": category_rows(),
            "images": _flat_images(dataset, chosen, captured),
            "annotations": _annotations(chosen),
        }
    )


def _licenses(dataset: DatasetPlan) -> list[Row]:
    return [{"id": 1, "name": dataset.about.licence or "not stated", "url": dataset.about.licence_url}]


def _info(dataset: DatasetPlan, identity: str) -> Row:
    return {
        "description": dataset.description,
        "version": identity,
        "url": dataset.about.url,
        "contributor": ", ".join(dataset.about.authors),
        "date_created": "",
    }


def _tracks(videos: Sequence[Video]) -> Iterator[Row]:
    """Yield a row for every actor that is visible in a variant; kwcoco requires unique names."""
    ids = UniqueIds("tracks")
    for variant, mine in by_variant(videos).items():
        items = (item for video in mine for record in video.frames for item in record["objects"])
        instances = {item["instance"]: item["actor"] for item in items}
        for instance, actor in sorted(instances.items()):
            yield {
                "id": ids.add(track_id(variant, actor)),
                "name": f"{variant}/{actor}",
                "variant": variant,
                "actor": actor,
                "instance": instance,
                "category_id": CATEGORY_IDS[instance // 1000],
            }


def _videos(videos: Sequence[Video]) -> Iterator[Row]:
    ids = UniqueIds("videos")
    for video in videos:
        yield {
            "id": ids.add(video_id(video.variant, video.sensor.name)),
            "name": video.name,
            "variant": video.variant,
            "sensor": video.sensor.name,
            "scene": video.scene,
            "framerate": video.fps,
            "width": video.sensor.camera.width,
            "height": video.sensor.camera.height,
        }


def _images(dataset: DatasetPlan, videos: Sequence[Video]) -> Iterator[Row]:
    ids = UniqueIds("images")
    for video in videos:
        for record in video.frames:
            frame, assets = record["frame"], []
            row = _image(video, record, ids)
            size = {"width": row["width"], "height": row["height"]}
            for name in video.sensor.capture:
                form = form_of(name, dataset.forms)
                ending = form.copy or form.ending
                path = layout.modality_file(video.variant, video.sensor.name, name, frame, ending)
                bands = declared(name).files[ending].bands
                assets.append({"file_name": f"../{path}", "channels": bands, "modality": name, **size})
            yield {**row, "name": f"{video.name}/{frame:06d}", "file_name": None, "assets": assets}


def _flat_images(dataset: DatasetPlan, videos: Sequence[Video], captured: str) -> Iterator[Row]:
    ids = UniqueIds("images")
    for video in videos:
        for record in video.frames:
            name = layout.frame_file(video.variant, video.sensor.name, captured, record["frame"], dataset.forms)
            row = {**_image(video, record, ids), "file_name": name}
            yield {**row, "license": 1, "date_captured": "", "coco_url": "", "flickr_url": ""}


def _image(video: Video, record: FrameRecord, ids: UniqueIds) -> Row:
    """Return the fields of an image that every file has."""
    return {
        "id": ids.add(image_id(video.variant, video.sensor.name, record["frame"])),
        "width": video.sensor.camera.width,
        "height": video.sensor.camera.height,
        "video_id": video_id(video.variant, video.sensor.name),
        "frame_index": record["frame"],
        "timestamp": record["time"],
        "calibration": record["calibration"],
    }


def _annotations(videos: Sequence[Video]) -> Iterator[Row]:
    ids = UniqueIds("annotations")
    for video in videos:
        name, size = (video.variant, video.sensor.name), [video.sensor.camera.height, video.sensor.camera.width]
        for record in video.frames:
            image = image_id(*name, record["frame"])
            for item in record["objects"]:
                yield {
                    **{key: value for key, value in item.items() if key != "counts"},
                    "id": ids.add(annotation_id(*name, record["frame"], item["actor"])),
                    "image_id": image,
                    "category_id": CATEGORY_IDS[item["instance"] // 1000],
                    "track_id": track_id(video.variant, item["actor"]),
                    "segmentation": {"size": size, "counts": item["counts"]},
                    "iscrowd": 0,
                }
