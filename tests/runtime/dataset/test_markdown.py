"""Untrusted text appears in a dataset's README.md as plain text without markup; markdown-it-py is the oracle."""

from __future__ import annotations

import re
import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from markdown_it.token import Token
from recipe_runtime.dataset.card import card
from recipe_runtime.dataset.markdown import one_line, paragraphs

from tests.runtime.fakes import dataset_plan

PARSER = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])
PLAIN = {"paragraph_open", "paragraph_close", "inline"}
SIGNS = st.text(st.sampled_from("\\`*_{}[]()<>#+-.!|~&:=@/ \n\tab1\"'$^;"), max_size=40)
TEXTS = st.one_of(SIGNS, st.text(max_size=40))
HOSTILE = (
    "<script>alert(1)</script>",
    "![seen](https://tracker.example/1.png)",
    "[a link](https://evil.example)",
    "<https://evil.example>",
    "text\n\n# A heading\n\nunder it",
    "A heading\n===\nanother\n---",
    "```\nwhat follows is code",
    "~~~\nwhat follows is code",
    "    indented code",
    "a\n\n\tindented code",
    "- a list\n+ another\n1. a third\n2) a fourth",
    "> a quotation",
    "| a | b |\n|---|---|\n| c | d |",
    "[name]: https://evil.example\n\n[name]",
    "&lt;b&gt; &#60;",
    "a  \nhard break\\\nanother",
    "***",
    "<!-- the rest is a comment",
    "\u202eback to front",
    "a\rb\u2028c\x85d",
    "\\",
    "a_b _c_ __d__",
)


def inline(tokens: list[Token]) -> list[Token]:
    return [child for token in tokens for child in token.children or ()]


def words(text: str) -> list[str]:
    """Return the words of a text as they must appear."""
    return "".join("\ufffd" if hidden(sign) else sign for sign in text).split()


def hidden(sign: str) -> bool:
    """Return whether a character is shown as U+FFFD; one that this Python's Unicode does not have yet is shown."""
    unassigned = unicodedata.category(sign) == "Cn" and sign < "\U00040000"
    return not sign.isprintable() and sign not in "\r\n\t" and (not unassigned or _is_noncharacter(sign))


def _is_noncharacter(sign: str) -> bool:
    return ord(sign) & 0xFFFE == 0xFFFE or "\ufdd0" <= sign <= "\ufdef"


def test_characters_do_not_depend_on_the_unicode_version_of_python() -> None:
    """Python 3.10 has Unicode 13, Python 3.11 has 14: a README with one of 2021 differed between the two."""
    assert one_line("a \U0001fae0 \U0001fa77 \u0378 b") == "a \U0001fae0 \U0001fa77 \u0378 b"
    shown = "".join(one_line(f"a{chr(code)}b") for code in range(0x80, 0x110000, 7) if not hidden(chr(code)))
    assert "\ufffd" not in shown.replace("a\ufffdb", "")


@given(TEXTS)
@example("\n\n".join(HOSTILE))
@example("://")
def test_paragraphs_are_plain_text(text: str) -> None:
    tokens = PARSER.parse(paragraphs(text))
    assert {token.type for token in tokens} <= PLAIN
    assert {token.type for token in inline(tokens)} <= {"text", "softbreak"}
    shown = " ".join(token.content or " " for token in inline(tokens))
    assert "".join(shown.split()).replace("\u2060", "") == "".join(words(text)).replace("\u2060", "\ufffd")


@pytest.mark.slow
@given(TEXTS)
@example("a | b")
def test_text_in_a_table_cell_stays_in_the_cell(text: str) -> None:
    tokens = PARSER.parse(f"| head | other |\n|---|---|\n| {one_line(text)} | last |")
    assert [token.type for token in tokens].count("td_open") == 2
    assert {token.type for token in inline(tokens)} <= {"text"}


@pytest.mark.parametrize("text", ["https://evil.example", "www.evil.example", "WWW.evil.example", "me@evil.example"])
def test_an_address_is_no_link_in_githubs_dialect(text: str) -> None:
    """GitHub links addresses that contain a literal `://`, `www.` or a letter after `@`."""
    assert not re.search(r"(?<!\\)://|\bwww\.|@\w", paragraphs(text), re.IGNORECASE)


def test_plain_prose_is_not_escaped() -> None:
    prose = "Two pedestrians pass (listing 1): 3.5 m/s, weather_sweep; it's a 3-D scene, isn't it?"
    assert paragraphs(prose) == prose


def test_a_description_cannot_break_out_of_its_paragraph_of_the_card() -> None:
    plain = PARSER.parse(card(dataset_plan(description="Boxes."), "tiny@sha256:0", ()))
    for text in HOSTILE:
        tokens = PARSER.parse(card(dataset_plan(description=text), "tiny@sha256:0", ()))
        rest = [(t.type, t.content) for t in tokens if t.type not in PLAIN]
        assert rest == [(t.type, t.content) for t in plain if t.type not in PLAIN], text
        assert "html" not in " ".join(t.type for t in inline(tokens))


def test_names_are_escaped_in_the_card() -> None:
    tokens = PARSER.parse(card(dataset_plan(recipe="<b>*x*</b>"), "x@sha256:0", ()))
    assert tokens[1].content == r"\<b\>\*x\*\</b\>"
    assert {token.type for token in tokens[1].children or ()} <= {"text"}
