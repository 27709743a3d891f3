"""Files that a recipe brings, from bytes to numbers: meshes (OBJ, STL, glTF) and images (PNG).

Compiler and runtime both read them here, from bytes whose digest is in the plan, so both see the same. A file may be
anyone's: sizes and counts are bounded before memory is taken for them, nothing in it is followed to another file, and
whatever is wrong with it raises one error, `AssetError`, with what is wrong and what to do. Numbers are rounded to a
fixed grid by arithmetic that is the same on every CPU.
"""

from recipe_compiler.ir.assets.decode import image, mesh
from recipe_compiler.ir.assets.geometry import AssetError, MeshData, Part

__all__ = ["AssetError", "MeshData", "Part", "image", "mesh"]
