"""PyTorch: a dataset that renders a recipe on demand, and frames as a differentiable function of a patch's texture.

Requires `torch`: without it, the import of this package raises InputError.

    from torch.utils.data import DataLoader
    from recipe_runtime.torch import RecipeDataset

    street = RecipeDataset("recipes/weather_sweep.yaml", modalities=("rgb", "depth"))
    for batch in DataLoader(street, batch_size=8, shuffle=True, num_workers=4):
        batch["rgb"], batch["depth"]                     # uint8 [8, 3, H, W], float32 [8, H, W]

Frames have the bytes of the built dataset, in any order and in any worker. `SceneView` is a module that maps
textures to pictures, with the exact gradient; the other modules change textures for attacks that survive a printer.
"""

from recipe_compiler.ir.errors import Code, InputError

try:
    import torch  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "torch":  # torch is installed, and lacks a library itself
        raise
    raise InputError(
        "PyTorch is not installed", help="install it: pip install 'torch>=2.6'", code=Code.MISSING_LIBRARY
    ) from None

from recipe_runtime.torch.augment import Geometric, Photometric
from recipe_runtime.torch.dataset import RecipeDataset, Sample
from recipe_runtime.torch.printable import Printable, total_variation
from recipe_runtime.torch.scene_view import SceneView
from recipe_runtime.torch.shots import Place, Shot

__all__ = [
    "Geometric",
    "Photometric",
    "Place",
    "Printable",
    "RecipeDataset",
    "Sample",
    "SceneView",
    "Shot",
    "total_variation",
]
