"""The points of a frame that are shaded, and the geometry at each."""
