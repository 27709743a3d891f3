"""Lowers patches to plans, and finds the files of their textures."""
