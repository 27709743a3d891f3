"""Text from outside, such as a recipe's description, as Markdown that shows it and nothing else.

What comes out is plain paragraphs: no HTML, image, link, heading, list, table, code or emphasis, in CommonMark and in
GitHub's dialect. The text itself is kept, but for characters that cannot be seen.
"""

from __future__ import annotations

import re

_WORD_JOINER = "\u2060"  # invisible; an address with it is no address
_SIGNS = re.compile(r"[\\`*\[\]<>&!#|~$^{}]|(?<![^\W_])_|_(?![^\W_])")  # an underscore within a word means nothing
_STARTS = re.compile(r"^([-+=:])", re.MULTILINE)  # lists, underlines of headings, rules, rows of tables
_NUMBERED = re.compile(r"^(\d{1,9})([.)])", re.MULTILINE)
_ADDRESSES = re.compile(r":(?=//)|(?<=\bwww)\.", re.IGNORECASE)  # which GitHub turns into links


def paragraphs(text: str) -> str:
    """The text in paragraphs, as it is divided by empty lines, without indentation."""
    lines = [_visible(line) for line in re.split(r"\r\n|\r|\n", text)]
    blocks = re.split(r"\n{2,}", "\n".join(lines).strip("\n"))
    return "\n\n".join(_escaped(block) for block in blocks)


def one_line(text: str) -> str:
    """The text in a single line, for a heading or a cell of a table."""
    return _escaped(_visible(re.sub(r"[\r\n]+", " ", text)))


def _visible(line: str) -> str:
    """A line without space at its ends; characters that are not printed become U+FFFD, a tab a space."""
    shown = "".join(sign if sign.isprintable() else "\ufffd" for sign in line.replace("\t", " "))
    return " ".join(shown.split())


def _escaped(text: str) -> str:
    text = _SIGNS.sub(r"\\\g<0>", text)
    text = _NUMBERED.sub(r"\1\\\2", _STARTS.sub(r"\\\1", text))
    return _ADDRESSES.sub(r"\\\g<0>", text).replace("@", f"@{_WORD_JOINER}")
