"""Attacks on patches: where patches are in a picture, and how the picture depends on their textures."""
