"""Ground truth of patches: where the patches of a frame are in its picture.

A rectangle's corners are listed clockwise from the top left of its texture, in three forms: as projected; clipped to
the picture; and as the integer coordinates of the pixels that contain the clipped ones. A body that is entirely covered
has the corners of its mask's box. Pixel (0, 0) has its top-left corner at (0, 0) and its centre at (0.5, 0.5).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.patches import MAX_PATCHES, PatchFace, PatchPlan
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.annotate.calibration import Calibration, calibration
from recipe_runtime.annotate.masks import Mask, masks
from recipe_runtime.core.documents import Meta, Number, Pair, Whole
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.insertion import projection

Corners: TypeAlias = Annotated[list[Pair], Meta(min_length=4, max_length=4)]
_Pixel: TypeAlias = Annotated[int, Meta(ge=-(1 << 31), lt=1 << 31)]
_PixelPair: TypeAlias = Annotated[list[_Pixel], Meta(min_length=2, max_length=2)]

_AREAS = 16 * MAX_PATCHES  # that are kept
_GRID = 1 << 20  # depths are added as integer multiples of 2^-20 m, so that their sum does not depend on the order


class PatchRecord(TypedDict):
    """One patch of one frame, as plain JSON. Non-integers have six decimal places."""

    name: str
    mode: str
    body: str  # element of the town, actor or prop that it is on
    texture: str  # sha256:... of its image in this frame, or its colour
    corners: Corners | None  # x, y; None if a corner is behind the camera, or an entirely covered body is not visible
    corners_clipped: Corners | None  # within the picture
    corners_int: Annotated[list[_PixelPair], Meta(min_length=4, max_length=4)] | None  # the pixels that contain these
    area: Whole  # pixels whose centres show it
    amodal_area: int | None  # the same without occlusion; None for a prop that is entirely covered
    visible_fraction: float | None  # area / amodal_area; 0 outside the picture
    depth: Number | None  # mean depth of the visible pixels, metres along the optical axis; None if there are none
    counts: str | None  # mask of the visible pixels in COCO's compressed run-length code
    homography: list[list[float]] | None  # see `projection.homography`; None for a body that is entirely covered


class FrameTruth(TypedDict):
    """The patches of one frame of one sensor."""

    frame: int
    width: int
    height: int
    calibration: Calibration
    patches: list[PatchRecord]


def patch_truth(
    source: SceneSource,
    appearance: AppearancePlan,
    sensor: SensorPlan,
    seen: Observed,
    frame: int,
    patch_map: NDArray[np.uint8] | None = None,
) -> FrameTruth:
    """Return the ground truth of an appearance's patches in a frame.

    Args:
        source: The scene.
        appearance: The appearance.
        sensor: The sensor.
        seen: The sensor's observation of the frame, by `source`.
        frame: Number of the frame.
        patch_map: 1 + the number of the patch that each pixel shows, uint8 [H, W]; found from `seen` by default.
    """
    shown = source.patch_map(seen, appearance, frame) if patch_map is None else patch_map
    camera, pose = sensor.camera, sensor_transform(sensor, source.trace, frame)
    view = projection.view_from_world(pose)
    found = {mask.instance: mask for mask in masks(shown.astype(np.uint16))}
    records: list[PatchRecord] = []
    for number, patch in enumerate(appearance.patches, start=1):
        mask = found.get(number)
        depths = seen.depth[shown == number]
        if patch.whole:
            corners, matrix, amodal = _box_corners(mask), None, _amodal(source.scene, patch, seen, mask)
        else:
            there = projection.view_from_part(patch, source.trace, frame, view)
            homography = projection.homography(patch.faces[0], camera, there)
            corners, matrix = _corners(homography, camera), _rows(homography)
            amodal = _amodal_area(patch.faces[0], camera, there.tobytes())
        records.append(_record(patch, camera, frame, mask, depths, amodal, corners, matrix))
    return {
        "frame": frame,
        "width": camera.width,
        "height": camera.height,
        "calibration": calibration(camera, pose),
        "patches": records,
    }


def _amodal(scene: ScenePlan, patch: PatchPlan, seen: Observed, mask: Mask | None) -> int | None:
    """Return the amodal area of a patch that covers an entire body, in pixels; None for a prop.

    It is the body's amodal area times the patch's share of the body's visible pixels.
    """
    instance = next((a.tag * 1000 + a.instance for a in scene.actors if a.name == patch.body), None)
    if instance is None:
        return None
    visible = int((seen.instance == instance).sum())
    whole = next((view.amodal for view in seen.objects if view.instance == instance), 0)
    return 0 if mask is None or visible == 0 else int(mask.area * whole / visible + 0.5)


@lru_cache(_AREAS)
def _amodal_area(face: PatchFace, camera: CameraPlan, view_from_part: bytes) -> int:
    """Pixels that a rectangle would cover with nothing before it: the same in all frames while nothing moves."""
    there = np.frombuffer(view_from_part).reshape(3, 4)
    return int(projection.covered_pixels(face, camera, there).sum())


def _record(
    patch: PatchPlan,
    camera: CameraPlan,
    frame: int,
    mask: Mask | None,
    depths: NDArray[np.float32],
    amodal: int | None,
    corners: Corners | None,
    homography: list[list[float]] | None,
) -> PatchRecord:
    area = 0 if mask is None else mask.area
    if amodal is not None:
        amodal = max(amodal, area)  # a centre on an edge may be rounded either way
    clipped = None if corners is None else _clipped(corners, camera)
    file = patch.texture.at(frame)
    return {
        "name": patch.name,
        "mode": patch.mode,
        "body": patch.body,
        "texture": str(patch.texture.colour) if file is None else f"sha256:{file.sha256}",
        "corners": corners,
        "corners_clipped": clipped,
        "corners_int": None if clipped is None else _pixels(clipped, camera),
        "area": area,
        "amodal_area": amodal,
        "visible_fraction": None if amodal is None else fixed(area / max(amodal, 1)),
        "depth": _mean_depth(depths) if area else None,
        "counts": None if mask is None else mask.counts,
        "homography": homography,
    }


def _rows(matrix: NDArray[np.float64]) -> list[list[float]]:
    return [[fixed(float(v)) for v in row] for row in matrix]


def _corners(homography: NDArray[np.float64], camera: CameraPlan) -> Corners | None:
    """The corners of a rectangle in the picture; None if one is nearer than the near plane."""
    u, v = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    depth = (homography[2, 0] * u + homography[2, 1] * v) + homography[2, 2]
    if bool((depth < camera.near).any()):
        return None
    x, y, _ = projection.apply_homography(homography, u, v)
    bent = [projection.distort(camera, float(a), float(b)) for a, b in zip(x, y, strict=True)]
    return [[fixed(a), fixed(b)] for a, b in bent]


def _box_corners(mask: Mask | None) -> Corners | None:
    if mask is None:
        return None
    x, y, w, h = mask.box
    return [[float(a), float(b)] for a, b in ((x, y), (x + w, y), (x + w, y + h), (x, y + h))]


def _clipped(corners: Corners, camera: CameraPlan) -> Corners:
    return [[min(max(x, 0.0), float(camera.width)), min(max(y, 0.0), float(camera.height))] for x, y in corners]


def _pixels(corners: Corners, camera: CameraPlan) -> list[list[int]]:
    return [[min(int(x), camera.width - 1), min(int(y), camera.height - 1)] for x, y in corners]


def _mean_depth(depths: NDArray[np.float32]) -> float:
    whole = np.rint(depths.astype(np.float64) * _GRID).astype(np.int64)
    return fixed(int(whole.sum()) / (_GRID * len(whole)))
