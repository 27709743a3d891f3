"""Surfaces of towns, props and actors to which patches can be applied."""

from recipe_compiler.library.surfaces.actors import actor_surfaces
from recipe_compiler.library.surfaces.elements import KINDS, element_surfaces, prop_surfaces, town_surfaces
from recipe_compiler.library.surfaces.surface import FlatSurface, Surface, WholeSurface

__all__ = [
    "KINDS",
    "FlatSurface",
    "Surface",
    "WholeSurface",
    "actor_surfaces",
    "element_surfaces",
    "prop_surfaces",
    "town_surfaces",
]
