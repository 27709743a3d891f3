"""Explains YAML errors: the place, how YAML reads the text, and what to write instead."""

from __future__ import annotations

import re
import unicodedata

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.ir.plurals import count

LINE_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")  # as YAML counts lines
FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*)([eE][-+][0-9]+)?\Z")

_AMBIGUOUS = (  # plain scalars that YAML 1.1 and 1.2 read differently: pattern, how YAML reads them, what to write
    (r"(?i:yes|on|y)\Z", "turns the bare word {} into true", 'write true, or quote it: "{}"'),
    (r"(?i:no|off|n)\Z", "turns the bare word {} into false", 'write false, or quote it: "{}"'),
    (r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?\Z", "turns the bare {} into a number in base 60", 'quote it: "{}"'),
    (r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt ].*)?\Z", "turns the bare {} into a date", 'quote it: "{}"'),
    (
        r"[-+]?[0-9][0-9_]*_[0-9_]*(\.[0-9_]*)?\Z",
        "turns the bare {} into a number without the `_`",
        'write it without the `_`, or quote it: "{}"',
    ),
    (
        r"[-+]?0o?[0-7]+\Z",
        "turns the bare {} into an octal number",
        'write it in decimal, without the 0, or quote it: "{}"',
    ),
    (r"[-+]?0[0-9]+\Z", "reads the bare {} as a number or as text", 'drop the leading zero, or quote it: "{}"'),
    (r"[-+]?0b[01_]+\Z", "turns the bare {} into a binary number", 'write it in decimal, or quote it: "{}"'),
    (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+\Z",
        "reads the bare {} as a number or as text",
        "write the number without exponent",
    ),
)
_KNOWN = (  # in the reader's context, in its problem, what is wrong, the remedy; the first that fits
    ("quoted scalar", "end of stream", "the quote opened on line {line} is never closed", "add the closing quote"),
    ("flow mapping", "<stream end>", "the `{` of line {line} is not closed", "add the `}`"),
    ("flow sequence", "<stream end>", "the `[` of line {line} is not closed", "add the `]`"),
    (
        "flow mapping",
        "expected ','",
        "a `,` is missing before this, or the `{` of line {line} is not closed",
        "put `,` between entries, and `}` after the last",
    ),
    (
        "flow sequence",
        "expected ','",
        "a `,` is missing before this, or the `[` of line {line} is not closed",
        "put `,` between entries, and `]` after the last",
    ),
    (
        "",
        "mapping values are not allowed",
        "there is a second `: ` in this line",
        "quote a text that holds `: `, or start a new line",
    ),
    (
        "",
        "escape",
        "a backslash in double quotes starts an escape, and this is not one ({problem})",
        "use single quotes",
    ),
    (
        "simple key",
        "could not find expected ':'",
        "line {line} has no `: ` after its key",
        "write `key: value`, with a space after the colon",
    ),
    (
        "block collection",
        "but found '?'",
        "a key of a map is among the items of a list, with `-`",
        "write every entry as `name: ...`, or every entry with `- `",
    ),
    (
        "",
        "but found '-'",
        "an item of a list, with `-`, is among the keys of a map",
        "indent it below the key that it belongs to",
    ),
    (
        "",
        "but found '<scalar>'",
        "text follows a closing quote",
        "look for a quote that is not closed, in this line or above it",
    ),
    (
        "",
        "but found '<block",
        "wrong indentation: this line starts further right than the entry above it",
        "start the entries of one map or list with the same number of spaces",
    ),
    ("", "but found '}'", "this closes a bracket that is not open", "remove it"),
    ("", "but found ']'", "this closes a bracket that is not open", "remove it"),
    ("", "cannot start any token", "a value cannot start with this character ({problem})", "quote the text"),
    (
        "",
        "",
        "this is not valid YAML: {problem}",
        "look at the line above, too: a quote, a bracket or a `:` may be missing",
    ),
)


def explain(problem: str, context: str, opened: Place | None, text: str, place: Place) -> Problem:
    """The problem of a text that is not YAML.

    Args:
        problem: the YAML reader's message.
        context: the construct in which it found the problem.
        opened: where that construct starts.
        text: the whole text.
        place: where reading stopped.
    """
    lines = LINE_BREAK.split(text)
    wrong = _white_space(lines, place)
    if "flow" in context and opened:
        wrong = wrong or _unquoted_colour(lines, opened, place)
    elif "quoted" not in context:
        wrong = wrong or _key_without_colon(problem, opened, lines, place) or _indentation(lines, place)
    if wrong is not None:
        return wrong
    message, remedy = next(row[2:] for row in _KNOWN if row[0] in context and row[1] in problem)
    if opened and "quoted scalar" in context and "end of stream" in problem:
        place = opened
    line = str(opened.line if opened else place.line)
    message = message.replace("{line}", line).replace("{problem}", problem.replace("\n", " "))
    return Problem(message, place, remedy, Code.YAML_SYNTAX)


def ambiguity(text: str) -> tuple[str, str] | None:
    """How YAML reads a plain scalar about which its versions disagree, and the remedy; None if they agree."""
    if len(text) > 100 or FLOAT.match(text):  # (long text is no number, and some of the patterns are slow on it)
        return None
    for pattern, reading, remedy in _AMBIGUOUS:
        if re.match(pattern, text):
            return f"YAML {reading.format(text[:40])}", remedy.format(text[:40])
    return None


def missing_colon(text: str) -> tuple[str, str] | None:
    """What is wrong with a key that has no `: `, such as `clock {fps: 10}`, and the remedy; None if it has one."""
    found = re.match(r"(?:- )?([A-Za-z_][\w.-]*)(:?)( *)([^\s:#]?)", text)
    if found is None:
        return None
    key, colon, space, rest = found[1][:40], found[2], found[3], found[4]
    if colon and rest and not space:
        return f"a space is missing after `{key}:`", f"write `{key}: `"
    if not colon and rest and space:
        return f"a `:` and a space are missing after `{key}`", f"write `{key}: `"
    return None if colon or rest else (f"a `:` is missing after `{key}`", f"write `{key}:`")


def name_of(character: str) -> str:
    """A character as messages name it, such as `U+00A0 (no-break space)`."""
    name = unicodedata.name(character, "")
    return f"U+{ord(character):04X}" + (f" ({name.lower()})" if name else "")


def _white_space(lines: list[str], place: Place) -> Problem | None:
    """A tab, or a character that looks like a space, in the indentation of the line or of one of the two above."""
    for number in range(min(place.line, len(lines)), max(0, place.line - 3), -1):
        line = lines[number - 1]
        at = _column(line)
        if line[at : at + 1].isspace() and (line[at] != "\t" or number == place.line):
            what = "a tab" if line[at] == "\t" else f"the character {name_of(line[at])}"
            start = Place(place.file, number, at + 1)
            return Problem(f"{what} cannot indent YAML", start, "use spaces", Code.YAML_SYNTAX)
    return None


def _unquoted_colour(lines: list[str], opened: Place, place: Place) -> Problem | None:
    """A colour such as `#ff0000` without quotes within brackets: it starts a comment, which hides the bracket's end."""
    for number, line in enumerate(lines[opened.line - 1 : place.line], opened.line):
        found = re.search(r"[:,\[]\s+(#[0-9A-Fa-f]{3,8})\b", line)
        if found:
            where = Place(place.file, number, found.start(1) + 1)
            what = f"a `#` after a space starts a comment, which hides the rest of line {number}"
            return Problem(what, where, f'quote the colour: "{found[1]}"', Code.YAML_SYNTAX)
    return None


def _key_without_colon(problem: str, opened: Place | None, lines: list[str], place: Place) -> Problem | None:
    """A key with no `: ` after it, on the line that the reader names or on the one above."""
    number = opened.line if opened and "could not find expected ':'" in problem else 0
    if "mapping values are not allowed" in problem and ": " not in lines[place.line - 1][: place.column - 1]:
        number = next((n for n in range(place.line - 1, 0, -1) if _is_entry(lines[n - 1])), 0)
    words = missing_colon(lines[number - 1].strip()) if number else None
    if words is None:
        return None
    start = Place(place.file, number, _column(lines[number - 1]) + 1)
    return Problem(words[0], start, words[1], Code.YAML_SYNTAX)


def _indentation(lines: list[str], place: Place) -> Problem | None:
    """A line that starts in a column where no map or list above it does."""
    own = lines[place.line - 1] if place.line <= len(lines) else ""
    indent = _column(own)
    open_columns: dict[int, int] = {}  # column -> line of the last entry that starts there, of open maps and lists
    last = ""
    for number, line in enumerate(lines[: place.line - 1], 1):
        if _is_entry(line):
            column = _column(line)
            items = re.match(r" *(?:- +)*", line)  # the key in `- key: value` starts a map, too
            inner = items.end() if items else column
            open_columns = {c: n for c, n in open_columns.items() if c < column} | {column: number, inner: number}
            last = line.strip().split(" #")[0].rstrip()
    deeper = not open_columns or indent > max(open_columns)
    if not open_columns or indent in open_columns or (deeper and re.search(r"[:|>,{\[]\Z|\A-\Z", last)):
        return None
    if not re.match(r"-( |\Z)|[^\s#].*:( |\Z)", own.strip()):
        return None
    near = min(open_columns, key=lambda column: (abs(column - indent), -column))
    kind = "list" if own.strip().startswith("-") else "map"
    both = f"lines {open_columns[near]} and {place.line} belong to one {kind}"
    what = f"wrong indentation: {both}, and start with {near} and {count(indent, 'space')}"
    remedy = "start both with the same number of spaces"
    return Problem(what, Place(place.file, place.line, indent + 1), remedy, Code.YAML_SYNTAX)


def _is_entry(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _column(line: str) -> int:
    return len(line) - len(line.lstrip(" "))
