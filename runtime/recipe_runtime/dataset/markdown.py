"""Escapes untrusted text, such as a recipe's description, for Markdown.

The result renders as plain paragraphs, without HTML, images, links, headings, lists, tables, code or emphasis, in
CommonMark and in GitHub's dialect. The text itself is unchanged, except for invisible characters.
"""

from __future__ import annotations

import re

_WORD_JOINER = "\u2060"  # invisible; an address that contains it is not turned into a link
_SIGNS = re.compile(r"[\\`*\[\]<>&!#|~$^{}]|(?<![^\W_])_|_(?![^\W_])")  # an underscore within a word has no meaning
_STARTS = re.compile(r"^([-+=:])", re.MULTILINE)  # lists, underlines of headings, rules, table rows
_NUMBERED = re.compile(r"^(\d{1,9})([.)])", re.MULTILINE)
_ADDRESSES = re.compile(r"(?<!\\):(?=//)|(?<=\bwww)\.", re.IGNORECASE)  # which GitHub turns into links


def paragraphs(text: str) -> str:
    """Return the text as paragraphs, separated at empty lines, without indentation."""
    lines = [_visible(line) for line in re.split(r"\r\n|\r|\n", text)]
    blocks = re.split(r"\n{2,}", "\n".join(lines).strip("\n"))
    return "\n\n".join(_escaped(block) for block in blocks)


def one_line(text: str) -> str:
    """Return the text as a single line, for a heading or a table cell."""
    return _escaped(_visible(re.sub(r"[\r\n]+", " ", text)))


def _visible(line: str) -> str:
    """Strip a line, and replace tabs by spaces and unprintable characters by U+FFFD."""
    shown = "".join(sign if sign.isprintable() else "\ufffd" for sign in line.replace("\t", " "))
    return " ".join(shown.split())


def _escaped(text: str) -> str:
    text = _SIGNS.sub(r"\\\g<0>", text)
    text = _NUMBERED.sub(r"\1\\\2", _STARTS.sub(r"\\\1", text))
    return _ADDRESSES.sub(r"\\\g<0>", text).replace("@", f"@{_WORD_JOINER}")
