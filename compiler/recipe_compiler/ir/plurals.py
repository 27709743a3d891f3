"""Counts with the correct plural: `1 frame`, `2,000 frames`, `2 bodies`."""

from __future__ import annotations


def count(number: int, noun: str, plural: str = "") -> str:
    """A number and its noun. `plural` is for nouns with an irregular plural."""
    return f"{number:,} {form(number, noun, plural or f'{noun}s')}"


def form(number: int, one: str, many: str) -> str:
    """`one` if the number is 1, otherwise `many`."""
    return one if number == 1 else many
