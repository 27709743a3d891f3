"""The renderer: Warp kernels, in pipeline order. The only folder that imports warp."""

from recipe_runtime.render.observe import ObjectView, Observation
from recipe_runtime.render.renderer import Renderer

__all__ = ["ObjectView", "Observation", "Renderer"]
