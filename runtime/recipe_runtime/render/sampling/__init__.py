"""The shading samples of a frame, and the geometry at each."""
