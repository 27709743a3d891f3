"""What a person wears: the surfaces of skin and clothes, and their cut, from the shape of the blueprint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from recipe_runtime.meshes.mesh import Pattern, Surface

SHORTS, TROUSERS, SKIRT = 0, 1, 2
SWEATER, COLLAR, HOOD, OPEN, VEST = 0, 1, 2, 3, 4  # values of `shape["top"]`
_TOPS = (Pattern.CLOTH, Pattern.STRIPES, Pattern.CHECKS, Pattern.PRINT)  # by `shape["print"]`


@dataclass(frozen=True)
class Outfit:
    """The surfaces of a person, and the cut of the clothes.

    Attributes:
        long: Whether the sleeves reach the wrists.
        legs: SHORTS, TROUSERS or SKIRT.
        top: SWEATER (or T-shirt), COLLAR, HOOD, OPEN (a jacket over a shirt) or VEST (high-visibility).
        coat: Metres by which the hem of the top is below the hips.
    """

    skin: Surface
    hair: Surface
    lips: Surface
    eye: Surface
    pupil: Surface
    hat: Surface
    shirt: Surface
    inner: Surface
    trousers: Surface
    shoes: Surface
    sole: Surface
    bag: Surface
    long: bool
    legs: int
    top: int
    coat: float

    @classmethod
    def of(cls, shape: Mapping[str, float], tag: int) -> Outfit:
        """Return the outfit of a blueprint's shape, with a semantic tag."""
        top = int(shape["top"])
        over = Pattern.VEST if top == VEST else _TOPS[int(shape["print"])]
        return cls(
            skin=Surface("skin", Pattern.SKIN, tag),
            hair=Surface("hair", Pattern.HAIR, tag),
            lips=Surface("lips", Pattern.SKIN, tag),
            eye=Surface("eye", Pattern.SKIN, tag),
            pupil=Surface("pupil", Pattern.PLAIN, tag),
            hat=Surface("hat", Pattern.CLOTH, tag),
            shirt=Surface("shirt", over, tag),
            inner=Surface("inner", Pattern.CLOTH, tag),
            trousers=Surface("trousers", Pattern.DENIM if shape["denim"] else Pattern.CLOTH, tag),
            shoes=Surface("shoes", Pattern.RUBBER, tag),
            sole=Surface("sole", Pattern.RUBBER, tag),
            bag=Surface("bag", Pattern.CLOTH, tag),
            long=shape["sleeves"] > 0,
            legs=int(shape["legs"]),
            top=top,
            coat=shape["coat"],
        )
