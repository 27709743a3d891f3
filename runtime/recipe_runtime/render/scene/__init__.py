"""A scene's triangles on the device, and the pinhole camera."""
