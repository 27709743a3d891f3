"""Numbers of things in words, with the right ending: `1 frame`, `2,000 frames`, `2 bodies`."""

from __future__ import annotations


def count(number: int, noun: str, plural: str = "") -> str:
    """So many of something. `plural` is for nouns that take more than an s."""
    return f"{number:,} {form(number, noun, plural or f'{noun}s')}"


def form(number: int, one: str, many: str) -> str:
    """The form of a noun or verb that goes with a number: `differs` with 1, `differ` with any other."""
    return one if number == 1 else many
