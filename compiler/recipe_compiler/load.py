"""The work of a variant, from which `limits` estimates the cost of building it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass


@dataclass(frozen=True)
class Clip:
    """One sensor of one variant: a clip of frames."""

    frames: int
    pixels: int
    samples: int  # rendered; more than pixels with lens distortion or supersampling
    capture: tuple[str, ...]
    poses: int = 1
    still: bool = True  # neither in motion nor mounted on an actor
    bloom: bool = False
    moments: float = 0.0  # that motion blur averages
    interval: int = 1  # frames of the clip from one of its own to the next; at most all
    boxes: int = 0  # buildings and walls that shorten its arm
    history: int = 0  # earlier frames that its arm reads at each frame
    height: float = 0.0  # metres, of its highest point; above the actor that carries it
    bends: bool = False  # with lens distortion
    pitched: bool = False  # looks up or down
    rolled: bool = False  # tilted to a side


@dataclass(frozen=True)
class Load:
    """The work of one variant. Variants with equal keys share that work."""

    scene: Hashable
    rig: Hashable
    appearance: Hashable
    steps: int  # physics steps
    actors: int  # in all
    views: tuple[Clip, ...]
    named: int = 0  # actors that the recipe names, which its cameras show
    town: Hashable = None
    elements: int = 0  # of the town
    points: int = 0  # of all actors' routes
    metres: float = 0.0  # of all vehicles' routes
    changes: int = 0  # merged over the base: axes and draws
    texels: int = 0  # of all images
    sequences: bool = False  # whether a patch shows another image in each frame
    patches: int = 0
    moving_patches: int = 0  # on actors
    inserted_patches: int = 0  # into the finished picture
    charts: int = 0  # colour charts in the place of patches, for each of which a frame is shaded again
    patch_section: Hashable = None  # equal for variants with the same patches
    patch_images: int = 0  # of all sequences of images
    props: int = 0
    triangles: int = 0  # of all props
    parts: int = 0  # of their meshes
    mesh_triangles: int = 0  # of their distinct meshes
    mesh_parts: int = 0  # of the same
    mesh_text: int = 0  # bytes of those that are text
    looks: float = 0.0  # of agents at props, while they are simulated
