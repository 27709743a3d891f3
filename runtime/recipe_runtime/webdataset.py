"""Decoder for the WebDataset shards that `recipe export` writes, for use in a `webdataset` pipeline.

    webdataset.WebDataset(shards).decode(recipe_runtime.webdataset.decode)

webdataset's own picture decoders convert to 8 bits: they turn the 16-bit instance pictures into 0 and 255. This one
returns the values of the dataset's files. It does not import webdataset, and can be pickled for DataLoader workers.
"""

from __future__ import annotations

from typing import Any

from recipe_compiler.ir.modalities import MODALITIES

from recipe_runtime.core import documents
from recipe_runtime.modalities import declared
from recipe_runtime.modalities.reading import stored_array


def decode(key: str, data: bytes) -> Any:
    """The value of one file of a sample, by its key, such as `.instance.png`.

    Args:
        key: The file's ending, from the first dot of its name.
        data: The file's bytes.

    Returns:
        The array of a modality, as docs/dataset.md lists them; a rounded form, such as depth in a PNG, has the type of
        the array too. json: variant, sensor, fps, frame, and objects. None for any other file, which webdataset then
        leaves to its other decoders.

    Raises:
        ValueError: The file is damaged, or its content does not match its name.
    """
    name, _, ending = key.lstrip(".").rpartition(".")
    if not name and ending == "json":
        return _document(key, data)
    form = declared(name).files.get(ending) if name in MODALITIES else None
    if form is None:
        return None
    try:
        stored = stored_array(data, ending)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    if not form.fits(stored):
        raise ValueError(f"{key}: {stored.dtype} {stored.shape} is not a picture of this project, or is not finite")
    return form.load(stored)


def _document(key: str, data: bytes) -> Any:
    try:
        return documents.decode(data, dict[str, object])
    except ValueError as error:
        raise ValueError(f"{key}: is not the record of a frame: {error}") from None
