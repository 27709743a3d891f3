"""The runtime, which turns plans into data: PyBullet simulates, Warp kernels render.

In Python, open a recipe and render its frames on demand:

    import recipe_runtime
    street = recipe_runtime.open("recipes/weather_sweep.yaml", variant="weather=rainy,jitter=still,time_of_day=noon")
    len(street), street.sensors                                  # frames, names
    picture = street.render(40, "street")                        # uint8 [H, W, 3], equal to the full build
    metres = street[40].render("street", "depth")                # float32 [H, W]
    records = street[40].labels("street")                        # boxes, masks, 3-D boxes
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_runtime.scenario import Scenario

__all__ = ["open"]


def open(
    recipe: str | PathLike[str],
    variant: str | None = None,
    *,
    device: str = "cpu",
    disk_cache: str | PathLike[str] | None = None,
    allow_large: bool = False,
) -> Scenario:
    """Open one variant of a recipe as a sequence of frames that are rendered on demand.

    Args:
        recipe: Path of the recipe.
        variant: Name of the variant, the first by default.
        device: `cpu`, `cuda` or `cuda:N`.
        disk_cache: A folder in which rendered arrays are stored and reused.
        allow_large: Accept recipes over the limits of size.

    Raises:
        InputError: The recipe is invalid, or has no such variant.
    """
    from recipe_runtime.loading import opened, scenario

    plan, engines = opened(recipe, allow_large)
    return scenario(plan, variant, device, disk_cache, engines)
