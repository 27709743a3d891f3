"""Remedies for values and keys of the wrong form: quotes, units, a decimal comma, brackets, colons without a space."""

from __future__ import annotations

import re

from recipe_compiler.source.yaml_help import name_of

_CURLY = "\u201c\u201d\u201e\u2018\u2019\u201a\u00ab\u00bb"
_NO_SPACE = r"([A-Za-z_]\w{0,39}):([\w.*#+-]{1,60})\Z"
_OF_KEY = {  # key, what is wanted -> the remedy
    ("time", "text"): 'write it as "19:40"',
    ("blueprint", "text"): "write one id, or a glob such as vehicle.sedan.* of which one is drawn",
    ("capture", "a list"): "write it in square brackets, such as [rgb, depth]",
    ("texture", "a map"): 'write {image: FILE.png}, {frames: FOLDER} or {color: "#rrggbb"}',
}
_OF_TEXT = (  # what is wanted, pattern of the text, the remedy
    ("number", r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)\Z", "remove the quotes"),
    ("number", r"[-+]?[0-9]{1,9},[0-9]{1,9}\Z", "write a decimal point, not a comma"),
    ("number", r"[-+]?[0-9.]{1,9} ?[A-Za-z°%/]{1,12}\Z", "write the number alone{}"),
    ("true or false", r"(true|false)\Z", "remove the quotes"),
    ("a map", _NO_SPACE, "put a space after the colon"),
)


def of_value(key: str, wanted: str, value: object, unit: str) -> str | None:
    """Return the remedy for a value of the wrong type; None if nothing in particular is known.

    Args:
        key: the key of the value.
        wanted: what it must be, such as `a number` or `text`.
        value: what is given.
        unit: the unit of the number that is wanted, such as `, in metres`; empty if it has none.
    """
    if value is None and wanted != "a map":
        return f"write {wanted} after the `:`"
    if (key, wanted) in _OF_KEY:
        return _OF_KEY[key, wanted]
    if isinstance(value, list) and wanted not in ("a list", "a map"):
        return "write one value, without brackets"
    if not isinstance(value, str):
        return None
    found = (remedy for kind, pattern, remedy in _OF_TEXT if kind in wanted and re.match(pattern, value))
    return next(found, "").format(unit) or of_text(value)


def of_text(text: object) -> str | None:
    """Return the remedy for text with curly quotes, which YAML takes for part of it; None if it has none."""
    curly = next((c for c in str(text)[:200] if c in _CURLY), None)
    return None if curly is None else f"replace {name_of(curly)} by straight quotes"


def of_word(word: object) -> str | None:
    """Return the remedy for an unknown word; None if nothing in particular is known."""
    if isinstance(word, str) and " - " in word:  # YAML continues the item above with an item that is indented more
        return "start every `- ` of the list in the same column"
    return of_text(word)


def of_key(key: str, value: object) -> str | None:
    """Return the remedy for an unknown key; None if nothing in particular is known."""
    if value is None and key.isdecimal():
        return "write numbers with a decimal point, not a comma"
    if value is None and re.match(_NO_SPACE, key):
        return "put a space after the colon"
    odd = next((c for c in key if not c.isascii() and not c.isalnum()), None)
    return None if odd is None else f"replace the character {name_of(odd)}"
