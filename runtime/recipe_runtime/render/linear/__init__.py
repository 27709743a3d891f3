"""Linear maps on a device and their transposes: sparse matrices, and the mip levels of textures."""
