"""Patches: textures that an appearance lays on surfaces, found from a sample's triangle and position."""
