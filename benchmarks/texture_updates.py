"""Time of an update of a texture by its gradient, on a GPU and on one core of the CPU.

    python -m benchmarks.texture_updates --device cuda:0

An update is a quantised `SceneView` of one frame of recipes/attacks/poster.yaml, 800x600, with a texture of 384x288,
forward and backward, and a step against the gradient's sign. Texture, picture and gradient are tensors on the device.
The table has the median of the wall-clock time and, from PyTorch's profiler, the copies between host and device within
one update. The digests of all pictures and gradients must be equal on both devices. Requires PyTorch.

For a host without PyBullet, `--trace FILE` writes the motion of the scene where PyBullet is, and reads it there:

    python -m benchmarks.texture_updates --trace poster.trace --device cpu --updates 1
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import torch
from recipe_runtime.core.trace import Trace
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario
from recipe_runtime.scenes import Scenes
from recipe_runtime.torch import SceneView

from benchmarks.pages import markdown
from benchmarks.textures import FRAME, HEIGHT, PATCH, RECIPE, WARM, WEATHERS, WIDTH

STEP = 1 / 255


class Updates:
    """Updates of a texture in one weather on one device."""

    def __init__(self, weather: str, device: str, trace: Path | None) -> None:
        self.device = torch.device(device)
        plan, engines = opened(RECIPE)
        if trace is not None:
            moved = stored(trace, lambda: engines.simulate(plan.variants[0].scene))
            engines = replace(engines, simulate=lambda _: moved)
        variant = plan.named(f"weather={weather},insertion=rendered")
        self._view = SceneView(Scenario(variant, Scenes(device, engines)), PATCH, [FRAME])
        start = torch.rand((1, 3, HEIGHT, WIDTH), generator=torch.Generator().manual_seed(1))
        self._texture = start.to(self.device)
        self._digest = hashlib.sha256()
        draw = torch.Generator().manual_seed(2)
        self._goal = torch.rand(self._view.pictures(self._texture).shape, generator=draw).to(self.device)

    def update(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Make one update, and return the picture and the gradient."""
        texture = self._texture.requires_grad_()
        pictures = self._view.pictures(texture)
        (gradient,) = torch.autograd.grad(pictures, texture, self._goal)
        with torch.no_grad():
            self._texture = (texture - STEP * gradient.sign()).clamp(0.0, 1.0)
        return pictures.detach(), gradient

    def timed(self, count: int) -> list[float]:
        """Return the milliseconds of updates; the first ones are left out."""
        spent = []
        for _ in range(WARM + count):
            self._wait()
            start = time.perf_counter()
            results = self.update()
            self._wait()
            spent.append(1000 * (time.perf_counter() - start))
            for tensor in results:
                self._digest.update(tensor.cpu().numpy().tobytes())
        return spent[WARM:]

    @property
    def digest(self) -> str:
        """The digest of the pictures and gradients of all timed updates."""
        return self._digest.hexdigest()

    def copies(self) -> str:
        """Return the copies between host and device within one update, by kind."""
        if self.device.type == "cpu":
            return "none"
        kinds = [torch.profiler.ProfilerActivity.CPU, torch.profiler.ProfilerActivity.CUDA]
        with torch.profiler.profile(activities=kinds) as profile:
            self.update()
            self._wait()
        if not any(event.device_type == torch.autograd.DeviceType.CUDA for event in profile.events()):
            return "not measured: the profiler saw no work of the GPU"
        found = [(event.key, event.count) for event in profile.key_averages() if "Memcpy" in event.key]
        return ", ".join(f"{count} {name}" for name, count in sorted(found)) or "none"

    def _wait(self) -> None:
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)


def stored(file: Path, simulate: Callable[[], Trace]) -> Trace:
    """Return the motion in a file, which is simulated and written first if there is none."""
    if not file.exists():
        file.write_bytes(b"".join(simulate().pieces()))
    with file.open("rb") as opened_file:
        return Trace.from_file(opened_file)


def main() -> int:
    """Measure both devices, and return 1 if their bytes differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0", help="device to compare with the CPU (default: cuda:0)")
    parser.add_argument("--updates", type=int, default=100, help="updates on each device (default: 100)")
    parser.add_argument("--trace", type=Path, help="file of the scene's motion, written if it does not exist")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    rows, equal = [], True
    for weather in WEATHERS:
        runs = {device: Updates(weather, device, arguments.trace) for device in ("cpu", arguments.device)}
        spent = {device: median(run.timed(arguments.updates)) for device, run in runs.items()}
        equal &= len({run.digest for run in runs.values()}) == 1
        for device, run in runs.items():
            rows.append(
                {
                    "weather": weather,
                    "device": device,
                    "ms an update": f"{spent[device]:.2f}",
                    "CPU / device": f"{spent['cpu'] / spent[device]:.1f}",
                    "copies within an update": run.copies(),
                }
            )
    print(markdown(rows))
    print(f"pictures and gradients of {arguments.updates} updates: {'equal' if equal else 'NOT equal'} bytes")
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
