"""Rendering a frame again with other patch textures, and the texels that each pixel shows."""
