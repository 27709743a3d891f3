"""`events.csv`: the events of a variant, with a row for each interval of time.

Collisions come from the contacts in the Trace, presence from the motion in the Trace, lights from the plan, and tracks
from the labels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence

from recipe_compiler.ir import signals
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.annotate.records import Video
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.tracks import field, presence, text

COLUMNS = "event,frame,end_frame,time,end_time,sensor,subject,object,value"

Interval = tuple[int, int]  # first and last frame
Event = tuple[int, int, float, float, str, str, str, str, str]
"""First and last frame, time and end time in seconds, kind, sensor, subject, object, value."""


def distinct_events(
    scene: ScenePlan, trace: Trace, videos: Mapping[str, Sequence[Video]]
) -> Iterator[tuple[list[str], Iterator[bytes]]]:
    """Yield the variants that share a file, and the file in pieces: a header, then the events by their first frames.

    Variants differ only in the tracks of their labels. What the scene determines is computed once.

    Args:
        scene: The scene of the variants.
        trace: The motion of the scene.
        videos: The videos of each variant, with their labels.
    """
    groups: dict[bytes, list[str]] = {}
    for name, mine in videos.items():
        tracks = sorted(_tracks(scene, mine))
        groups.setdefault(hashlib.sha256(repr(tracks).encode()).digest(), []).append(name)
    always = [*_collisions(scene, trace), *_presence(scene, trace), *_lights(scene)]
    for names in groups.values():
        yield names, _pieces(sorted([*always, *_tracks(scene, videos[names[0]])]))


def _pieces(events: Sequence[Event]) -> Iterator[bytes]:
    yield COLUMNS.encode() + b"\n"
    for first, last, time, end, kind, *names in events:
        fields = ",".join(map(field, names))
        yield f"{kind},{first},{last},{text(time)},{text(end)},{fields}\n".encode()


def _event(scene: ScenePlan, kind: str, frames: Interval, subject: str, value: str, sensor: str = "") -> Event:
    first, last = frames
    fps = scene.clock.fps
    return first, last, first / fps, last / fps, kind, sensor, subject, "", value


def _collisions(scene: ScenePlan, trace: Trace) -> Iterator[Event]:
    """Yield the contacts that do not end before frame 0; their value is the impulse in N s."""
    clock = scene.clock
    for contact in trace.contacts or ():
        if contact.end < 0:
            continue
        start, end = max(0, contact.start), contact.end
        frames = [min(step // clock.steps_per_frame, clock.frames - 1) for step in (start, end)]
        times = [step / clock.physics for step in (start, end)]
        names = contact.first, contact.second
        yield frames[0], frames[1], times[0], times[1], "collision", "", *names, f"{contact.impulse:.3f}"


def _presence(scene: ScenePlan, trace: Trace) -> Iterator[Event]:
    """Yield the intervals in which each actor is in the scene."""
    present = presence(trace, range(trace.frames))
    for number, actor in enumerate(trace.actors):
        for frames in _runs(present[:, number].tolist()):
            yield _event(scene, "presence", frames, actor, "")


def _lights(scene: ScenePlan) -> Iterator[Event]:
    """Yield the intervals of equal signals of each traffic light, for vehicles and for pedestrians."""
    times = [frame / scene.clock.fps for frame in range(scene.clock.frames)]
    for element in scene.town.elements:
        if element.kind != "traffic_light":
            continue
        shown = [signals.light(element.shape, time) for time in times]
        walks = [signals.may_walk(element.shape, time) for time in times]
        for frames in _runs(shown):
            yield _event(scene, "light", frames, element.name, shown[frames[0]])
        for frames in _runs(["walk" if walk else "dont_walk" for walk in walks]):
            yield _event(scene, "walk_light", frames, element.name, "walk" if walks[frames[0]] else "dont_walk")


def _tracks(scene: ScenePlan, videos: Sequence[Video]) -> Iterator[Event]:
    """Yield the first and last frame in which each actor is visible to a sensor; the value is its number of frames."""
    for video in videos:
        seen: dict[str, list[int]] = {}
        for record in video.frames:
            for item in record["objects"]:
                seen.setdefault(item["actor"], []).append(record["frame"])
        for actor, frames in seen.items():
            yield _event(scene, "track", (frames[0], frames[-1]), actor, str(len(frames)), video.sensor.name)


def _runs(values: Sequence[object]) -> Iterator[Interval]:
    """Yield the intervals of equal values, except those of False."""
    starts = [n for n, value in enumerate(values) if n == 0 or value != values[n - 1]]
    for start, end in zip(starts, [*starts[1:], len(values)], strict=True):
        if values[start] is not False:
            yield start, end - 1
