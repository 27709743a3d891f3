"""The runtime: plans to data. PyBullet moves the bodies, Warp kernels draw them.

In Python a recipe is opened, and its frames are rendered when they are asked for:

    import recipe_runtime
    street = recipe_runtime.open("recipes/weather_sweep.yaml", variant="weather=rainy,jitter=still,time_of_day=noon")
    len(street), street.sensors                                  # frames, names
    picture = street.render(40, "street")                        # uint8 [H, W, 3], the very pixels of the full build
    metres = street[40].render("street", "depth")                # float32 [H, W]
    records = street[40].labels("street")                        # boxes, masks, 3-D boxes of what is seen
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
    """One variant of a recipe, the first by default, as a sequence of frames that are rendered on demand.

    `disk_cache` is a folder in which rendered arrays are kept and looked for. InputError with all that is wrong with
    the recipe, or for a variant that it has not.
    """
    from recipe_runtime.loading import opened, scenario

    plan, engines = opened(recipe, allow_large)
    return scenario(plan, variant, device, disk_cache, engines)
