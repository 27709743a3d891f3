"""Pictures of the frames that differ: as recorded in the dataset, as rendered here, and where they differ."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from recipe_compiler.ir.errors import RecipeError
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan

from recipe_runtime.cache.store import Store
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.frames.engines import Engines
from recipe_runtime.frames.shot import shot
from recipe_runtime.report.difference import write_difference
from recipe_runtime.verify.verdict import Difference

MAX_PICTURES = 8


def draw_differences(
    differences: Iterable[Difference],
    plan: DatasetPlan,
    dataset: Dataset | None,
    out: Path,
    *,
    engines: Engines,
    store: Store,
    device: str,
) -> list[str]:
    """Write pictures of the first frames that differ.

    Args:
        differences: the differences, also of frames that the plan does not have: a dataset may be of another plan.
        plan: the plan of the frames.
        dataset: the dataset with the recorded frames; None if there are only digests.
        out: the folder for the pictures.
        engines: simulation and renderer.
        store: contains the motion.
        device: the device that renders.

    Returns:
        The paths of the pictures, and the reason if one cannot be drawn or written.
    """
    pictures: list[str] = []
    try:
        for scenario, sensor, frame, modality in list(_frames(differences, plan))[:MAX_PICTURES]:
            made = shot(scenario, sensor, frame, modality, engines=engines, store=store, device=device)
            there = None
            if dataset is not None:
                path = layout.frame_file(scenario.variant, sensor, modality, frame, plan.forms)
                there = dataset.root / path
            stem = f"{layout.folder(scenario.variant)}-{layout.folder(sensor)}-{modality}-{frame:06d}"
            pictures += [str(path) for path in write_difference(out / stem, made, there)]
    except (RecipeError, OSError) as error:
        return [*pictures, f"no picture could be written to {out}: {error}"]
    return pictures


def _frames(differences: Iterable[Difference], plan: DatasetPlan) -> Iterator[tuple[ScenarioPlan, str, int, str]]:
    """Yield each frame of the plan that differs: its variant, sensor, number and modality."""
    variants = {variant.variant: variant for variant in plan.variants}
    for name, sensor, frame, modality in dict.fromkeys((d.variant, d.sensor, d.frame, d.modality) for d in differences):
        scenario = variants.get(name or "")
        if scenario is None or frame is None:
            continue
        for camera in scenario.rig.sensors:
            is_captured = modality in camera.capture and frame in camera.frames(scenario.scene.clock.frames)
            if camera.name == sensor and is_captured:
                yield scenario, camera.name, frame, str(modality)
