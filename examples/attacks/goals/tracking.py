"""Misleading a tracker: a poster that a tracked person walks past, optimised in one, five or ten videos."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from recipe_runtime.loading import compiled
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.torch import SceneView

from benchmarks.pages import Table
from examples.attacks.goals import sheet
from examples.attacks.goals.bootstrap import mean, rate
from examples.attacks.goals.correlation_tracker import GRID, WINDOW, track, trained, windows
from examples.attacks.goals.detection import RATE, RECIPES, noise, start
from examples.attacks.goals.parts import Part, Parts, Study

COUNTS, FRAMES = ("1 video", "5 videos", "10 videos"), 24  # of an attack; of a video
SIZE = (48, 48)  # texels: height, width
ASPECT = 0.45  # width of a box, heights of the person: of tracker and truth, so that strides do not count
LOST = 0.1  # intersection over union below which the tracker has lost the person

_VIDEOS = tuple("base" if number == 1 else f"base#{number}" for number in range(1, 21))
_TEST = _VIDEOS[10:]
_WAYS = ("each frame", "one texture")
_PAIRS, _SHARPNESS, _JITTER, _REGION = 4, 20.0, 0.1, 6  # in a step; of the response; heights; samples
_SHOWN_KINDS = ("grey", *(f"{way}, {count}" for way in _WAYS for count in (COUNTS[0], COUNTS[-1])))
_SHOWN, _SHOWN_FRAMES = _TEST[1], (6, 11, 15, 19, 23)
_TRUE, _TRACKED = (40, 220, 90), (255, 230, 40)  # colours of boxes


def run(kind: str, seed: int, steps: int) -> Part:
    """Attack with a kind of texture, or make one, and track the persons of videos that no attack has seen."""
    if kind == "grey":
        textures = torch.full((1, 3, *SIZE), 0.5)
    elif kind == "random":
        textures = noise(SIZE, seed)
    else:
        how, _, count = kind.rpartition(", ")
        textures = _attack(_VIDEOS[: int(count.split()[0])], how == _WAYS[0], seed, steps)
    videos = {video: _overlaps(video, textures) for video in (*_VIDEOS[:1], *_TEST)}
    return Part({"videos": videos}, textures)


def tables(parts: Parts) -> dict[str, Table]:
    """Return the tracker's success by texture and number of videos, and the change from one to ten videos."""
    return {
        "tracking": [_row(kind, found) for kind, found in parts.items()],
        "tracking by video": [
            {"texture": kind} | {video: f"{np.mean([p.values['videos'][video] for p in found]):.2f}" for video in _TEST}
            for kind, found in parts.items()
        ],
        "tracking differences": _differences(parts),
    }


def draw(parts: Parts, path: Path) -> None:
    """Write a sheet of some kinds: the first texture of each, in a test video, with the boxes of truth and tracker."""
    rows = []
    for kind in (kind for kind in _SHOWN_KINDS if kind in parts):
        textures = parts[kind][0].textures
        pictures, truth = _film(_SHOWN, textures), _truth(_SHOWN)
        seen = track(pictures, truth[0, :2], WINDOW * float(truth[0, 2]))
        cells = [(kind, sheet.square(textures[len(textures) // 2]))]
        for frame in _SHOWN_FRAMES:
            shown = sheet.pixels(pictures[frame])
            for box, colour in ((truth[frame], _TRUE), (torch.cat([seen[frame], truth[0, 2:]]), _TRACKED)):
                sheet.outline(shown, _corners(box[None])[0].tolist(), colour)
            cells.append((f"frame {frame}", shown))
        rows.append(cells)
    sheet.save(rows, path)


def _attack(videos: tuple[str, ...], each: bool, seed: int, steps: int) -> torch.Tensor:
    """Return a texture, or one for each frame, that moves the peak of the filter's response away from the person.

    Each step takes some frames at random. The filter is that of the video's first and the frame's previous picture; the
    search window lies where a tracker without error would look, up to a small offset.
    """
    generator = torch.Generator().manual_seed(seed)
    textures = start(SIZE, seed).repeat(FRAMES if each else 1, 1, 1, 1).requires_grad_()
    optimiser = torch.optim.Adam([textures], lr=RATE)
    for video in videos:  # record the frames of a scene together: its renderer is kept for two scenes only
        _film(video, textures)
    for _ in range(steps):
        chosen = torch.randint(len(videos), (_PAIRS,), generator=generator).tolist()
        frames = torch.randint(2, FRAMES, (_PAIRS,), generator=generator).tolist()
        loss = torch.stack(
            [_loss(videos[v], f, textures, generator) for v, f in zip(chosen, frames, strict=True)]
        ).mean()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call, unused-ignore]
        optimiser.step()
        with torch.no_grad():
            textures.clamp_(0, 1)
    return textures.detach().mul(255).round().div(255)


def _loss(video: str, frame: int, textures: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Return the logarithm of the share of the response that lies on the person."""
    truth = _truth(video)
    first, before, now = (_picture(video, k, textures) for k in (0, frame - 1, frame))
    side = WINDOW * truth[:1, 2]
    kept = trained(windows(first, truth[:1, :2], side)).mixed(
        trained(windows(before, truth[frame - 1 : frame, :2], side)), 0.5
    )
    middle = truth[frame - 1, :2] + _JITTER * truth[0, 2] * (2 * torch.rand(2, generator=generator) - 1)
    response = kept.response(windows(now, middle[None], side))[0]
    person = (truth[frame, :2] - middle) / side * GRID + GRID // 2
    apart = torch.stack(torch.meshgrid(torch.arange(GRID), torch.arange(GRID), indexing="xy"), dim=-1) - person
    on_person = apart.abs().amax(dim=-1) <= _REGION
    likely = (_SHARPNESS * response).flatten()
    return likely[on_person.flatten()].logsumexp(0) - likely.logsumexp(0)


def _overlaps(video: str, textures: torch.Tensor) -> list[float]:
    """Return the intersection over union of the tracker's box and the person's in each frame after the first."""
    truth = _truth(video)
    places = track(_film(video, textures), truth[0, :2], WINDOW * float(truth[0, 2]))
    seen, boxes = _corners(torch.cat([places, truth[:1, 2:].expand(len(places), -1)], dim=1)), _corners(truth)
    low, high = torch.maximum(seen[:, :2], boxes[:, :2]), torch.minimum(seen[:, 2:], boxes[:, 2:])
    shared = (high - low).clamp(min=0).prod(dim=1)
    areas = [(box[:, 2:] - box[:, :2]).prod(dim=1) for box in (seen, boxes)]
    found: list[float] = (shared / (areas[0] + areas[1] - shared))[1:].tolist()
    return found


def _film(video: str, textures: torch.Tensor) -> torch.Tensor:
    with torch.no_grad():
        return torch.cat([_picture(video, frame, textures) for frame in range(FRAMES)])


def _picture(video: str, frame: int, textures: torch.Tensor) -> torch.Tensor:
    texture = textures[frame : frame + 1] if len(textures) > 1 else textures
    return _scene(video)[1].pictures(texture, batch=1, step=frame)


def _corners(boxes: torch.Tensor) -> torch.Tensor:
    """Return boxes [n, 4], x0, y0, x1, y1, of middles and heights [n, 3]."""
    half = boxes[:, 2:] * torch.tensor([ASPECT / 2, 0.5])
    return torch.cat([boxes[:, :2] - half, boxes[:, :2] + half], dim=1)


def _row(kind: str, found: list[Part]) -> dict[str, str]:
    overlaps = _by_video(found)
    own = np.mean([part.values["videos"][_VIDEOS[0]] for part in found])
    return {
        "texture": kind,
        "overlap": mean(overlaps.mean(axis=2)).text(2),
        "lost at the end": rate(overlaps[..., -1:] < LOST),
        "overlap in the first training video": f"{own:.2f}",
    }


def _differences(parts: Parts) -> Table:
    """Return differences of the mean overlap, paired by video; negative where the first texture misleads more."""
    pairs = [(f"{way}, {more}", f"{way}, {COUNTS[0]}") for way in _WAYS for more in COUNTS[1:]]
    pairs += [(f"{_WAYS[0]}, {count}", f"{_WAYS[1]}, {count}") for count in COUNTS]
    rows = []
    for name, other in pairs:
        if name in parts and other in parts:
            apart = _by_video(parts[name]).mean(axis=2) - _by_video(parts[other]).mean(axis=2)
            rows.append({"texture": name, "minus": other, "overlap": mean(apart).text(2)})
    return rows


def _by_video(found: list[Part]) -> NDArray[np.float64]:
    """Return overlaps [seeds, test videos, frames]."""
    return np.array([[part.values["videos"][video] for video in _TEST] for part in found])


@cache
def _scene(video: str) -> tuple[Scenario, SceneView]:
    """Return a video, and its view."""
    scenario = Scenario(compiled(RECIPES / "tracked_person.yaml").named(video), _scenes())
    return scenario, SceneView(scenario, "poster", list(range(FRAMES)))


@cache
def _scenes() -> Scenes:
    return Scenes()


@cache
def _truth(video: str) -> torch.Tensor:
    """Return the middle, x and y, and the height of the person in each frame, pixels, [FRAMES, 3]."""
    rows = []
    for frame in range(FRAMES):
        records = _scene(video)[0].labels(frame)
        x, y, width, height = next(record["bbox"] for record in records if record["actor"] == "target")
        rows.append([x + width / 2, y + height / 2, height])
    return torch.tensor(rows)


STUDY = Study(
    name="tracking",
    plain=("grey",),
    seeded=(*(f"{way}, {count}" for way in _WAYS for count in reversed(COUNTS)), "random"),
    steps=1500,
    cost=25,
    run=run,
    tables=tables,
    draw=draw,
)
