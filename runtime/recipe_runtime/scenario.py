"""A variant as a sequence of frames, rendered on demand, in any order, in any process.

The same function renders the frames of a build, so pixels are equal. Engines are created on first use, and again in a
process that inherited or unpickled a scenario, so that each worker of a `DataLoader` has its own. Threads take turns.
"""

from __future__ import annotations

import io
import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import ScenarioPlan, SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.calibration import Calibration, calibration
from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.attacks.patch_metadata import PatchMetadata, patch_metadata
from recipe_runtime.attacks.textures import as_images, differentiable_patch
from recipe_runtime.attacks.truth import FrameTruth, patch_truth
from recipe_runtime.cache.store import Store
from recipe_runtime.core import codecs
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.modalities import label_array
from recipe_runtime.scenes import Scenes as Scenes

if TYPE_CHECKING:
    from recipe_runtime.attacks.retextured_frame import RetexturedFrame
    from recipe_runtime.attacks.texture_view import TextureView

MAX_CONCURRENT_FRAMES = 16  # concurrent frames on a GPU


@dataclass(frozen=True)
class Frame:
    """One frame of a scenario, rendered on demand."""

    scenario: Scenario
    number: int

    @property
    def time(self) -> float:
        """Seconds since the first frame."""
        return self.number / self.scenario.plan.scene.clock.fps

    def render(self, sensor: str | None = None, modality: str = "rgb") -> NDArray[np.generic]:
        """As `Scenario.render`."""
        return self.scenario.render(self.number, sensor, modality)

    def labels(self, sensor: str | None = None) -> list[LabelRecord]:
        """As `Scenario.labels`."""
        return self.scenario.labels(self.number, sensor)

    def calibration(self, sensor: str | None = None) -> Calibration:
        """As `Scenario.calibration`."""
        return self.scenario.calibration(self.number, sensor)


class Scenario(Sequence[Frame]):
    """The frames of one variant. `plan` is its complete specification.

    Cache entries that it reads are protected from automatic pruning until it is closed or collected; `with` closes it.
    """

    def __init__(self, plan: ScenarioPlan, scenes: Scenes, disk_cache: Path | None = None) -> None:
        self.plan = plan
        self._scenes = scenes
        self._disk_cache = Store(disk_cache) if disk_cache is not None else None
        self._rig = {sensor.name: sensor for sensor in plan.rig.sensors}

    def close(self) -> None:
        """Release renderers and the lease of the cache; both are acquired again when needed."""
        self._scenes.close()

    def __enter__(self) -> Scenario:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def variant(self) -> str:
        """The variant's name."""
        return self.plan.variant

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors' names, in the recipe's order."""
        return tuple(self._rig)

    def modalities(self, sensor: str | None = None) -> tuple[str, ...]:
        """Return the modalities that a sensor, the first by default, captures."""
        return self._sensor(sensor).capture

    def frames(self, sensor: str | None = None) -> range:
        """Return the numbers of the frames that a sensor, the first by default, takes."""
        return self._sensor(sensor).frames(len(self))

    def __len__(self) -> int:
        return self.plan.scene.clock.frames

    def __getitem__(self, frame: Any) -> Any:
        """Return a frame, or a list of frames for a slice; negative numbers count from the end.

        Raises:
            IndexError: There is no such frame.
        """
        if isinstance(frame, slice):
            return [Frame(self, k) for k in range(*frame.indices(len(self)))]
        return Frame(self, self._number(frame))

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(self, k) for k in range(len(self)))

    def __repr__(self) -> str:
        return f"<{self.variant}: {count(len(self), 'frame')} of {', '.join(self.sensors)}>"

    def render(
        self,
        frame: int,
        sensor: str | None = None,
        modality: str = "rgb",
        *,
        textures: Mapping[str, object] | None = None,
    ) -> NDArray[np.generic]:
        """Render one modality of a frame, equal to that of a build.

        Args:
            frame: Frame number; negative numbers count from the end.
            sensor: Name of a sensor, the first by default.
            modality: A modality that the sensor captures.
            textures: Images to show on patches in place of the recipe's, by the patch's name: arrays [h, w, 3] or
                tensors [3, h, w], of any size, uint8 or 0 to 1 (rounded to 8 bits). The frame equals that of a recipe
                with these images. Later calls for the same frame shade only the pixels of patches.

        Returns:
            A new array. rgb: uint8 [H, W, 3], sRGB. depth: float32 [H, W], metres along the optical axis. instance:
            uint16 [H, W], class * 1000 + number. semantic: uint8 [H, W], CARLA 0.9.14 tags.

        Raises:
            InputError: There is no such sensor, it does not capture the modality or take the frame, there is no such
                patch, or a texture is not an image or has floats outside 0 to 1.
            IndexError: There is no such frame.
        """
        plan = self._sensor(sensor)
        frame = self._taken(frame, plan)
        if modality not in plan.capture:
            raise InputError(
                f"the sensor {plan.name} does not capture {modality!r}",
                help=f"it captures {', '.join(plan.capture)}",
                code=Code.UNKNOWN_NAME,
            )
        if textures is not None and modality == "rgb" and (images := as_images(self.plan.appearance.patches, textures)):
            with self._scenes.exclusive():
                return self._scenes.patched_frame(self.plan, plan, frame).render(images)
        if self._disk_cache is None:
            return self._render(frame, plan, modality)
        key = self._key(frame, plan, modality)
        body = self._disk_cache.get("pixels", key)
        if body is None:
            pixels = self._render(frame, plan, modality)
            self._disk_cache.put("pixels", key, codecs.npy(pixels))
            return pixels
        kept: NDArray[np.generic] = np.load(io.BytesIO(body), allow_pickle=False)
        return kept

    def stream(
        self, sensor: str | None = None, frames: Iterable[int] | None = None
    ) -> Iterator[tuple[int, dict[str, NDArray[np.generic]]]]:
        """Yield frames, each as its number and the arrays of all captured modalities, as `render` does.

        By default these are all frames that the sensor takes. On a GPU many frames are rendered concurrently. The
        arrays are valid until the next frame is requested.
        """
        plan, scene = self._sensor(sensor), self.plan.scene
        numbers = [self._taken(frame, plan) for frame in (plan.frames(len(self)) if frames is None else frames)]
        appearances = [self.plan.appearance] if "rgb" in plan.capture else []
        with self._scenes.exclusive():
            rest = self._scenes.source(scene).make(plan, appearances, numbers, in_flight=MAX_CONCURRENT_FRAMES)
        while True:
            with self._scenes.exclusive():
                made = next(rest, None)
            if made is None:
                return
            pictures: dict[str, NDArray[np.generic]] = dict(zip(["rgb"], made.pictures, strict=False))
            yield made.number, {m: pictures[m] if m == "rgb" else label_array(made.seen, m) for m in plan.capture}

    def patch_view(
        self, frame: int, patch: str, sensor: str | None = None, *, size: tuple[int, int] | None = None
    ) -> TextureView:
        """Return a patch in a frame as a function of its texture, with the exact gradient.

        Args:
            frame: Frame number; negative numbers count from the end.
            patch: Name of a patch of any mode but `green`.
            sensor: Name of a sensor, the first by default.
            size: Height and width of the texture; those of the recipe's image by default.

        Raises:
            InputError: There is no such sensor or patch, the patch has no image and no size is given, its mode is
                `green`, or it is rendered in a picture into which other patches are inserted or whose sensor has a
                mosaic.
            IndexError: There is no such frame.
        """
        from recipe_runtime.attacks.patch_view import patch_view

        found = differentiable_patch(self.plan.appearance, self._sensor(sensor).name, patch)
        with self._scenes.exclusive():
            return patch_view(self.retextured(frame, sensor), found, size)

    def retextured(self, frame: int, sensor: str | None = None) -> RetexturedFrame:
        """Return a frame that is rendered again with other textures; arguments and errors are those of `render`."""
        plan = self._sensor(sensor)
        with self._scenes.exclusive():
            return self._scenes.patched_frame(self.plan, plan, self._taken(frame, plan))

    def sensitivity(
        self, parameter: str, frame: int, sensor: str | None = None, *, step: float | None = None
    ) -> NDArray[np.float64]:
        """Return the derivative of a frame's picture with respect to a parameter of weather, sun or camera.

        A central difference of two unrounded pictures with equal random numbers: noise, drops and clouds are those of
        the frame. At a limit of the parameter, the difference is one-sided.

        Args:
            parameter: `weather.NAME`, `sun.azimuth`, `sun.altitude` or `camera.NAME`, with the names and units of a
                plan.
            frame: Frame number; negative numbers count from the end.
            sensor: Name of a sensor, the first by default.
            step: By which the parameter is changed in both directions; by default half a degree for the sun, and
                otherwise a hundredth of the value, or a thousandth of the range if the value is 0.

        Returns:
            float64 [H, W, 3], per unit of the parameter, of a picture in sRGB from 0 to 1.

        Raises:
            InputError: There is no such parameter or sensor, the step is not above 0, or a texture is inserted into the
                picture.
            IndexError: There is no such frame.
        """
        from recipe_runtime.attacks.sensitivity import sensitivity

        plan, scene = self._sensor(sensor), self.plan.scene
        frame = self._taken(frame, plan)
        with self._scenes.exclusive():
            source, seen = self._scenes.source(scene), self._scenes.observe(scene, plan, frame)
            return sensitivity(source, seen, self.plan.appearance, plan, frame, parameter, step)

    def patches(self, frame: int, sensor: str | None = None) -> FrameTruth:
        """Return the ground truth of the patches of a frame, as `recipe build` writes it.

        Raises:
            InputError: There is no such sensor.
            IndexError: There is no such frame.
        """
        plan, scene = self._sensor(sensor), self.plan.scene
        frame = self._taken(frame, plan)
        with self._scenes.exclusive():
            source, seen = self._scenes.source(scene), self._scenes.observe(scene, plan, frame)
            return patch_truth(source, self.plan.appearance, plan, seen, frame)

    def patch_metadata(self, frame: int, patch: str | None = None, sensor: str | None = None) -> PatchMetadata | None:
        """Return a patch of a frame in the form that Armory's attacks expect; None if it is not visible.

        Args:
            frame: Frame number; negative numbers count from the end.
            patch: Name of a patch, the first by default.
            sensor: Name of a sensor, the first by default.

        Raises:
            InputError: There is no such patch or sensor, or the sensor does not take the frame.
            IndexError: There is no such frame.
        """
        plans = {plan.name: plan for plan in self.plan.appearance.patches}
        name = next(iter(plans), None) if patch is None else patch
        if name not in plans:
            there = ", ".join(plans) or "none"
            raise InputError(f"{self.variant} has no patch {name!r}; it has {there}", code=Code.UNKNOWN_NAME)
        truth = self.patches(frame, sensor)
        record = next(record for record in truth["patches"] if record["name"] == name)
        return patch_metadata(record, plans[name], truth["width"], truth["height"])

    def labels(self, frame: int, sensor: str | None = None) -> list[LabelRecord]:
        """Return the records of the visible objects of a frame, by instance; see `annotate.records.LabelRecord`."""
        plan, scene = self._sensor(sensor), self.plan.scene
        frame = self._taken(frame, plan)
        with self._scenes.exclusive():
            return self._scenes.source(scene).labels(self._scenes.observe(scene, plan, frame), plan, frame)["objects"]

    def calibration(self, frame: int, sensor: str | None = None) -> Calibration:
        """Return K, distortion and pose of a sensor at a frame that it takes; see `annotate.calibration`."""
        plan = self._sensor(sensor)
        with self._scenes.exclusive():
            trace = self._scenes.source(self.plan.scene).trace
        return calibration(plan.camera, sensor_transform(plan, trace, self._taken(frame, plan)))

    def _render(self, frame: int, plan: SensorPlan, modality: str) -> NDArray[np.generic]:
        scene = self.plan.scene
        with self._scenes.exclusive():
            seen = self._scenes.observe(scene, plan, frame)
            if modality == "rgb":
                return self._scenes.source(scene).shade(seen, self.plan.appearance, plan, frame)
            return label_array(seen, modality).copy()  # the observation is cached

    def _key(self, frame: int, plan: SensorPlan, modality: str) -> str:
        """Return the cache key of these pixels: a digest of plans, frame, modality and code."""
        colour = self.plan.appearance.digest if modality == "rgb" else ""
        return digest(
            "store/pixels/1", [self.plan.scene.digest, plan.document(), colour, modality, frame, builder_identity()]
        )

    def _number(self, frame: object) -> int:
        if isinstance(frame, bool) or not isinstance(frame, SupportsIndex):
            raise TypeError(f"a frame is a whole number, not {frame!r}")
        frame = operator.index(frame)
        if not -len(self) <= frame < len(self):
            raise IndexError(f"frame {frame} is not there: {self.variant} has frames 0 to {len(self) - 1}")
        return frame % len(self)

    def _taken(self, frame: int, plan: SensorPlan) -> int:
        """Return the number of a frame; IndexError if there is none, InputError if the sensor does not take it."""
        frame = self._number(frame)
        plan.check_takes(frame, len(self))
        return frame

    def _sensor(self, name: str | None) -> SensorPlan:
        if name is None:
            return next(iter(self._rig.values()))
        if name not in self._rig:
            raise InputError(f"the rig has no sensor {name!r}; it has {', '.join(self._rig)}", code=Code.UNKNOWN_NAME)
        return self._rig[name]
