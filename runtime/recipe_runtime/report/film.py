"""Films of a dataset: the annotated pictures of a sensor beside the town from above, as MP4 or GIF."""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan

from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.core import layout
from recipe_runtime.core.files import open_inside
from recipe_runtime.report.annotated import AnnotatedVideo, hue
from recipe_runtime.report.canvas import Canvas
from recipe_runtime.report.page_data import Paths, Scene, ground_canvas, pose

ENDINGS = (".mp4", ".gif")
_INK, _CAMERA = "#1d2126", "#7a2a9b"
_REACH = 25.0  # metres of a field of view
_LEAST = 7  # pixels of the length of an actor


class BirdsEye:
    """The town of a variant from above, with its actors at each frame."""

    def __init__(self, dataset: DatasetPlan, variant: ScenarioPlan, root: Path) -> None:
        paths = Paths(variant.scene.clock.frames)
        with open_inside(root, layout.tracks_file(variant.variant)) as file:
            self._rows = list(paths.read(file))
        self._actors = paths.actors
        self._canvas: Canvas = ground_canvas(Scene(variant.scene, variant.variant), paths, dataset)
        self._ground = self._canvas.finished()

    def picture(self, labels: LabelledFrame, fov: float) -> Image.Image:
        """Return the map at a frame, with the field of view, degrees, of the camera that took it."""
        picture = self._ground.copy()
        pen, scale = ImageDraw.Draw(picture, "RGBA"), self._canvas.scale
        x, y, _, yaw = pose(labels["calibration"])
        px, py = self._canvas.pixel((x, y))
        reach = _REACH * scale
        box = (px - reach, py - reach, px + reach, py + reach)
        pen.pieslice(box, -yaw - fov / 2, -yaw + fov / 2, fill=(122, 42, 155, 70), outline=_CAMERA)
        for (_, instance, length, width), now in zip(self._actors, self._rows[labels["frame"]], strict=True):
            if now:
                side = max(length * scale, _LEAST), max(width * scale, _LEAST * 0.7)
                pen.polygon(
                    _turned(self._canvas.pixel((now[0], now[1])), now[2], side), fill=hue(instance), outline=_INK
                )
        return picture


def _turned(at: Sequence[float], yaw: float, size: Sequence[float]) -> list[tuple[float, float]]:
    """Return the corners of an arrow-shaped actor in pixels; `yaw` counter-clockwise in degrees."""
    turn = np.radians(yaw)
    c, s = float(np.cos(turn)), float(np.sin(turn))
    shape = ((0.5, 0.0), (0.25, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.25, -0.5))
    return [(at[0] + c * x * size[0] - s * y * size[1], at[1] - s * x * size[0] - c * y * size[1]) for x, y in shape]


def film_frames(
    video: AnnotatedVideo, frames: Collection[int], modality: str, drawn: Collection[str]
) -> Iterator[Image.Image]:
    """Yield the pictures of a film: a frame, the map beside it, and the number of the frame below.

    Raises:
        InputError: A file of the dataset is missing or damaged.
    """
    try:
        above = BirdsEye(video.dataset.plan, video.variant, video.dataset.root)
    except (OSError, ValueError) as error:
        raise InputError(f"{video.dataset.name}: {video.variant.variant}: tracks.csv cannot be read: {error}") from None
    font = ImageFont.load_default(14)
    for labels, picture in video.pictures(frames, modality, drawn):
        side = above.picture(labels, video.sensor.camera.fov)
        high = max(picture.height, 240)
        side = side.resize((max(1, round(side.width * high / side.height)), high), Image.Resampling.LANCZOS)
        wide = picture.width + side.width
        page = Image.new("RGB", (wide + wide % 2, high + 24 + high % 2), _INK)  # encoders need even sides
        page.paste(picture, (0, 0))
        page.paste(side, (picture.width, 0))
        text = f"{video.variant.variant}, {video.sensor.name}, frame {labels['frame']}, {labels['time']:.2f} s"
        ImageDraw.Draw(page).text((8, high + 4), text, fill="#ffffff", font=font)
        yield page


def check_film(path: Path) -> None:
    """Check that a film can be written to a path of this name.

    Raises:
        InputError: The ending is unknown, or its encoder is not installed.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: a film is an MP4 or a GIF", help="give it a name that ends in .mp4 or .gif")
    if path.suffix.lower() == ".mp4":
        _av()


def _av() -> Any:
    try:
        import av
    except ImportError:
        remedy = "install it: pip install 'av>=14'; or write a .gif, which does not need it"
        raise InputError("PyAV, which encodes MP4, is not installed", help=remedy, code=Code.MISSING_LIBRARY) from None
    return av


def film_body(path: Path, fps: Fraction, pictures: Iterator[Image.Image], written: Callable[[int], None]) -> bytes:
    """Return the content of a film.

    Args:
        path: Its file, which `check_film` accepted.
        fps: Frames a second.
        pictures: Of one size.
        written: Called with the number of frames so far after each of them.
    """
    body, counted = io.BytesIO(), _counted(pictures, written)
    if path.suffix.lower() == ".mp4":
        _write_mp4(body, fps, counted)
    else:
        shown = [picture.quantize(256, dither=Image.Dither.NONE) for picture in counted]
        shown[0].save(body, format="GIF", save_all=True, append_images=shown[1:], duration=int(1000 / fps), loop=0)
    return body.getvalue()


def _counted(pictures: Iterator[Image.Image], written: Callable[[int], None]) -> Iterator[Image.Image]:
    for number, picture in enumerate(pictures, start=1):
        yield picture
        written(number)


def _write_mp4(body: io.BytesIO, fps: Fraction, pictures: Iterator[Image.Image]) -> None:
    av = _av()
    with av.open(body, "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=fps, options={"crf": "20"})
        stream.pix_fmt = "yuv420p"  # which every player reads
        for picture in pictures:
            if not stream.codec_context.is_open:
                stream.width, stream.height = picture.size
            file.mux(stream.encode(av.VideoFrame.from_image(picture)))
        file.mux(stream.encode())
