"""Names that are similar to a misspelt one, for remedies."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import lru_cache

MAX_LENGTH = 100  # characters that are compared of each name; the time is quadratic in it
_MAX_COMPARED = 30  # of many names, those with the most letter pairs in common are compared letter by letter


def similar_names(word: str, names: Iterable[str], number: int, cutoff: float) -> list[str]:
    """Return the names most similar to a word, the most similar first.

    Args:
        word: the word.
        names: any number of names; few of them are compared letter by letter.
        number: the most names to return.
        cutoff: the least similarity, 0 to 1, as `difflib.get_close_matches` has it.
    """
    options = list(names)
    if len(options) > _MAX_COMPARED:
        pairs = _letter_pairs(word[:MAX_LENGTH])
        options = sorted(options, key=lambda name: -_overlap(pairs, _letter_pairs(name[:MAX_LENGTH])))[:_MAX_COMPARED]
    return difflib.get_close_matches(word[:MAX_LENGTH], options, n=number, cutoff=cutoff)


@lru_cache(maxsize=1 << 14)
def _letter_pairs(text: str) -> frozenset[str]:
    return frozenset(text[at : at + 2] for at in range(len(text) - 1))


def _overlap(one: frozenset[str], other: frozenset[str]) -> float:
    """The share of letter pairs that two words have in common, 0 to 1 (Dice's coefficient)."""
    return 2 * len(one & other) / max(1, len(one) + len(other))
