"""Frames that are rendered again with other textures, and which texels each of their pixels shows."""
