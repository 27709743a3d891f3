"""Remedies for values that people write by habit: other units, a decimal comma, brackets, times without quotes."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Collection

from recipe_compiler.library import towns, weather
from recipe_compiler.schema import units
from recipe_compiler.source.yaml_help import name_of

_KMH = 3.6  # km/h in 1 m/s
_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]{1,9},[0-9]{1,9}\Z")
_NO_SPACE = re.compile(r"([A-Za-z_]\w{0,39}):([\w.*#+-]{1,60})\Z")
_CURLY = "\u201c\u201d\u201e\u2018\u2019\u201a\u00ab\u00bb"


def of_value(key: str, wanted: str, value: object, fields: Collection[str] = (), unit: str | None = None) -> str | None:
    """Return the remedy for a value of the wrong type; None if nothing in particular is known.

    Args:
        key: the key of the value.
        wanted: what it must be, such as `a number` or `text`.
        value: what is given.
        fields: the keys of the map that is wanted.
        unit: the unit of the number that is wanted, if it has one.
    """
    if key == "time" and isinstance(value, int | float) and not isinstance(value, bool):
        return _time(value)
    if key == "blueprint" and isinstance(value, list) and len(value) > 1:
        return "write one id, or a glob such as vehicle.sedan.* of which one is drawn"
    if isinstance(value, list) and len(value) == 1 and wanted not in ("a list", "a map"):
        return "remove the brackets"
    if wanted == "a map" and isinstance(value, list) and {"x", "y"} <= set(fields):
        return _point(value, fields)
    if wanted == "a map" and isinstance(value, str) and (spaced := _spaced(value)):
        return spaced
    if wanted == "a list" and isinstance(value, str | dict):
        return _in_list(value)
    if wanted == "a map" and "uniform" in fields and isinstance(value, list) and None not in map(_number_of, value):
        return f"write {{uniform: [{', '.join(f'{item:g}' for item in value)}]}}" if len(value) == 2 else None
    if key == "texture" and wanted == "a map" and isinstance(value, str):
        return _texture(value)
    number = _number_of(value)
    if wanted == "a whole number" and number is not None and abs(number) < 1e9:
        return f"write {math.floor(number + 0.5)}, without a fraction"
    if value is None and wanted in ("a number", "a whole number", "text"):
        return f"write {wanted} after the `:`"
    if wanted == "a list" and key in ("yaw", "pitch", "roll") and number is not None:
        return f"write [{-abs(number):g}, {abs(number):g}]"
    if wanted in ("a number", "a whole number") and isinstance(value, str):
        return _number(value, unit)
    return None


def of_text(text: object) -> str | None:
    """Return the remedy for text with curly quotes, which YAML takes for part of it; None if it has none."""
    curly = next((c for c in str(text)[:200] if c in _CURLY), None)
    return None if curly is None else f"replace {name_of(curly)} by straight quotes"


def of_word(word: object) -> str | None:
    """Return the remedy for an unknown word; None if nothing in particular is known."""
    if isinstance(word, str) and " - " in word:  # YAML continues the item above with an item that is indented more
        return "start every `- ` of the list in the same column"
    return of_text(word)


def of_limit(key: str, value: object) -> str:
    """Return what the remedy for a number beyond its limits adds: the unit, where another one is usual."""
    number = _number_of(value)
    if key == "speed" and number is not None and number > 0:
        return f", in m/s ({number:g} km/h is {number / _KMH:.1f})"
    return ""


def of_key(key: str, value: object) -> str | None:
    """Return the remedy for an unknown key; None if nothing in particular is known."""
    if value is None and key.isdecimal():
        return "write numbers with a decimal point, not a comma"
    if (colon := next((c for c in key if c in "\uff1a\ufe55\u2236"), None)) is not None:
        return f"replace {name_of(colon)} by `:` and a space"
    if value is None and (spaced := _spaced(key)):
        return spaced
    odd = next((c for c in key if unicodedata.category(c) in ("Zs", "Cf") and c != " "), None)
    return None if odd is None else f"remove the character {name_of(odd)}"


def of_delta(value: object) -> str | None:
    """Return the remedy for a delta that is a name instead of a map; None if the name is unknown."""
    for section, names in (("weather", weather.PRESETS), ("town", towns.NAMES)):
        if isinstance(value, str) and value in names:
            return f"write {{{section}: {value}}}"
    return _spaced(value) if isinstance(value, str) else None


def _spaced(text: str) -> str | None:
    """The remedy for a key and its value with no space between, such as `fps:10`, which YAML reads as text."""
    found = _NO_SPACE.match(text)
    return f"put a space after the colon: {found[1]}: {found[2]}" if found else None


def _number_of(value: object) -> float | None:
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def _time(value: float) -> str | None:
    if isinstance(value, int) and value >= 100:
        hours, minutes = divmod(value, 100)
    else:
        hours, minutes = int(value), round(value % 1 * 60)
    return f'write "{hours:02d}:{minutes:02d}"' if 0 <= hours < 24 and 0 <= minutes < 60 else None


def _point(value: list[object], fields: Collection[str]) -> str | None:
    axes = ("x", "y", "z")[: len(value)]
    if not 2 <= len(value) <= 3 or not set(axes) <= set(fields) or None in map(_number_of, value):
        return None
    return f"write {{{', '.join(f'{axis}: {number:g}' for axis, number in zip(axes, value, strict=True))}}}"


def _texture(value: str) -> str:
    """The remedy for a texture that is a path or a colour instead of a map."""
    if re.fullmatch(r"[\w./-]{1,80}\.png", value, re.IGNORECASE):
        return f"write {{image: {value}}}"
    if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        return f'write {{color: "{value}"}}'
    return 'write {image: FILE.png}, {frames: FOLDER} or {color: "#rrggbb"}'


def _in_list(value: str | dict[str, object]) -> str | None:
    """The remedy for words, or one flat map, where a list is wanted."""
    if isinstance(value, dict):
        entries = ", ".join(f"{key}: {item}" for key, item in value.items())
        plain = all(isinstance(item, int | float | str) for item in value.values()) and len(entries) <= 60
        return f"write [{{{entries}}}]" if plain else None
    words = re.split(r"[,;\s]+", value.strip())[:9]
    fit = len(words) <= 8 and all(re.fullmatch(r"[\w.*-]{1,40}", word) for word in words)
    return f"write [{', '.join(words)}]" if fit else None


def _number(text: str, unit: str | None) -> str | None:
    if _DECIMAL_COMMA.match(text):
        return f"write {text.replace(',', '.')}, with a decimal point"
    return units.remedy(text, unit) or of_text(text)
