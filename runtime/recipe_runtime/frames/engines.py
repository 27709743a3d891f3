"""The interface of renderers, and the factories of simulation, meshes and renderer."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, ScenePlan

from recipe_runtime.core import host
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array
from recipe_runtime.meshes.mesh import Body


class SceneRenderer(Protocol):
    """Renders one scene: an observation per frame, and from it a colour image per appearance."""

    def observe(self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32]) -> Any:
        """Return the observation of one frame.

        Args:
            camera: The camera.
            world_from_sensor: Pose of the sensor, [3, 4].
            parts: World-from-part transforms, [P, 3, 4].
            lamps: A mask of `LampState` for each actor, int32 [A].
        """

    def shade(
        self, obs: Any, appearance: AppearancePlan, sensor_name: str, frame: int, time: float, *, neighbour: Any = None
    ) -> NDArray[np.uint8]:
        """Return the colour image of an observation, uint8 [H, W, 3] sRGB.

        `neighbour` is the frame before or after, for motion blur.
        """

    def frame_stream(
        self,
        camera: CameraPlan,
        sensor_name: str,
        appearances: Sequence[AppearancePlan],
        in_flight: int,
        patched: Sequence[AppearancePlan],
        label_passes: Sequence[LabelPass],
    ) -> Any:
        """Return a stream that renders many frames of one camera concurrently, on a GPU.

        `patched` are the appearances whose patches it numbers in each frame, `label_passes` compute further labels.
        """

    def patch_map(self, obs: Any, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        """Return which patch each pixel of an observation shows, uint8 [H, W]: 1 + its number, 0 for none."""

    def unrounded(
        self, obs: Any, appearance: AppearancePlan, sensor_name: str, frame: int, time: float, *, neighbour: Any = None
    ) -> NDArray[np.float64]:
        """Return the colour image before it is rounded to 8 bits, [H, W, 3], 0 to 1; arguments are those of `shade`."""

    def patched_frame(
        self, obs: Any, appearance: AppearancePlan, sensor_name: str, frame: int, time: float, *, neighbour: Any = None
    ) -> Any:
        """Return a frame that can be rendered with other textures; arguments are those of `shade`."""


@dataclass(frozen=True)
class Engines:
    """Factories of the simulation, the meshes and the renderer, which tests replace by light ones. Picklable."""

    simulate: Callable[[ScenePlan], Trace]
    actors: Callable[[ScenePlan], list[Body]]  # in plan order
    renderer: Callable[[ScenePlan, str], SceneRenderer]  # scene, device
    assets: Assets = field(default_factory=Assets)  # the recipe's asset files


def real_engines(assets: Assets | None = None, simulated: Callable[[int, int], None] | None = None) -> Engines:
    """Return the engines of PyBullet, the mesh library and the Warp renderer; each is imported on first use.

    Args:
        assets: The asset files of the recipe.
        simulated: Called with the steps done and the total of each simulation; engines that have it cannot be pickled.
    """
    assets = assets or Assets()
    simulate = partial(_simulate, progress=simulated) if simulated else _simulate
    return Engines(
        simulate=simulate,
        actors=partial(_actors, assets=assets),
        renderer=partial(_renderer, assets=assets),
        assets=assets,
    )


def devices(name: str) -> tuple[str, ...]:
    """Return the devices that a name selects: `cpu`; `cuda`, all GPUs of this host; `cuda:1`, one of them.

    Raises:
        InputError: The name is unknown, or this host has no such device.
        RunError: Kernels cannot run on this CPU.
    """
    if name == "cpu":
        return ("cpu",)
    if re.fullmatch(r"cuda(:\d{1,3})?", name) is None:
        remedy = "write cpu, cuda (every GPU here), or cuda:N for one of them"
        raise InputError(f"there is no device {name!r}", help=remedy, code=Code.UNKNOWN_DEVICE)
    reason = host.cannot_render_reason()
    if reason:
        raise RunError(reason)
    from recipe_runtime.render.device.setup import cuda_devices

    there = cuda_devices()
    if not there:
        raise InputError(
            f"device {name}: there is no CUDA GPU here, or no driver for it",
            help="write cpu, which gives equal bytes",
            code=Code.UNKNOWN_DEVICE,
        )
    if name != "cuda" and name not in there:
        raise InputError(
            f"there is no device {name}", help=f"write one of {', '.join(there)}", code=Code.UNKNOWN_DEVICE
        )
    return tuple(there) if name == "cuda" else (name,)


def _simulate(scene: ScenePlan, progress: Callable[[int, int], None] | None = None) -> Trace:
    from recipe_runtime.simulation.process import simulate

    return simulate(scene, progress)


def _actors(scene: ScenePlan, assets: Assets) -> list[Body]:
    from recipe_runtime.meshes import actor_bodies

    return actor_bodies(scene.actors, assets)


def _renderer(scene: ScenePlan, device: str, assets: Assets) -> SceneRenderer:
    reason = host.cannot_render_reason()
    if reason:
        raise RunError(reason)
    from recipe_runtime.meshes import scene_bodies
    from recipe_runtime.render.renderer import Renderer

    renderer: SceneRenderer = Renderer(scene_bodies(scene, assets), device=device, images=assets.image)
    return renderer
