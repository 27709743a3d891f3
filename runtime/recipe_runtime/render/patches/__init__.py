"""Patches: decals that are evaluated per sample, from its triangle and its position."""
