"""Several patches in a frame as a function of all their textures, with the exact gradient of each.

Inserted patches change different pixels. The radiance of a sample is linear in the light of all rendered patches: what
each adds does not depend on the textures of those above or below it. So the radiance is the sum of what the patches add
to a frame in which they are black; reflections, antialiasing, lens and tone curve follow once, for the sum.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import PatchPlan

from recipe_runtime.attacks.patch_view import PatchView, patch_view, size_of
from recipe_runtime.attacks.retextured_frame import RetexturedFrame
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import Texture, Values, as_gradient, as_images, as_values, differentiable_patch
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.linear.linear_map import added, numbers, vectors
from recipe_runtime.render.retexture.development import Development
from recipe_runtime.render.retexture.tensor_exchange import bytes_of, places_of, put, put_picture, take
from recipe_runtime.render.retexture.texture_replay import TextureReplay


class JointView:
    """Patches in a frame of a sensor.

    Attributes:
        views: The view of each patch, by its name. Those of several rendered patches are relative to a frame in which
            all of these are black.
        picture: The frame with the textures of the recipe, uint8 [H, W, 3].
        device: `cpu` or `cuda:N`.
    """

    def __init__(self, frame: RetexturedFrame, sizes: Mapping[str, tuple[int, int] | None]) -> None:
        """Find how the frame depends on the textures.

        Args:
            frame: The frame.
            sizes: Height and width of textures by the name of the patch; None for those of the recipe's image. The
                patches are either all rendered or all inserted.

        Raises:
            InputError: No patch is named; or as `Scenario.patch_view`, for one of the patches.
        """
        if not sizes:
            raise InputError("a view is of one patch or more, and `sizes` names none")
        self._frame, self.device = frame, frame.scene.device
        plans = [differentiable_patch(frame.appearance, frame.sensor.name, name) for name in sizes]
        with frame.exclusive():
            self._find(frame, plans, sizes)
        self.picture = next(iter(self.views.values())).picture

    def _find(
        self, frame: RetexturedFrame, plans: Sequence[PatchPlan], sizes: Mapping[str, tuple[int, int] | None]
    ) -> None:
        self._development: Development | None = None
        if len(plans) == 1 or any(patch.inserted for patch in plans):
            self.views: Mapping[str, TextureView] = {p.name: patch_view(frame, p, sizes[p.name]) for p in plans}
        else:
            self._development = Development(frame.scene)
            self.views = self._rendered = {}
            for plan in plans:
                black, (height, width) = set(sizes) - {plan.name}, size_of(frame, plan, sizes[plan.name])
                self._rendered[plan.name] = PatchView(
                    frame.scene, plan.name, width, height, frame.exclusive, black, self._development
                )

    @property
    def memory(self) -> int:
        """About how many bytes of memory the view takes, with its frame."""
        shared = self._frame.memory + (self._development.memory if self._development else 0)
        return sum(view.memory - shared for view in self.views.values()) + shared

    def render(self, textures: Mapping[str, Texture]) -> NDArray[np.uint8]:
        """Return the rendered picture for textures by the name of the patch, as `Scenario.render` does."""
        return self._frame.render(as_images(self._frame.patches, textures))

    def forward(self, textures: Mapping[str, Texture]) -> Values:
        """Return the picture for textures, float64 [H, W, 3], 0 to 1; its pixels' values are not rounded.

        Args:
            textures: uint8, or 0 to 1, [h, w, 3], of each patch of the view.

        Raises:
            InputError: A texture is missing, or does not have the expected shape, type or range.
        """
        out = self.picture / 255.0
        for view, values, _ in self._linearised(self._uploaded(textures)):
            out.reshape(-1, 3)[view.pixels] = numbers(values)
        return out

    def backward(self, textures: Mapping[str, Texture], gradient: Values) -> dict[str, Values]:
        """Return the vector-Jacobian product of `forward`.

        Args:
            textures: The textures at which the derivative is taken, as in `forward`.
            gradient: Gradient with respect to the picture, [H, W, 3]; a tensor is [3, H, W].

        Returns:
            The gradient of each texture, float64 [h, w, 3]; equal bytes on every machine.

        Raises:
            InputError: A texture or the gradient does not have the expected shape or type.
        """
        flat = as_gradient(" and ".join(self.views), gradient, self.picture.shape).reshape(-1, 3)
        found: dict[str, DeviceArray] = {}
        for view, _, transposed in self._linearised(self._uploaded(textures)):
            found |= transposed(vectors(flat[view.pixels], self.device))
        return {name: numbers(found[name]).reshape(view.shape) for name, view in self.views.items()}

    def write_picture(self, textures: Mapping[str, object], out: object, quantise: bool) -> None:
        """Write the picture for textures into a tensor; see `tensor_exchange` for tensors.

        Args:
            textures: sRGB, 0 to 1, float64 [3, h, w], of each patch of the view.
            out: [3, H, W]: float32 if the picture is quantised, else float64.
            quantise: Write the bytes of `render`, divided by 255, in place of the values of `forward`.
        """
        given = {name: take(texture, self._texels[name]) for name, texture in textures.items()}
        if quantise:
            with self._frame.exclusive():
                put_picture(self._drawn(given), out, quantised=True)
        else:
            put_picture(self._picture_bytes, out, quantised=False)
            for view, values, _ in self._linearised(given):
                put(values, view.places, out)

    def write_gradients(self, textures: Mapping[str, object], gradient: object, out: Mapping[str, object]) -> None:
        """Write the result of `backward` into tensors; see `tensor_exchange` for tensors.

        Args:
            textures: The textures at which the derivative is taken, as in `write_picture`.
            gradient: Gradient with respect to the picture, float64 [3, H, W].
            out: float64 [3, h, w] by the name of the patch.
        """
        given = {name: take(texture, self._texels[name]) for name, texture in textures.items()}
        for view, _, transposed in self._linearised(given):
            for name, found in transposed(take(gradient, view.places)).items():
                put(found, self._texels[name], out[name])

    def _drawn(self, textures: Mapping[str, DeviceArray]) -> DeviceArray:
        """Return the bytes of the picture on the device; textures are inserted on the host."""
        if self._replay is not None:
            return self._replay.picture(textures)
        images = {name: numbers(texture).reshape(self.views[name].shape) for name, texture in textures.items()}
        return bytes_of(self.render(images), self.device)

    @cached_property
    def _replay(self) -> TextureReplay | None:
        """Renders the patches on the device; None if textures are inserted into the picture."""
        if any(patch.inserted for patch in self._frame.patches):
            return None
        views = {name: view for name, view in self.views.items() if isinstance(view, PatchView)}
        return TextureReplay(self._frame.scene, {name: view.mips for name, view in views.items()})

    @cached_property
    def _texels(self) -> dict[str, DeviceArray]:
        """All places of each texture."""
        return {name: places_of(np.arange(v.shape[0] * v.shape[1]), self.device) for name, v in self.views.items()}

    @cached_property
    def _picture_bytes(self) -> DeviceArray:
        return bytes_of(self.picture, self.device)

    def _uploaded(self, textures: Mapping[str, Texture]) -> dict[str, DeviceArray]:
        missing = [name for name in self.views if name not in textures]
        if missing:
            raise InputError(f"the view is of {', '.join(self.views)}, and the texture of {missing[0]} is missing")
        given = {name: as_values(name, textures[name], view.shape) for name, view in self.views.items()}
        return {name: vectors(values, self.device) for name, values in given.items()}

    def _linearised(
        self, textures: Mapping[str, DeviceArray]
    ) -> list[tuple[TextureView, DeviceArray, Callable[[DeviceArray], dict[str, DeviceArray]]]]:
        """Return views that change different pixels, the values of these, and the transposes of their derivatives."""
        if self._development is None:
            return [(view, *_named(name, view.linearised(textures[name]))) for name, view in self.views.items()]
        first = next(iter(self._rendered.values()))
        radiance, parts = first.light.offset, {}
        for name, view in self._rendered.items():
            light, parts[name] = view.light.added(textures[name])
            radiance = added(radiance, light)
        values, radiance_gradient = self._development.linearised(radiance)

        def transposed(gradient: DeviceArray) -> dict[str, DeviceArray]:
            back = radiance_gradient(gradient)
            return {name: part(back) for name, part in parts.items()}

        return [(first, values, transposed)]


def _named(
    name: str, linearised: tuple[DeviceArray, Callable[[DeviceArray], DeviceArray]]
) -> tuple[DeviceArray, Callable[[DeviceArray], dict[str, DeviceArray]]]:
    """Return values, and a transpose that names its result."""
    values, transposed = linearised
    return values, lambda gradient: {name: transposed(gradient)}
