"""Escapes untrusted text, such as a recipe's description, for Markdown.

The result renders as plain paragraphs, without HTML, images, links, headings, lists, tables, code or emphasis, in
CommonMark and in GitHub's dialect. The text itself is unchanged, except for invisible characters.
"""

from __future__ import annotations

import re

_WORD_JOINER = "\u2060"  # invisible; an address that contains it is not turned into a link
# Controls, formats, separators, surrogates and private use. `str.isprintable` also rejects characters newer than
# Python's Unicode tables, so its result depends on the version of Python.
_HIDDEN = re.compile(
    "[\x00-\x1f\x7f-\xa0\xad\u0600-\u0605\u061c\u06dd\u070f\u0890\u0891\u08e2\u1680\u180e\u2000-\u200f\u2028-\u202f"
    "\u205f-\u2064\u2066-\u206f\u3000\ud800-\uf8ff\ufdd0-\ufdef\ufeff\ufff9-\ufffb\ufffe\uffff\U000110bd\U000110cd"
    "\U00013430-\U0001343f\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U0001fffe\U0001ffff\U0002fffe\U0002ffff"
    "\U0003fffe-\U000e00ff\U000e01f0-\U0010ffff]"
)
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


def code_block(text: str) -> str:
    """Return the text as an indented block of code, in which it has no meaning as Markdown."""
    lines = re.split(r"\r\n|\r|\n", text.strip("\r\n"))
    shown = (_HIDDEN.sub("\ufffd", line.replace("\t", "    ")).rstrip(" ") for line in lines)
    return "\n".join(f"    {line}".rstrip(" ") for line in shown)


def _visible(line: str) -> str:
    """Strip a line, and replace tabs by spaces and unprintable characters by U+FFFD."""
    return " ".join(_HIDDEN.sub("\ufffd", line.replace("\t", " ")).split())


def _escaped(text: str) -> str:
    text = _SIGNS.sub(r"\\\g<0>", text)
    text = _NUMBERED.sub(r"\1\\\2", _STARTS.sub(r"\\\1", text))
    return _ADDRESSES.sub(r"\\\g<0>", text).replace("@", f"@{_WORD_JOINER}")
