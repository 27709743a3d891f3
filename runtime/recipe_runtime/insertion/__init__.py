"""Insertion of textures into finished pictures: by a homography, with or without a colour transform."""
