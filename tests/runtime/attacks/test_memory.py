"""What textures, recorded frames and gradients take of memory is compared with the host's before it is allocated."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import AppearancePlan
from recipe_runtime.attacks import retextured_frame
from recipe_runtime.attacks.textures import as_images
from recipe_runtime.core import host
from recipe_runtime.render.retexture.sparse import EntryCount
from recipe_runtime.scenario import Scenario

from tests.runtime.attacks.test_lens_view import view_of
from tests.runtime.attacks.test_patch_view import OWN, plan_of
from tests.runtime.attacks.test_textures import RENDERED, SECOND, recipe_with
from tests.runtime.fakes import sensor_plan


def limit(monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    monkeypatch.setattr(host, "total_memory", lambda: room)


@pytest.fixture
def scene(tmp_path: Path) -> Scenario:
    return recipe_runtime.open(recipe_with(tmp_path, "first"), RENDERED)


def test_a_frame_is_not_recorded_if_it_is_too_large(scene: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.render(0)
    limit(monkeypatch, 300_000)  # 96 x 64 pixels take 491,520 bytes
    for call in (lambda: scene.render(0, textures={"poster": SECOND}), lambda: scene.patch_view(0, "poster")):
        with pytest.raises(
            InputError, match=r"frame 0 of street, kept for other textures in 1 picture, takes"
        ) as caught:
            call()
        assert caught.value.problems[0].code == "out-of-memory"
    monkeypatch.undo()
    assert scene.render(0, textures={"poster": SECOND}).shape == (64, 96, 3)


def test_frames_with_charts_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each chart records the frame again, with about as many patched samples as the first."""
    made: list[AppearancePlan] = []

    def record(seen: object, appearance: AppearancePlan, *_: object) -> SimpleNamespace:
        made.append(appearance)
        return SimpleNamespace(memory=10_000_000, render=lambda textures: np.zeros((1, 1, 3), np.uint8))

    source: Any = SimpleNamespace(patched_frame=record)
    seen: Any = None
    recorder = retextured_frame._Recorder(source, seen, sensor_plan(), 0)
    limit(monkeypatch, 35_000_000)
    looks = [plan_of(OWN, "noon").model_copy(update={"seed": n}) for n in range(4)]
    for appearance in looks[:3]:
        recorder.picture(appearance)
    with pytest.raises(InputError, match="kept for other textures in 4 pictures"):
        recorder.picture(looks[3])
    assert len(made) == 3


@pytest.mark.parametrize("lens", ["supersampled", "blurred", "blooming"])
def test_the_matrices_of_a_gradient_are_counted(lens: str, monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []
    monkeypatch.setattr(EntryCount, "add", lambda self, entries: counts.append(entries))
    view_of(lens)
    assert counts and min(counts) > 0
    monkeypatch.undo()
    limit(monkeypatch, 10_000)
    with pytest.raises(InputError, match="the gradient of this patch takes about"):
        view_of(lens)


def test_the_entries_of_all_matrices_are_added(monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, 64 * 1000)
    entries = EntryCount("use a smaller picture")
    entries.add(600)
    with pytest.raises(InputError, match="use a smaller picture"):
        entries.add(600)


def test_large_textures_are_refused(scene: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, 20_000_000)
    with pytest.raises(InputError, match=r"1 texture of 1,000,000 texels takes about 0\.09 GiB of memory"):
        as_images(scene.plan.appearance.patches, {"poster": np.zeros((1000, 1000, 3), np.uint8)})
    with pytest.raises(InputError, match="the gradient of a texture of 1000 x 500 texels"):
        scene.patch_view(0, "poster", size=(500, 1000))


def test_the_limit_of_a_process_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, 1 << 40)
    monkeypatch.setattr(host, "process_memory_limit", lambda: 1 << 30)
    host.check_memory(1 << 30, "this", "help")
    with pytest.raises(InputError, match=r"this takes about 2\.00 GiB of memory, over the 1\.00 GiB"):
        host.check_memory(2 << 30, "this", "help")
