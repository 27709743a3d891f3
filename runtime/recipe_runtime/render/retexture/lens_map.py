"""The samples of a picture as a linear function of the pixels of its HDR image that change with a texture.

Motion blur, bloom, distortion, chromatic aberration and supersampling are linear in the HDR image. Here each is a
sparse matrix with the indices and weights that the renderer's kernels use.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.render.camera import bloom
from recipe_runtime.render.camera.develop_kernels import Response
from recipe_runtime.render.camera.motion_blur import NeighbourFrame, ScreenMotion
from recipe_runtime.render.camera.post_process import PostProcess, lens_arguments
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import Values
from recipe_runtime.render.linear.sparse import RowMatrix, row_matrix
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.retexture.lens_map_kernels import (
    count_moments,
    mark_pixels,
    record_moments,
    record_samples,
)

Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class LensMap:
    """How the S samples of the Q pixels that change depend on the P pixels of the HDR image that change.

    Let d be the difference of these P pixels from `hdr`, b = blur d and c = bloom[2] bloom[1] bloom[0] b. A channel of
    the samples is then `light + lens [b; c]`, which is multiplied by `gain` before the tone curve.
    """

    pixels: Numbers  # [Q] index in the picture
    per_pixel: int  # samples of each
    hdr: Values  # [P, 3] with the texture of the recipe
    light: Values  # [S, 3] by sample, with the texture of the recipe
    gain: Values  # [S] of the vignette
    blur: RowMatrix | None  # [B, P]; None without motion blur
    bloom: tuple[RowMatrix, ...]  # downsampling, blur along rows, blur along columns; empty without bloom
    lens: tuple[RowMatrix, ...]  # [S, B + C], one for all channels, or one each for red, green and blue


@dataclass(frozen=True, eq=False)
class LensFrame:
    """A frame before motion blur and lens effects."""

    undistorted: Observation
    seen: Observation
    response: CameraResponse
    record: Response  # the response with exposure and noise
    neighbour: NeighbourFrame | None

    @property
    def undistorted_camera(self) -> CameraPlan:
        """The camera of the HDR image."""
        return self.undistorted.camera


def lens_map(post: PostProcess, frame: LensFrame, hdr_image: DeviceArray, changed: Numbers, device: str) -> LensMap:
    """Return how the picture depends on some pixels of the HDR image.

    Args:
        post: The effects of the scene.
        frame: The frame.
        hdr_image: The HDR image with the texture of the recipe, vec3f.
        changed: Indices of the pixels in it that change, ascending.
        device: The device of the arrays.
    """
    camera, response = frame.undistorted_camera, frame.response
    motion = post.motion(frame.undistorted, response, frame.neighbour)
    marked = np.zeros((hdr_image.size, 3), np.float32)
    marked[changed] = 1.0
    on_device: DeviceArray = wp.array(marked, dtype=wp.vec3f, device=device)
    marks, spread_marks = post.spread_light(on_device, camera, response, motion)
    blurred = np.flatnonzero(marks.numpy()[:, 0]).astype(np.int32)
    blur = None if motion is None else _blur(motion, changed, blurred, device)
    lens = lens_arguments(frame.seen.camera, camera, response)
    out_marks = wp.empty(frame.seen.camera.width * frame.seen.camera.height, dtype=wp.uint8, device=device)
    launch(mark_pixels, out_marks.size, device, marks=marks, spread=spread_marks, out_marks=out_marks, **lens)
    pixels = np.flatnonzero(out_marks.numpy()).astype(np.int32)
    light, gains, points = _samples(post, frame, hdr_image, motion, pixels, device)
    matrices, cells = _bloom(blurred, camera) if response.bloom_intensity > 0.0 else ((), blurred[:0])
    share = float(np.float32(bloom.SHARE * response.bloom_intensity))
    return LensMap(
        pixels=pixels,
        per_pixel=len(light) // max(len(pixels), 1),
        hdr=hdr_image.numpy()[changed].astype(np.float64),
        light=light.astype(np.float64),
        gain=gains.astype(np.float64),
        blur=blur,
        bloom=matrices,
        lens=tuple(_lens(points[:, c], camera, blurred, cells, share) for c in range(points.shape[1])),
    )


def _samples(
    post: PostProcess,
    frame: LensFrame,
    hdr_image: DeviceArray,
    motion: ScreenMotion | None,
    pixels: Numbers,
    device: str,
) -> tuple[NDArray[np.float32], NDArray[np.float32], Values]:
    """Return light [S, 3] and vignette [S] of the samples of pixels, and their points [S, 1 or 3, 2]."""
    camera, response = frame.undistorted_camera, frame.response
    lens = lens_arguments(frame.seen.camera, camera, response)
    fine = lens["distortion"].fine
    count = len(pixels) * fine * fine
    channels = 3 if response.chromatic_aberration_intensity > 0.0 else 1
    out_light = wp.empty(count, dtype=wp.vec3f, device=device)
    out_gains = wp.empty(count, dtype=wp.float32, device=device)
    out_points = wp.empty((count, channels), dtype=wp.vec2d, device=device)
    light, spread = post.spread_light(hdr_image, camera, response, motion)
    launch(
        record_samples,
        len(pixels),
        device,
        listed=wp.array(pixels, dtype=wp.int32, device=device),
        hdr_image=light,
        spread=spread,
        **lens,
        response=frame.record,
        lens_circle=post.lens_circle(response),
        out_light=out_light,
        out_gains=out_gains,
        out_points=out_points,
    )
    return out_light.numpy(), out_gains.numpy(), out_points.numpy().reshape(count, channels, 2)


def _blur(motion: ScreenMotion, changed: Numbers, blurred: Numbers, device: str) -> RowMatrix:
    """Return the matrix from changed pixels to motion-blurred pixels: the mean over the moments of the exposure."""
    listed: DeviceArray = wp.array(blurred, dtype=wp.int32, device=device)
    counts = wp.empty(len(blurred), dtype=wp.int32, device=device)
    fields = motion.arguments()
    shared = {"listed": listed, "longest": fields["longest"], "shutter": fields["shutter"]}
    launch(count_moments, len(blurred), device, out_counts=counts, **shared)
    moments = counts.numpy()
    firsts = np.cumsum([0, *moments]).astype(np.int32)
    out_shown = wp.empty(int(firsts[-1]), dtype=wp.int32, device=device)
    on_device: DeviceArray = wp.array(firsts, dtype=wp.int32, device=device)
    launch(record_moments, len(blurred), device, listed=listed, firsts=on_device, out_shown=out_shown, **fields)
    still = moments == 0  # these keep their own light
    rows = np.repeat(np.arange(len(blurred), dtype=np.int32), np.maximum(moments, 1))
    sources, weights = blurred[rows].copy(), (1.0 / np.maximum(moments, 1))[rows]
    sources[~still[rows]] = out_shown.numpy()
    column_of = _column_of(changed, motion.motion.size)
    return _matrix(rows, column_of[sources], weights, (len(blurred), len(changed)))


def _bloom(pixels: Numbers, camera: CameraPlan) -> tuple[tuple[RowMatrix, ...], Numbers]:
    """Return the three matrices from pixels of the HDR image to the bloom image, and the pixels of it that change."""
    side = bloom.side_of(camera)
    wide, high = -(-camera.width // side), -(-camera.height // side)
    cell = pixels // camera.width // side * wide + pixels % camera.width // side
    cells = np.unique(cell)
    across = np.minimum(side, camera.width - cells % wide * side)
    down = np.minimum(side, camera.height - cells // wide * side)
    row = np.searchsorted(cells, cell)
    order = np.argsort(row, kind="stable")
    means = _matrix(row[order], order, (1.0 / (across * down))[row[order]], (len(cells), len(pixels)))
    rows, cells = _bell_blur(cells, wide, high, 1)
    columns, cells = _bell_blur(cells, wide, high, 0)
    return (means, rows, columns), cells.astype(np.int32)


def _bell_blur(cells: Numbers, wide: int, high: int, across: int) -> tuple[RowMatrix, Numbers]:
    """Return the blur of an image that is 0 except at some pixels, and the pixels where the result is not 0.

    Args:
        cells: The pixels that are not 0.
        wide: Width of the image.
        high: Height of the image; pixels are clamped to its border.
        across: 1 to blur along rows, 0 along columns.
    """
    weights = bloom.bell().astype(np.float64)
    steps = np.arange(len(weights)) - len(weights) // 2
    lines = np.unique(cells // wide if across else cells % wide)
    if across:
        places = (lines[:, None] * wide + np.arange(wide)).reshape(-1)
    else:
        places = (np.arange(high)[:, None] * wide + lines).reshape(-1)
    x = np.clip((places % wide)[:, None] + steps * across, 0, wide - 1)
    y = np.clip((places // wide)[:, None] + steps * (1 - across), 0, high - 1)
    columns = _column_of(cells, wide * high)[y * wide + x]
    reached = (columns >= 0).any(axis=1)
    places, columns = places[reached], columns[reached]
    rows = np.repeat(np.arange(len(places)), len(weights))
    values = np.tile(weights, len(places))
    return _matrix(rows, columns.reshape(-1), values, (len(places), len(cells))), places.astype(np.int32)


def _lens(points: Values, camera: CameraPlan, pixels: Numbers, cells: Numbers, share: float) -> RowMatrix:
    """Return the matrix from pixels of the HDR image and of the bloom image to the light at points of the HDR image.

    Args:
        points: [S, 2], in pixels of the HDR image.
        camera: Its camera.
        pixels: Its pixels: the first columns.
        cells: Pixels of the bloom image: the other columns.
        share: Weight of the bloom image.
    """
    size = camera.width * camera.height
    column_of = _column_of(pixels, size)
    sources, weights = _bilinear(points, camera.width, camera.height)
    if len(cells):
        side = bloom.side_of(camera)
        wide, high = -(-camera.width // side), -(-camera.height // side)
        after = _column_of(cells, wide * high)
        column_of = np.concatenate([column_of, np.where(after >= 0, after + len(pixels), -1)])
        spread, parts = _bilinear(points * (1.0 / side), wide, high)
        sources = np.concatenate([sources, spread + size], axis=1)
        weights = np.concatenate([weights * (1.0 - share), parts * share], axis=1)
    rows = np.repeat(np.arange(len(points)), sources.shape[1])
    shape = len(points), len(pixels) + len(cells)
    return _matrix(rows, column_of[sources.reshape(-1)], weights.reshape(-1), shape)


def _bilinear(points: Values, wide: int, high: int) -> tuple[NDArray[np.int64], Values]:
    """Return the pixels that interpolation at points reads, and their weights, [S, 4]: `bilinear` of the lens."""
    x = np.clip(points[:, 0] - 0.5, 0.0, wide - 1)
    y = np.clip(points[:, 1] - 0.5, 0.0, high - 1)
    i, j = x.astype(np.int64), y.astype(np.int64)
    fx, fy = ((v - k).astype(np.float32).astype(np.float64) for v, k in ((x, i), (y, j)))
    right, below = np.minimum(i + 1, wide - 1), np.minimum(j + 1, high - 1)
    sources = np.stack([j * wide + i, j * wide + right, below * wide + i, below * wide + right], axis=1)
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=1)
    return sources, weights


def _column_of(places: Numbers, size: int) -> Numbers:
    """Return the position of each index in `places`, int32 [size]; -1 for indices that it does not contain."""
    column_of = np.full(size, -1, np.int32)
    column_of[places] = np.arange(len(places), dtype=np.int32)
    return column_of


def _matrix(
    rows: NDArray[np.integer], columns: NDArray[np.integer], weights: Values, shape: tuple[int, int]
) -> RowMatrix:
    """Return a matrix of entries in ascending order of rows; entries with a column of -1 are left out."""
    kept = columns >= 0
    counts = np.bincount(rows[kept], minlength=shape[0])
    firsts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return row_matrix(firsts, columns[kept].astype(np.int32), weights[kept], shape[1])
