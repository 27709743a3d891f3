"""Textures inserted into finished pictures: by a homography, with a colour transform or without."""
