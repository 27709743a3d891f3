"""`recipe view`: a dataset's page, or annotated pictures and films of it."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.modalities import MODALITIES

from recipe_cli import completion
from recipe_cli.arguments import JSON, REPLACE, VARIANT, LocalPath, output_option, writing
from recipe_cli.console import print_json, say
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_runtime.dataset.reader import Dataset
    from recipe_runtime.report.annotated import AnnotatedVideo

_MAX_FRAMES = 100_000  # in a list of frames


@click.command("view")
@click.argument("dataset", type=LocalPath(path_type=Path))
@VARIANT
@click.option("--sensor", metavar="NAME", shell_complete=completion.sensors, help="The sensor; the first by default.")
@click.option("--frames", metavar="LIST", help="Frames such as 0,10-20; with -o FOLDER, write their pictures.")
@click.option(
    "--modality",
    metavar="NAME",
    shell_complete=completion.modalities,
    help=f"{', '.join(MODALITIES)}; the sensor's first by default.",
)
@click.option(
    "--draw",
    metavar="LIST",
    default="boxes,ids",
    show_default=True,
    help="What is drawn over pictures: boxes, masks, ids, amodal, boxes3d, patches, or none.",
)
@output_option(LocalPath(path_type=Path, file_okay=False), "The folder for annotated pictures.")
@click.option(
    "--film",
    type=LocalPath(path_type=Path, dir_okay=False),
    help="Write a film, .mp4 or .gif, of the sensor beside the town from above.",
)
@click.option("--no-open", is_flag=True, help="Check the page and print its path, without a browser.")
@REPLACE
@JSON
def command(
    dataset: Path,
    variant: str | None,
    sensor: str | None,
    frames: str | None,
    modality: str | None,
    draw: str,
    output: Path | None,
    film: Path | None,
    no_open: bool,
    replace: bool,
    as_json: bool,
) -> None:
    """Open the page of DATASET, a folder that `recipe build` wrote, in a browser.

    With --output or --film, write annotated pictures or a film instead.
    """
    if output is None and film is None:
        if (variant, sensor, frames, modality) != (None, None, None, None):
            raise click.UsageError("--variant, --sensor, --frames and --modality need --output or --film.")
        _open(dataset, no_open or as_json, as_json)
        return
    from recipe_runtime.dataset.reader import read

    found = read(dataset)
    video = _video(found, variant, sensor)
    shown = _modality(video, modality)
    drawn, numbers = _drawn(draw), _frames(frames, video)
    document: dict[str, object] = {"variant": video.variant.variant, "sensor": video.sensor.name, "modality": shown}
    if output is not None:
        document["pictures"] = _write_pictures(video, numbers, shown, drawn, output, replace, as_json)
    if film is not None:
        document["film"] = _write_film(video, numbers, shown, drawn, film, replace, as_json)
    if as_json:
        print_json(document)


def _open(dataset: Path, quiet: bool, as_json: bool) -> None:
    """Check the page of a dataset, and show it in a browser."""
    import webbrowser

    from recipe_compiler.ir.errors import Code, InputError
    from recipe_runtime.core import layout
    from recipe_runtime.dataset.reader import read
    from recipe_runtime.report.page import faults

    read(dataset)
    wrong = faults(dataset)
    if wrong:
        more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        raise InputError(
            f"{dataset}: {wrong[0]}{more}",
            help="the page is not opened, because another could run any script; `recipe build --repair` writes it",
            code=Code.INVALID_DATASET,
        )
    path = (dataset / layout.PAGE).resolve()
    opened = not quiet and webbrowser.open(path.as_uri())
    if as_json:
        print_json({"page": str(path), "opened": opened})
    else:
        say(str(path) if opened or quiet else f"no browser was found; open {path}")


def _video(found: Dataset, variant: str | None, sensor: str | None) -> AnnotatedVideo:
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_runtime.report.annotated import AnnotatedVideo

    plan = found.plan.named(variant)
    sensors = {each.name: each for each in plan.rig.sensors}
    if sensor is not None and sensor not in sensors:
        what = f"{plan.variant} has no sensor {sensor!r}; its sensors are {', '.join(sensors)}"
        raise InputError(what, code=Code.UNKNOWN_NAME)
    return AnnotatedVideo(found, plan, sensors[sensor or next(iter(sensors))])


def _modality(video: AnnotatedVideo, modality: str | None) -> str:
    from recipe_compiler.ir.errors import Code, InputError

    captured = video.sensor.capture
    if modality is not None and modality not in captured:
        what = f"{video.sensor.name} does not capture {modality!r}; it captures {', '.join(captured)}"
        raise InputError(what, code=Code.UNKNOWN_NAME)
    return modality or captured[0]


def _drawn(text: str) -> set[str]:
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.report.annotated import DRAWN

    names = {name.strip() for name in text.split(",")} - {"none", ""}
    if names - set(DRAWN):
        raise InputError(f"--draw: {min(names - set(DRAWN))!r} is not one of {', '.join(DRAWN)}, none")
    return names


def _frames(text: str | None, video: AnnotatedVideo) -> list[int]:
    """Return the frames of a list such as `0,10-20`, which the sensor takes; all for None."""
    from recipe_compiler.ir.errors import Code, InputError

    taken = video.sensor.frames(video.variant.scene.clock.frames)
    if text is None:
        return list(taken)
    chosen: set[int] = set()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or len(first) > 9 or len(last) > 9:
            raise InputError(f"--frames: {part!r} is neither a frame nor a range, such as 0,10-20")
        ends = int(first), int(last or first)
        if ends[1] - ends[0] > _MAX_FRAMES:
            raise InputError(f"--frames: {part} has more than {_MAX_FRAMES:,} frames")
        chosen.update(range(ends[0], ends[1] + 1))
    found = [frame for frame in taken if frame in chosen]
    if not found:
        what = f"--frames: {video.sensor.name} takes none of {text}; it takes {taken[0]} to {taken[-1]}"
        raise InputError(what + (f", every {taken.step}" if taken.step > 1 else ""), code=Code.OUT_OF_RANGE)
    return found


def _write_pictures(
    video: AnnotatedVideo, frames: list[int], modality: str, drawn: set[str], out: Path, replace: bool, quiet: bool
) -> list[str]:
    import numpy as np
    from recipe_compiler.ir.plurals import count
    from recipe_runtime.core import codecs, layout
    from recipe_runtime.core.files import make_folder
    from recipe_runtime.core.outputs import check_output, write_output

    name = f"{layout.sequence(video.variant.variant, video.sensor.name)[:140]}-{modality}"
    paths = {frame: out / f"{name}-{frame:06d}.png" for frame in frames}
    with writing(out), Progress(quiet=quiet) as progress:
        make_folder(out)
        for path in paths.values():
            check_output(path, replace=replace)
        for done, (labels, picture) in enumerate(video.pictures(frames, modality, drawn), start=1):
            write_output(paths[labels["frame"]], codecs.png(np.asarray(picture), level=6), replace=replace)
            progress("render", done, len(frames))
    if not quiet:
        say(f"{out}: {count(len(paths), 'picture')}, such as {next(iter(paths.values())).name}")
    return [str(path) for path in paths.values()]


def _write_film(
    video: AnnotatedVideo, frames: list[int], modality: str, drawn: set[str], film: Path, replace: bool, quiet: bool
) -> str:
    from recipe_compiler.ir.plurals import count
    from recipe_runtime.core.outputs import check_output, write_output
    from recipe_runtime.report.film import check_film, film_body, film_frames

    check_film(film)
    fps = Fraction(video.variant.scene.clock.fps, video.sensor.interval)
    with writing(film), Progress(quiet=quiet) as progress:
        check_output(film, replace=replace)
        pictures = film_frames(video, frames, modality, drawn)
        body = film_body(film, fps, pictures, lambda done: progress("render", done, len(frames)))
        write_output(film, body, replace=replace)
    if not quiet:
        say(f"{film}: {count(len(frames), 'frame')}")
    return str(film)
