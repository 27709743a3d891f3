"""Decoders of asset files: meshes (OBJ, STL, glTF) and images (PNG).

Compiler and runtime both use them, on bytes whose digest is in the plan. Files are untrusted: sizes and counts are
checked before memory is allocated, references to other files are not followed, and any invalid file raises `AssetError`
with the fault and a remedy. Numbers are rounded to a fixed grid by arithmetic that is the same on every CPU.
"""

from recipe_compiler.ir.assets.bodies import BodyData
from recipe_compiler.ir.assets.decode import body, image, mesh
from recipe_compiler.ir.assets.geometry import AssetError, MeshData, Part

__all__ = ["AssetError", "BodyData", "MeshData", "Part", "body", "image", "mesh"]
