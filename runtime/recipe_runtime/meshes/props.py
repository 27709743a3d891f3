"""Bodies of props: meshes from files, and flat boards, with vertices in the world frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.assets import MeshData, Part
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import FilePlan, PropPlan
from recipe_compiler.ir.plan_bounds import MAX_PROP_TRIANGLES

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Mesh, Pattern, Surface


def prop_bodies(props: Iterable[PropPlan], assets: Assets) -> Iterator[Body]:
    """Yield a static body in world coordinates, with instance 0, for each prop. Each mesh is decoded once.

    Raises:
        InputError: The meshes have more triangles than those of a recipe may have: the plan may be untrusted.
        RunError: A file differs from the one in the plan.
    """
    meshes: dict[tuple[FilePlan, str], MeshData] = {}
    triangles = 0
    for prop in props:
        if prop.mesh is None:
            parts: Sequence[Part] = _board(prop)
        else:
            key = prop.mesh, prop.up
            if key not in meshes:
                meshes[key] = assets.mesh(prop)
            parts, triangles = meshes[key].parts, triangles + meshes[key].triangles
        if triangles > MAX_PROP_TRIANGLES:
            raise InputError(
                f"{prop.name}: {triangles:,} triangles of props up to here exceed the limit of {MAX_PROP_TRIANGLES:,}",
                help="use fewer or simpler meshes",
                code=Code.INPUT_LIMIT,
            )
        yield Body(prop.name, 0, (("static", _mesh(prop, parts)),))


def _mesh(prop: PropPlan, parts: Sequence[Part]) -> Mesh:
    slots = list(dict.fromkeys(part.slot for part in parts))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    pose = from_pose(prop.pose)
    moved = [_turned(part.vertices * prop.scale, pose) + pose[:, 3] for part in parts]
    numbers = [np.full(len(part.triangles), slots.index(part.slot)) for part in parts]
    return Mesh(
        vertices=np.concatenate(moved).astype(np.float32),
        normals=np.concatenate([_turned(part.normals, pose) for part in parts]).astype(np.float32),
        uvs=np.concatenate([part.uvs for part in parts]).astype(np.float32),
        triangles=np.concatenate([p.triangles + s for p, s in zip(parts, starts, strict=False)]).astype(np.int32),
        surface=np.concatenate(numbers).astype(np.int32),
        surfaces=tuple(Surface(slot, Pattern.IMAGE, prop.tag) for slot in slots),
    )


def _turned(rows: NDArray[np.float64], pose: Array) -> NDArray[np.float64]:
    """Return the rows rotated by a pose, component by component."""
    columns = [rows[:, 0] * r[0] + rows[:, 1] * r[1] + rows[:, 2] * r[2] for r in pose]
    return np.stack(columns, axis=-1)


# Faces of a box: the normal, and four corners counter-clockwise from outside, from the bottom left; 0 low, 1 high.
_SIDES = (
    ((1, 0, 0), ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1))),
    ((-1, 0, 0), ((0, 1, 0), (0, 0, 0), (0, 0, 1), (0, 1, 1))),
    ((0, 1, 0), ((1, 1, 0), (0, 1, 0), (0, 1, 1), (1, 1, 1))),
    ((0, -1, 0), ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
    ((0, 0, 1), ((1, 0, 1), (1, 1, 1), (0, 1, 1), (0, 0, 1))),
    ((0, 0, -1), ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))),
)
_CORNER_UVS = ((0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0))


def _board(prop: PropPlan) -> list[Part]:
    """Return a thin box. Its +x side is the face, upright and not mirrored when seen from the front.

    The rest is the back.
    """
    ends = np.array([prop.low, prop.high])
    parts = []
    for side, (normal, corners) in enumerate(_SIDES):
        places = [[ends[high, axis] for axis, high in enumerate(corner)] for corner in corners]
        parts.append(
            Part(
                slot="face" if side == 0 else "back",
                vertices=np.array(places),
                normals=np.array([normal] * 4, np.float64),
                uvs=np.array(_CORNER_UVS),
                triangles=np.array([[0, 1, 2], [0, 2, 3]]),
            )
        )
    return parts
