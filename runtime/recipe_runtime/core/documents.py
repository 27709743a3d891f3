"""Decodes JSON documents of datasets, traces, journals and exports in one step into their declared types.

Values of other types, out of their ranges or without a required key are refused while they are parsed, so a document
takes memory in proportion to its bytes. Declared types are TypedDicts, tuples and lists with the annotations below;
code that has a decoded document checks only what no type says. Recipes, lockfiles and small records of the cache have
readers of their own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, TypeAlias, TypeVar

import msgspec
from msgspec import Meta as Meta
from msgspec import Raw as Raw

T = TypeVar("T")

_LARGEST = 10**15  # so that squares and whole numbers made of them do not overflow
_Between = Meta(ge=-_LARGEST, le=_LARGEST)

Whole: TypeAlias = Annotated[int, _Between]
if TYPE_CHECKING:
    Number: TypeAlias = float
else:  # an integer stays one, as the texts that are made of it have it
    Number = Annotated[int, _Between] | Annotated[float, _Between]
Pair: TypeAlias = Annotated[list[Number], Meta(min_length=2, max_length=2)]
Triple: TypeAlias = Annotated[list[Number], Meta(min_length=3, max_length=3)]
Four: TypeAlias = Annotated[list[Number], Meta(min_length=4, max_length=4)]
Box: TypeAlias = Annotated[list[Whole], Meta(min_length=4, max_length=4)]  # x, y, width, height in pixels
Matrix3: TypeAlias = Annotated[list[Triple], Meta(min_length=3, max_length=3)]
Matrix4: TypeAlias = Annotated[list[Four], Meta(min_length=4, max_length=4)]
Sha256: TypeAlias = Annotated[str, Meta(pattern="^[0-9a-f]{64}$", max_length=64)]


def decode(body: bytes | Raw, kind: type[T]) -> T:
    """Decode a JSON document into a type.

    The last value of a repeated key counts, and a TypedDict ignores unknown keys; `decode_exactly` refuses both.

    Raises:
        ValueError: it is not JSON, or not of this type; one printable line.
    """
    try:
        return msgspec.json.decode(body, type=kind)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8") from None
    except ValueError as error:
        text = str(error)[:300]
        raise ValueError(text if text.isprintable() else ascii(text)) from None


def decode_yaml(body: bytes, kind: type[T]) -> T:
    """Decode a YAML document of a user into a type.

    Raises:
        ValueError: it is not YAML, or not of this type; one printable line.
    """
    try:
        return msgspec.yaml.decode(body, type=kind)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except ValueError as error:
        text = " ".join(str(error).split())[:300]
        raise ValueError(text if text.isprintable() else ascii(text)) from None


def decode_exactly(body: bytes, kind: type[T]) -> T:
    """Decode a document in which each object has only known keys, and each once.

    Raises:
        ValueError: as `decode`; or the document has more than its decoded value.
    """
    found = decode(body, kind)
    if len(msgspec.json.format(body, indent=-1)) != len(msgspec.json.encode(found)):
        raise ValueError("it has a key twice or an unknown one, or is not written as this project writes it")
    return found
