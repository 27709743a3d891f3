"""The frames, attacks and measurements of the study."""

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
from recipe_runtime.torch import Place, SceneView

from examples.attacks.attack import Bounds, Goal, gradient, optimise, scores
from examples.attacks.detectors import opened
from examples.attacks.ssd import PERSON
from examples.attacks.views import DigitalView, FalseGradientView, View, patch_box, patch_record

RECIPES = Path(__file__).parents[2] / "recipes" / "attacks"
PATCH = "poster"
ONE, MANY = ("sun",), ("sun", "shade", "cloudy", "soft_rain", "fog", "sunset")
HELD_OUT = ("early", "cloudy_sunset", "hard_rain", "dense_fog", "dust", "night")
SIZE = (54, 36)  # texels: height, width
REACH = 0.2  # by which a texel may differ from the logo, per channel
BATCH = 3  # frames in a step
MIN_VISIBLE = 0.95  # share of the poster that frames of the study show

_TRAINING_RUNS, _TEST_RUNS = ("", "#2"), ("#3", "#4")
_TRAINING_FRAMES = (2, 12, 22)
_TEST_FRAMES = (6, 18)


@dataclass(frozen=True)
class Attack:
    """What an attack knows: the weathers that it sees, and how a texture is inserted and its gradient is taken."""

    weathers: tuple[str, ...]
    insertion: str  # rendered, false gradient or digital


ATTACKS = {
    "digital": Attack(MANY, "digital"),
    "one weather": Attack(ONE, "rendered"),
    "many weathers": Attack(MANY, "rendered"),
    "many weathers, false gradient": Attack(MANY, "false gradient"),
}


@dataclass(frozen=True)
class Outcome:
    """A texture and what the detector sees of it.

    Attributes:
        texture: [1, 3, h, w], 0 to 1.
        losses: Before each step of the attack; empty for a texture that is not attacked with.
        rendered: Score of the goal in each test frame.
        inserted: The same, with the texture inserted digitally; empty but for digital attacks.
    """

    texture: torch.Tensor
    losses: list[float]
    rendered: list[float]
    inserted: list[float]


class Experiment:
    """The scene and the detector; opened once a process."""

    def __init__(self) -> None:
        self._plan = compiled(RECIPES / "creation.yaml")
        scenes = Scenes()
        self._scenarios = {plan.variant: Scenario(plan, scenes) for plan in self._plan.variants}
        self._detector = opened("SSD")
        self._record, self._views = cache(self._truth), cache(self._view)
        self.test = self._places((*MANY, *HELD_OUT), _TEST_RUNS, _TEST_FRAMES)

    def attack(self, name: str, seed: int, steps: int) -> Outcome:
        """Attack with the logo, changed at most by REACH, and test the texture that is found, rounded to 8 bits."""
        attack = ATTACKS[name]
        view = self._views(attack.insertion, tuple(self._training(attack.weathers)))
        goal, bounds = self._goal(view.frames), Bounds(logo(), REACH)
        found, losses = optimise(view, goal, start(seed), bounds, steps=steps, batch=BATCH, seed=seed)
        return self._outcome(found.mul(255).round().div(255), losses, attack.insertion == "digital")

    def test_texture(self, texture: torch.Tensor) -> Outcome:
        """Test a texture that is not optimised."""
        return self._outcome(texture, [], False)

    def cosines(self, texture: torch.Tensor) -> dict[str, float]:
        """Return, for each weather, the cosine between the exact and the false gradient at a texture."""
        views = [self._views(insertion, tuple(self.test)) for insertion in ("rendered", "false gradient")]
        goal, weathers, found = self._goal(self.test), [weather_of(variant) for variant, _ in self.test], {}
        for weather in (*MANY, *HELD_OUT):
            frame = weathers.index(weather)
            exact, false = (gradient(view, goal, texture, frame).flatten() for view in views)
            found[weather] = float(torch.nn.functional.cosine_similarity(exact, false, dim=0))
        return found

    def seen(self, texture: torch.Tensor, places: Sequence[Place]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return frames with a texture, [n, 3, 300, 300], and the boxes [n, 4] in which the goal scores most."""
        view = self._views("rendered", tuple(places))
        with torch.no_grad():
            return view.pictures(texture), self._goal(places).best(view, texture, range(len(places)))[1]

    def _outcome(self, texture: torch.Tensor, losses: list[float], digital: bool) -> Outcome:
        goal, places = self._goal(self.test), tuple(self.test)
        rendered = scores(self._views("rendered", places), goal, texture)
        inserted = scores(self._views("digital", places), goal, texture) if digital else []
        return Outcome(texture, losses, rendered, inserted)

    def _view(self, insertion: str, frames: tuple[Place, ...]) -> View:
        if insertion == "rendered":
            return SceneView(self._plan, PATCH, frames)
        if insertion == "digital":
            return DigitalView(self._scenarios, PATCH, frames)
        rendered = self._views("rendered", frames)
        assert isinstance(rendered, SceneView)
        return FalseGradientView(rendered, DigitalView(self._scenarios, PATCH, frames))

    def _goal(self, frames: Sequence[Place]) -> Goal:
        boxes = [patch_box(self._record(run_of(variant), frame)) for variant, frame in frames]
        return Goal(self._detector, torch.stack(boxes), PERSON)

    def _truth(self, run: str, frame: int) -> PatchRecord:
        """Return where the poster is in a frame of a run, which is the same in all weathers."""
        return patch_record(self._scenarios[f"weather={ONE[0]}{run}"], PATCH, frame)

    def _training(self, weathers: tuple[str, ...]) -> list[Place]:
        """Return the frames of an attack; attacks differ in the weathers, not in the moments that they see."""
        return self._places(weathers, _TRAINING_RUNS, _TRAINING_FRAMES)

    def _places(self, weathers: Sequence[str], runs: Sequence[str], frames: Sequence[int]) -> list[Place]:
        """Return the frames that show the poster; those with equal labels follow each other."""
        moments = [(run, frame) for run in runs for frame in frames if self._visible(run, frame)]
        return [(f"weather={weather}{run}", frame) for run, frame in moments for weather in weathers]

    def _visible(self, run: str, frame: int) -> bool:
        share = self._record(run, frame)["visible_fraction"]
        return share is not None and share >= MIN_VISIBLE


def weather_of(variant: str) -> str:
    """Return the weather of a variant's name."""
    return variant.partition("=")[2].partition("#")[0]


def run_of(variant: str) -> str:
    """Return the ending of a variant's name that stands for its run: nothing for the first."""
    return "".join(variant.partition("#")[1:])


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
