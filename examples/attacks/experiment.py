"""The scenes, attacks and tests of the study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from recipe_runtime.attacks.truth import PatchRecord
from recipe_runtime.loading import compiled
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.torch import Place

from examples.attacks.attack import Bounds, Goal, gradient, optimise, scores
from examples.attacks.augmentation import THYS, WIDE, Augmentation
from examples.attacks.detector import Detector
from examples.attacks.detectors import DETECTORS, opened
from examples.attacks.views import DigitalView, FalseGradientView, RenderedView, View, patch_box, patch_record

RECIPES = Path(__file__).parents[2] / "recipes" / "attacks"
SCENES = {"wall": "creation.yaml", "garage": "creation_garage.yaml", "kiosk": "creation_kiosk.yaml"}
PATCH = "poster"
ONE, MANY = ("morning",), ("morning", "afternoon", "cloudy", "soft_rain", "fog", "sunset")
HELD_OUT = ("early", "cloudy_sunset", "hard_rain", "dense_fog", "dust", "night")
WEATHERS = (*MANY, *HELD_OUT)
SIZE = (54, 36)  # texels: height, width
REACH = 0.2  # by which a texel may differ from the logo, per channel
BATCH = 3  # frames in a step
MOMENTS = 6  # runs that an attack sees, and as many others in which it is tested
MIN_VISIBLE = 0.9  # share of the poster that frames of the study show

_RUNS = 16  # of the recipes; the first half is for attacks


@dataclass(frozen=True)
class Attack:
    """What an attack knows, and how it prepares for what it does not know.

    Attributes:
        weathers: That it sees.
        insertion: How a texture is inserted and its gradient is taken: rendered, false gradient or digital.
        change: Of the texture, at random, before it is inserted.
        transferred: Whether its textures are tested in the other scenes.
    """

    weathers: tuple[str, ...]
    insertion: str
    change: Augmentation | None = None
    transferred: bool = False


ATTACKS = {
    "digital": Attack(MANY, "digital"),
    "digital, augmented": Attack(MANY, "digital", THYS, True),
    "digital, widely augmented": Attack(MANY, "digital", WIDE, True),
    "one weather": Attack(ONE, "rendered"),
    "many weathers": Attack(MANY, "rendered", None, True),
    "many weathers, augmented": Attack(MANY, "rendered", THYS),
    "many weathers, widely augmented": Attack(MANY, "rendered", WIDE, True),
    "many weathers, false gradient": Attack(MANY, "false gradient"),
}


@dataclass(frozen=True)
class Found:
    """A texture and what detectors see of it.

    Attributes:
        texture: [1, 3, h, w], 0 to 1.
        steps: Of the attack; 0 for a texture that is not attacked with.
        scores: Of a person, by "DETECTOR in SCENE": in each moment in turn, in each of WEATHERS. "inserted" has those
            of the attacked detector and scene with the texture inserted digitally.
    """

    texture: torch.Tensor
    steps: int
    scores: dict[str, list[float]]


class Scene:
    """A scene, its frames for attacks and for tests, and views of both."""

    def __init__(self, name: str) -> None:
        self.name = name
        shared = Scenes()
        plans = compiled(RECIPES / SCENES[name]).variants
        self._scenarios = {plan.variant: Scenario(plan, shared) for plan in plans}
        self.view = cache(self._view)
        half = _RUNS // 2
        self._seen, self._unseen = self._moments(range(half)), self._moments(range(half, _RUNS))
        self.test = self._places(self._unseen, WEATHERS)

    def training(self, weathers: Sequence[str]) -> tuple[Place, ...]:
        """Return the frames of an attack; attacks differ in the weathers, not in the moments that they see."""
        return self._places(self._seen, weathers)

    def goal(self, detector: Detector, frames: Sequence[Place]) -> Goal:
        """Return the goal to see a person where the poster is."""
        boxes = [patch_box(self._truth(variant)) for variant, _ in frames]
        return Goal(detector, torch.stack(boxes), detector.person)

    def _view(self, insertion: str, frames: tuple[Place, ...]) -> View:
        if insertion == "rendered":
            return RenderedView(self._scenarios, PATCH, frames, SIZE)
        if insertion == "digital":
            return DigitalView(self._scenarios, PATCH, frames)
        rendered, warped = self.view("rendered", frames), self.view("digital", frames)
        assert isinstance(warped, DigitalView)
        return FalseGradientView(rendered, warped)

    def _moments(self, runs: Sequence[int]) -> list[str]:
        """Return the endings of the names of runs that show the poster."""
        endings = [f"#{run + 1}" if run else "" for run in runs]
        shown = [e for e in endings if (self._truth(WEATHERS[0] + e)["visible_fraction"] or 0) >= MIN_VISIBLE]
        if len(shown) < MOMENTS:
            raise ValueError(f"{self.name}: {len(shown)} of {len(runs)} runs show the poster, not {MOMENTS}")
        return shown[:MOMENTS]

    def _places(self, moments: Sequence[str], weathers: Sequence[str]) -> tuple[Place, ...]:
        return tuple((f"weather={weather}{moment}", 0) for moment in moments for weather in weathers)

    def _truth(self, variant: str) -> PatchRecord:
        """Return where the poster is in a run, which is the same in all weathers."""
        run = "".join(variant.partition("#")[1:])
        return patch_record(self._scenarios[f"weather={WEATHERS[0]}{run}"], PATCH, 0)


@cache
def scene(name: str) -> Scene:
    """Return a scene, opened once a process."""
    return Scene(name)


@cache
def detector(name: str) -> Detector:
    """Return a detector, opened once a process."""
    return opened(name)


def attack(where: str, attacked: str, name: str, seed: int, steps: Sequence[int]) -> tuple[list[Found], list[float]]:
    """Attack with the logo, changed at most by REACH; test the textures that are found, rounded to 8 bits.

    Args:
        where: The scene.
        attacked: The detector.
        name: Of the attack.
        seed: Of the texture to start from, of the order of the frames, and of the augmentation.
        steps: Numbers of steps after which to test, in ascending order. Only the last texture is tested with the other
            detectors and in the other scenes.

    Returns:
        What was found after each number of steps, and the loss before each step.
    """
    chosen, place = ATTACKS[name], scene(where)
    frames = place.training(chosen.weathers)
    found, losses = optimise(
        place.view(chosen.insertion, frames),
        place.goal(detector(attacked), frames),
        start(seed),
        Bounds(logo(), REACH),
        steps=steps,
        batch=BATCH,
        seed=seed,
        change=chosen.change,
    )
    results = []
    for count, texture in zip(steps, found, strict=True):
        rounded, last = texture.mul(255).round().div(255), count == steps[-1]
        scenes = tuple(SCENES) if chosen.transferred and last else (where,)
        rows = tested(rounded, scenes, tuple(DETECTORS) if last else (attacked,))
        if last and chosen.insertion == "digital":
            goal = place.goal(detector(attacked), place.test)
            rows["inserted"] = scores(place.view("digital", place.test), [goal], rounded)[0]
        results.append(Found(rounded, count, rows))
    return results, losses


def tested(
    texture: torch.Tensor, where: Sequence[str], detectors: Sequence[str] = tuple(DETECTORS)
) -> dict[str, list[float]]:
    """Return the scores of a texture in scenes, with detectors; see `Found`."""
    rows: dict[str, list[float]] = {}
    for place in map(scene, where):
        goals = [place.goal(detector(name), place.test) for name in detectors]
        seen = scores(place.view("rendered", place.test), goals, texture)
        rows |= {f"{name} in {place.name}": row for name, row in zip(detectors, seen, strict=True)}
    return rows


def cosines(where: str, attacked: str, texture: torch.Tensor) -> dict[str, float]:
    """Return, for each weather, the cosine between the exact and the false gradient at a texture."""
    place = scene(where)
    views = [place.view(insertion, place.test) for insertion in ("rendered", "false gradient")]
    goal, found = place.goal(detector(attacked), place.test), {}
    for frame, weather in enumerate(WEATHERS):
        exact, false = (gradient(view, goal, texture, frame).flatten() for view in views)
        found[weather] = float(torch.nn.functional.cosine_similarity(exact, false, dim=0))
    return found


def seen(where: str, attacked: str, texture: torch.Tensor, numbers: Sequence[int]) -> tuple[torch.Tensor, torch.Tensor]:
    """Return test frames with a texture, [n, 3, 300, 300], and the boxes [n, 4] in which a person scores most."""
    place = scene(where)
    view = place.view("rendered", place.test)
    with torch.no_grad():
        pictures = torch.cat([view.pictures(texture, batch=1, step=number) for number in numbers])
        return pictures, place.goal(detector(attacked), place.test).best(pictures, numbers)[1]


def noise(seed: int) -> torch.Tensor:
    """Return a random texture."""
    return torch.rand((1, 3, *SIZE), generator=torch.Generator().manual_seed(seed))


def start(seed: int) -> torch.Tensor:
    """Return the logo with noise within the bounds of an attack."""
    return (logo() + REACH * (2 * noise(seed) - 1)).clamp(0, 1)


def logo() -> torch.Tensor:
    """Return the picture of rings and stripes of recipes/attacks/poster.yaml, upright, as a texture."""
    with Image.open(RECIPES / "poster.png") as image:
        pixels = np.asarray(image.convert("RGB").rotate(90, expand=True).resize(SIZE[::-1], Image.Resampling.BOX))
    return torch.tensor(pixels.transpose(2, 0, 1)[None] / 255, dtype=torch.float32)
