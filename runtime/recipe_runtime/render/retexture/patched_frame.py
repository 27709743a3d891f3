"""A frame that can be rendered again with other textures on its patches: only its patched samples are shaded again."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan

from recipe_runtime.render.camera import exposure
from recipe_runtime.render.camera.camera_pass import CameraPass
from recipe_runtime.render.camera.develop_kernels import LEVELS
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.camera.post_process import needs_post_process
from recipe_runtime.render.device.arrays import DeviceArray, copy_struct, set_fields, struct_array, struct_of
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.sparse import RowMatrix, row_matrix
from recipe_runtime.render.patches.patch_arrays import texture_of
from recipe_runtime.render.patches.patch_kernels import PatchArrays
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.retexture.lens_map import LensFrame, LensMap, lens_map
from recipe_runtime.render.retexture.record_kernels import count_taps, record_taps
from recipe_runtime.render.retexture.recording import record
from recipe_runtime.render.retexture.relight_kernels import (
    develop_listed,
    expose_listed,
    mirror_again,
    pixel_deviates,
    relight,
)
from recipe_runtime.render.texture.mipmaps import Images, image_atlas, mip_levels

Pixels = NDArray[np.uint8]
_SLOT_BYTES, _PIXEL_BYTES, _UNFINISHED_BYTES = 320, 3, 60  # of memory: per slot; per pixel, and if there are filters
_ROUNDING = 2e-5  # relative rounding error of a gain; a smaller gain is 0


@dataclass(frozen=True, eq=False)
class CameraCurve:
    """The camera's response for each of the Q pixels that change."""

    gain: NDArray[np.float32]  # of exposure and vignette, by pixel of the recording
    white: NDArray[np.float32]  # [3] white balance
    noise: float  # strength, as in the recipe
    deviates: NDArray[np.float32]  # [Q, 3] standard normal
    encoded: NDArray[np.float64]  # [LEVELS] the picture's value, 0 to 1, of each linear level, before rounding
    rounded: Pixels  # [LEVELS] the 8-bit value of each linear level


@dataclass(frozen=True, eq=False)
class PatchRows:
    """How the radiance of each slot depends on a patch: radiance = gain * texture + offset.

    `texture` is the linear colour of the patch at the slot's sample. Slots without the patch have a gain of 0.
    """

    samples: NDArray[np.int32]  # [S] slots that the patch covers
    gain: NDArray[np.float64]  # [N, 3]
    offset: NDArray[np.float64]  # [N, 3]


@dataclass(frozen=True, eq=False)
class TexturedPatches:
    """The patches of a frame and their images: one-element arrays of `PatchArrays` and of `ImageAtlas`."""

    patches: DeviceArray
    album: DeviceArray

    def first_texel(self, number: int) -> int:
        """Return the place, in the texels of the album, of the image of the patch with a number."""
        images = struct_of(self.album)
        image = int(struct_of(self.patches).image.numpy()[number])
        return int(images.starts.numpy()[images.first.numpy()[image]])


class PatchedFrame:
    """A frame and its patched samples; independent of the renderer's caches, so the renderer may go on to other frames.

    Attributes:
        recording: The patched samples.
        plans: The plans of all patches of the appearance.
    """

    def __init__(
        self,
        camera: CameraPass,
        images: Images,
        obs: Observation,
        appearance: AppearancePlan,
        sensor: str,
        frame: int,
        time: float,
        neighbour: NeighbourFrame | None,
        device: str,
    ) -> None:
        """Render the frame.

        Args:
            camera: The camera pass of the scene.
            images: Loads an image of the plan.
            obs: The observation of the frame.
            appearance: The appearance.
            sensor: Name of the sensor, the key of its noise.
            frame: Number of the frame.
            time: Seconds from frame 0.
            neighbour: The frame that motion blur needs; None without motion blur.
            device: The Warp device.
        """
        self.device, self._images, self._pass = device, images, camera
        taken = camera.expose(obs, appearance, sensor, frame, time)
        self.camera = obs.camera
        inputs = camera.shading.inputs(taken.undistorted, appearance, taken.light, frame)
        self.recording = record(taken.undistorted, taken, inputs, device)
        self.plans = appearance.patches
        self._textures = {p.name: texture_of(p, frame) for p in appearance.patches}
        self._patches = copy_struct(struct_of(inputs.patches))
        self._mip_chains: dict[str, list[NDArray[np.uint32]]] = {}
        self._response, self._record = taken.response, taken.record
        self._lens_frame: LensFrame | None = None
        if needs_post_process(obs.camera, taken.response, neighbour):
            self._lens_frame = LensFrame(taken.undistorted, obs, taken.response, taken.record, neighbour)
            self._hdr = camera.post.hdr_image(taken.exposed, taken.undistorted, taken.record)
        else:
            self._picture = camera.developed(taken, obs.camera)

    @property
    def memory(self) -> int:
        """About how many bytes of memory the frame takes."""
        pixel = _PIXEL_BYTES + _UNFINISHED_BYTES * (self._lens_frame is not None)
        return _SLOT_BYTES * len(self.recording.radiance) + pixel * self.camera.width * self.camera.height

    def render(self, textures: Mapping[str, Pixels]) -> Pixels:
        """Return the picture with other textures, uint8 [H, W, 3] sRGB.

        Args:
            textures: Images by the name of the patch, uint8 [h, w, 3] sRGB; patches without one keep their own.
        """
        picture: Pixels = self.drawn(self.textured(textures)).numpy().reshape(self.camera.height, self.camera.width, 3)
        return picture.copy()

    def textured(self, textures: Mapping[str, Pixels]) -> TexturedPatches:
        """Return the patches with other textures, as in `render`, on the device."""
        return TexturedPatches(
            self._patches_of(self._images_with(textures), self._patches.colour.numpy()), self._album(textures)
        )

    def drawn(self, shown_patches: TexturedPatches) -> DeviceArray:
        """Return the picture with textures that are on the device, uint8 [H * W * 3], until the next call."""
        shown = self._relit(shown_patches.patches, shown_patches.album)[1]
        rec = self.recording
        frame = self._lens_frame
        if frame is not None:
            light = wp.clone(self._hdr)
            if len(rec.pixels):
                listed = {"listed": rec.listed, "shown": shown, "response": self._record, "out_hdr_image": light}
                launch(expose_listed, len(rec.pixels), self.device, **listed)
            out = self._pass.post.finish(
                light, frame.undistorted, frame.seen, frame.response, frame.record, frame.neighbour
            )
        else:
            out = self._picture
            self._develop(shown, out)
        return out

    def _develop(self, shown: DeviceArray, out: DeviceArray) -> None:
        tables = self._pass.tables.by_pixel(self._response, self.camera)
        if len(self.recording.pixels):
            launch(
                develop_listed,
                len(self.recording.pixels),
                self.device,
                listed=self.recording.listed,
                shown=shown,
                responses=self._responses,
                **fields_of(tables, "gains", "tone_table", "deviates"),
                out_rgb=out,
            )

    def rows(self, patch: str, black: Collection[str] = ()) -> PatchRows:
        """Return how the radiance of the slots depends on a patch's texture.

        Args:
            patch: Name of the patch.
            black: Other patches, to show black; the rest keep their textures.
        """
        number, dark = self._number(patch), [self._number(name) for name in black]
        album = self._album({})
        light = []
        for value in (0.0, 1.0):
            image, colour = self._images_with({}).copy(), self._patches.colour.numpy().copy()
            image[dark], colour[dark] = -1, 0.0
            image[number], colour[number] = -1, value
            light.append(self._relit(self._patches_of(image, colour), album)[0].numpy().astype(np.float64))
        rec = self.recording
        of_patch = rec.patches == number
        samples = rec.slots[np.repeat(np.arange(len(rec.slots)), np.diff(rec.firsts))[of_patch]]
        gain = light[1] - light[0]
        gain[np.abs(gain) < _ROUNDING * light[1]] = 0.0  # another patch covers it
        return PatchRows(samples, gain, light[0])

    def taps(self, patch: str, width: int, height: int) -> RowMatrix:
        """Return the weights of the texels that each of a patch's samples reads.

        Args:
            patch: Name of the patch.
            width: Of its texture, texels.
            height: Of its texture, texels.

        Returns:
            A matrix [K, texels]. Rows are `PatchRows.samples`; columns are the texels of all mip levels, finest first,
            row by row.
        """
        of_patch = np.flatnonzero(self.recording.patches == self._number(patch))
        levels = mip_levels(np.zeros((height, width, 3), np.uint8))
        album, texels = image_atlas([levels], [False], [], self.device), sum(level.size for level in levels)
        count, recorded = len(of_patch), struct_of(self.recording.recorded)
        if not count:
            return row_matrix(np.zeros(1, np.int32), np.zeros(0, np.int32), np.zeros(0), texels)
        places: DeviceArray = wp.array(recorded.places.numpy()[of_patch], dtype=wp.vec4f, device=self.device)
        codes: DeviceArray = wp.array(recorded.codes.numpy()[of_patch], dtype=wp.uint32, device=self.device)
        counts = wp.empty(count, dtype=wp.int32, device=self.device)
        launch(count_taps, count, self.device, album=album, places=places, codes=codes, out_counts=counts)
        taps = counts.numpy()
        firsts = np.cumsum([0, *taps]).astype(np.int32)
        out_texels = wp.empty(int(firsts[-1]), dtype=wp.int32, device=self.device)
        weights = wp.empty(int(firsts[-1]), dtype=wp.float64, device=self.device)
        launch(
            record_taps,
            count,
            self.device,
            album=album,
            places=places,
            codes=codes,
            firsts=wp.array(firsts, dtype=wp.int32, device=self.device),
            out_texels=out_texels,
            out_weights=weights,
        )
        return row_matrix(firsts, out_texels.numpy(), weights.numpy(), texels)

    @cached_property
    def lens(self) -> LensMap | None:
        """How motion blur and lens make the picture from the HDR image; None for a camera without these effects."""
        if self._lens_frame is None:
            return None
        return lens_map(self._pass.post, self._lens_frame, self._hdr, self.recording.pixels, self.device)

    @property
    def pixels(self) -> NDArray[np.int32]:
        """Index, row by row, of each pixel of the picture that changes with a texture."""
        return self.recording.pixels if self.lens is None else self.lens.pixels

    @cached_property
    def curve(self) -> CameraCurve:
        """The camera's response for the pixels that change."""
        r, device, pixels = self._record, self.device, self.pixels
        deviates = wp.empty(max(len(pixels), 1), dtype=wp.vec3f, device=device)
        tables = self._pass.tables.by_pixel(self._response, self.camera)
        launch(
            pixel_deviates,
            len(pixels),
            device,
            pixels=wp.array(pixels, dtype=wp.int32, device=device),
            key=r.key,
            deviates=tables.deviates,
            out_deviates=deviates,
        )
        # A lens applies the vignette to its samples, not to the light of the HDR image.
        changed = self.recording.pixels
        vignette = tables.gains.numpy()[changed] if self.lens is None else np.ones(len(changed), np.float32)
        return CameraCurve(
            gain=vignette * np.float32(r.exposure),
            white=np.array(exposure.white(self._response), np.float32),
            noise=float(r.noise),
            deviates=deviates.numpy()[: len(pixels)],
            encoded=exposure.encoded(int(LEVELS), self._response.gamma),
            rounded=tables.tone_table.numpy(),
        )

    @property
    def streak(self) -> NDArray[np.float32]:
        """Radiance of a streak of rain, [3]."""
        streak = struct_of(self.recording.listed).streak
        return np.array([streak[0], streak[1], streak[2]], np.float32)

    def texture_size(self, patch: str) -> tuple[int, int] | None:
        """Return width and height of the image that the recipe gives a patch; None for a colour."""
        self._number(patch)
        levels = self._mip_chain(patch)
        return None if levels is None else (levels[0].shape[1], levels[0].shape[0])

    def _number(self, patch: str) -> int:
        return [plan.name for plan in self.plans].index(patch)

    def _mip_chain(self, patch: str) -> list[NDArray[np.uint32]] | None:
        """Return the mip levels of the image that the recipe gives a patch; None for a colour."""
        texture = self._textures[patch]
        if texture is None:
            return None
        if patch not in self._mip_chains:
            self._mip_chains[patch] = mip_levels(self._images(texture))
        return self._mip_chains[patch]

    def _relit(self, patches: DeviceArray, album: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the radiance of the slots, without and with reflections in wet ground."""
        rec, device = self.recording, self.device
        radiance, shown = (wp.clone(light) for light in self._recorded_light)
        if len(rec.slots):
            outputs = {"out_radiance": radiance, "out_shown": shown}
            launch(relight, len(rec.slots), device, recorded=rec.recorded, patches=patches, album=album, **outputs)
        if len(rec.mirrors.slots):
            launch(mirror_again, len(rec.mirrors.slots), device, **self._mirrors, radiance=radiance, out_shown=shown)
        return radiance, shown

    @cached_property
    def _recorded_light(self) -> tuple[DeviceArray, DeviceArray]:
        """The radiance of the slots as recorded, without and with reflections in wet ground."""
        rec, copy = self.recording, self.device != "cpu"  # on a CPU the arrays share the recording's memory
        radiance: DeviceArray = wp.array(rec.radiance, dtype=wp.vec3f, device=self.device, copy=copy)
        shown: DeviceArray = wp.array(rec.shown, dtype=wp.vec3f, device=self.device, copy=copy)
        return radiance, shown

    @cached_property
    def _mirrors(self) -> dict[str, DeviceArray]:
        """The arguments of `mirror_again` that describe the mirrors."""
        kinds = {"slots": wp.int32, "shares": wp.float32, "sources": wp.int32, "limits": wp.vec3f}
        mirrors = self.recording.mirrors
        return {name: wp.array(getattr(mirrors, name), dtype=kind, device=self.device) for name, kind in kinds.items()}

    @cached_property
    def _responses(self) -> DeviceArray:
        return struct_array([self._record], self.device)

    def _album(self, textures: Mapping[str, Pixels]) -> DeviceArray:
        """Return an atlas of the images that patches show, in the order of the patches."""
        chains = [
            mip_levels(textures[p.name]) if p.name in textures else self._mip_chain(p.name) or [] for p in self.plans
        ]
        chains = [chain for chain in chains if chain]
        return image_atlas(chains, [False] * len(chains), [], self.device)

    def _images_with(self, textures: Mapping[str, Pixels]) -> NDArray[np.int32]:
        """Return the index of each patch's image in `_album`, -1 for a colour."""
        has = np.array([p.name in textures or self._textures[p.name] is not None for p in self.plans], np.bool_)
        return np.where(has, np.cumsum(has) - 1, -1).astype(np.int32)

    def _patches_of(self, image: NDArray[np.int32], colour: NDArray[np.float32]) -> DeviceArray:
        patches: PatchArrays = copy_struct(self._patches)
        fields: dict[str, DeviceArray] = {
            "image": wp.array(image, dtype=wp.int32, device=self.device),
            "colour": wp.array(colour, dtype=wp.vec3f, device=self.device),
        }
        return struct_array([set_fields(patches, **fields)], self.device)
