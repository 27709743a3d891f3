"""Explains YAML errors: the place, how YAML reads the text, and what to write instead."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable

from recipe_compiler.ir.errors import Code, Place, Problem
from recipe_compiler.source.yaml_repair import misindented_line

LINE_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")  # as YAML counts lines

# Plain scalars that YAML 1.1 and YAML 1.2 read differently.
_YES_NO = re.compile(r"(?i:(yes|on|y)|(no|off|n))\Z")
_BASE_60 = re.compile(r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?\Z")
_UNDERSCORED = re.compile(r"[-+]?[0-9][0-9_]*_[0-9_]*(\.[0-9_]*)?\Z")
_OCTAL = re.compile(r"[-+]?0o?[0-7]+\Z")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+\Z")
_BINARY = re.compile(r"[-+]?0b[01_]+\Z")
_EXPONENT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+\Z")
_DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt ].*)?\Z")
FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*)([eE][-+][0-9]+)?\Z")


def explain(
    problem: str, context: str, opened: int | None, text: str, place: Place, parses: Callable[[str], bool]
) -> Problem:
    """The problem of a text that is not YAML.

    Args:
        problem: the YAML reader's message.
        context: the construct in which it found the problem.
        opened: the line at which the construct starts, counted from 1.
        text: the whole text.
        place: where reading stopped.
        parses: returns whether a text is YAML.
    """
    lines = LINE_BREAK.split(text)
    line = lines[place.line - 1] if place.line <= len(lines) else ""
    indentation = line[: len(line) - len(line.lstrip())]
    if "\t" in indentation:
        return Problem("a tab cannot indent YAML", place, "use spaces", Code.YAML_SYNTAX)
    wrong = (
        _odd_indentation(lines, place)
        or _open_quote(problem, context, opened, lines, place)
        or _key_without_colon(problem, opened, lines, place)
        or _unquoted_colour(context, opened, lines, place)
    )
    if not ("flow" in context and opened == place.line):  # within the brackets of one line, indentation has no effect
        wrong = wrong or _wrong_indentation(lines, place, parses)
    if wrong is not None:
        return wrong
    known = _known(problem, context, opened)
    if known is not None:
        return Problem(known[0], place, known[1], Code.YAML_SYNTAX)
    problem = (problem or "it cannot be read").replace("\n", " ")
    context = f", {context}".replace("\n", " ") if context else ""
    remedy = "look at the line above, too: a quote, a bracket or a `:` may be missing"
    return Problem(f"this is not valid YAML: {problem}{context}", place, remedy, Code.YAML_SYNTAX)


def _known(problem: str, context: str, line: int | None) -> tuple[str, str] | None:
    """What is wrong and the remedy, for common errors."""
    opened = f"line {line}" if line else "a line above"
    if "mapping values are not allowed" in problem:
        return "there is a second `: ` in this line", "quote a text that holds `: `, or start a new line"
    for kind, brackets in (("flow mapping", "{}"), ("flow sequence", "[]")):
        if kind in context and "<stream end>" in problem:
            return f"the `{brackets[0]}` of {opened} is not closed", f"add the `{brackets[1]}`"
        if kind in context and problem.startswith("expected ','"):
            what = f"a `,` is missing before this, or the `{brackets[0]}` of {opened} is not closed"
            return what, f"put `,` between entries, and `{brackets[1]}` after the last"
    if "escape" in problem:
        return f"a backslash in double quotes starts an escape, and this is not one ({problem})", "use single quotes"
    if "simple key" in context and "could not find expected ':'" in problem:
        return f"{opened} has no `: ` after its key", "write `key: value`, with a space after the colon"
    if "block collection" in context and problem.endswith("but found '?'"):
        return (
            "a key of a map is among the items of a list, with `-`",
            "write every entry as `name: ...`, or every entry with `- `",
        )
    if problem.endswith("but found '-'"):
        return (
            "an item of a list, with `-`, is among the keys of a map",
            "indent it below the key that it belongs to",
        )
    if problem.endswith(("but found '}'", "but found ']'")):
        return "this closes a bracket that is not open", "remove it"
    if "cannot start any token" in problem:
        return f"a value cannot start with this character ({problem})", "quote the text"
    return None


def _open_quote(problem: str, context: str, opened: int | None, lines: list[str], place: Place) -> Problem | None:
    """A quote that is never closed, or that is closed by a quote that was meant to open another text."""
    at, quote = None, ""
    if "quoted scalar" in context and "end of stream" in problem and opened and opened <= len(lines):
        starting = re.findall(r"(?:[:,\[{]|-|\A)\s*(['\"])", lines[opened - 1])
        at, quote = (opened, starting[-1]) if starting else (None, "")
    elif problem.endswith("but found '<scalar>'") and place.column > 1 and place.line <= len(lines):
        quote = lines[place.line - 1][place.column - 2 : place.column - 1]
        above = range(place.line - 1, 0, -1) if quote in ("'", '"') else ()
        starts = re.compile(rf"(?:[:,\[{{]|-)\s*{quote}")
        at = next((n for n in above if lines[n - 1].count(quote) % 2 and starts.search(lines[n - 1])), None)
    if at is None:
        return None
    start = re.search(rf"(?:[:,\[{{]|-|\A)\s*{quote}(?=[^{quote}]*\Z)", lines[at - 1])
    where = Place(place.file, at, start.end() if start else lines[at - 1].rindex(quote) + 1)
    return Problem(f"the quote opened on line {at} is never closed", where, "add the closing quote", Code.YAML_SYNTAX)


def _key_without_colon(problem: str, opened: int | None, lines: list[str], place: Place) -> Problem | None:
    """A key with no `:` after it, or with no space after the `:`, on the line of the key or on the one above."""
    line = lines[place.line - 1] if place.line <= len(lines) else ""
    if "mapping values are not allowed" in problem and ": " not in line[: place.column - 1]:
        above = (n for n in range(min(place.line - 1, len(lines)), 0, -1) if _is_entry(lines[n - 1]))
        number = next(above, None)
    else:
        number = opened if "could not find expected ':'" in problem else None
    if number is None or not 0 < number <= len(lines) or len(lines[number - 1]) > 200:
        return None  # the pattern below is slow on long lines
    words = re.match(r"\s*([A-Za-z_][\w.-]*) +[^\s:#][^:#]*\Z", lines[number - 1])
    if words and "mapping values" in problem and _column(line) == _column(lines[number - 1]):
        message, remedy = missing_colon(words[1], colon=False)
        return Problem(message, Place(place.file, number, words.end(1) + 1), remedy, Code.YAML_SYNTAX)
    bracket = key_before_bracket(lines[number - 1].strip())
    if bracket is not None:
        where = Place(place.file, number, _column(lines[number - 1]) + len(bracket[0]) + 1)
        message, remedy = missing_colon(*bracket)
        return Problem(message, where, remedy, Code.YAML_SYNTAX)
    found = re.match(r"(\s*(?:- )?[A-Za-z_][\w.-]*)(:?)(\S*)\s*(?:#.*)?\Z", lines[number - 1])
    if found is None or (found[3] and not found[2]) or (found[2] and not found[3]):
        return None
    where = Place(place.file, number, found.end(1) + 1)
    if found[2]:
        return Problem(f"line {number}: no space after the `:`", where, "put a space after the colon", Code.YAML_SYNTAX)
    return Problem(f"line {number}: a key needs a `:`", where, "write `key:` or `key: value`", Code.YAML_SYNTAX)


def key_before_bracket(text: str) -> tuple[str, bool] | None:
    """The key of a text such as `clock {fps: 10}` or `clock:{fps: 10}`, and whether the colon is there."""
    found = re.match(r"([A-Za-z_][\w.-]*)(:\s*| +)[{\[]", text)
    return (found[1], found[2] == ":") if found and found[2] in (":", " " * len(found[2])) else None


def missing_colon(key: str, colon: bool) -> tuple[str, str]:
    """What is wrong with a key that has no `: `, and the remedy; `colon`: whether the colon alone is there."""
    what = "a space is missing after `{}:`" if colon else "a `:` and a space are missing after `{}`"
    return what.format(key[:40]), f"write `{key[:40]}: `"


def name_of(character: str) -> str:
    """A character as messages name it, such as `U+00A0 (no-break space)`."""
    name = unicodedata.name(character, "")
    return f"U+{ord(character):04X}" + (f" ({name.lower()})" if name else "")


def _is_entry(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _unquoted_colour(context: str, opened: int | None, lines: list[str], place: Place) -> Problem | None:
    """A colour such as `#ff0000` without quotes within brackets: it starts a comment, which hides the bracket's end."""
    if "flow" not in context or not opened:
        return None
    for number in range(opened, min(place.line, len(lines)) + 1):
        found = re.search(r"[:,\[]\s+(#[0-9A-Fa-f]{3,8})\b", lines[number - 1])
        if found:
            where = Place(place.file, number, found.start(1) + 1)
            what = f"a `#` after a space starts a comment, which hides the rest of line {number}"
            return Problem(what, where, f'quote the colour: "{found[1]}"', Code.YAML_SYNTAX)
    return None


def _interrupted_map(lines: list[str], place: Place) -> Problem | None:
    """A line that starts too far left, so that the lines after it no longer belong to the map above.

    The wrong line is that one and not the line of the place: the latter starts as the entries of the map above do.
    """
    if place.line > len(lines) or not _is_entry(lines[place.line - 1]):
        return None
    indent = _column(lines[place.line - 1])
    entries = [n for n in range(1, place.line) if _is_entry(lines[n - 1])]
    wrong = next((n for n in reversed(entries) if _column(lines[n - 1]) < indent), None)
    if wrong is None:
        return None
    column = _column(lines[wrong - 1])
    above = next((n for n in reversed(entries) if n < wrong and _column(lines[n - 1]) <= column), None)
    if above is None or _column(lines[above - 1]) != column:
        return None
    key = re.match(r"\s*([A-Za-z_][\w.-]*):\s*(#.*)?\Z", lines[above - 1])
    inside = [_column(lines[n - 1]) for n in entries if above < n < wrong]
    if key is None or (inside and inside[0] != indent) or (wrong != entries[-1] and _opens_map(lines, wrong, indent)):
        return None
    if not re.match(r"\s*[A-Za-z_][\w.-]*:( |\Z)", lines[wrong - 1]):
        return None
    what = (
        f"wrong indentation: line {wrong} ends the map `{key[1]}` of line {above}, but line {place.line} continues it"
    )
    remedy = f"if line {wrong} belongs to `{key[1]}`, start it with {_spaces(indent)}"
    return Problem(what, Place(place.file, wrong, column + 1), remedy, Code.YAML_SYNTAX)


def _opens_map(lines: list[str], number: int, indent: int) -> bool:
    """Whether the entries below a line start in column `indent`."""
    below = next((line for line in lines[number:] if _is_entry(line)), "")
    return _column(below) == indent


def _wrong_indentation(lines: list[str], place: Place, parses: Callable[[str], bool]) -> Problem | None:
    """The one line with which the text is YAML if it is indented as another entry of its map or list.

    Without such a line, a line that differs in its column from those about it.
    """
    found, interrupts = misindented_line(lines, place.line, parses), _interrupted_map(lines, place)
    if interrupts is not None and interrupts.place is not None and found and found.line == interrupts.place.line:
        return interrupts
    if found is None:
        return interrupts or _indentation(lines, place)
    first, second = sorted((found.line, found.beside))
    kind = "list" if found.is_list else "map"
    columns = {found.line: _column(lines[found.line - 1]), found.beside: found.spaces}
    what = (
        f"wrong indentation: lines {first} and {second} belong to one {kind}, and start with"
        f" {columns[first]} and {_spaces(columns[second])}"
    )
    start = Place(place.file, found.line, _column(lines[found.line - 1]) + 1)
    remedy = f"give them the same indentation: start line {found.line} with {_spaces(found.spaces)}"
    return Problem(what, start, remedy, Code.YAML_SYNTAX)


def _indentation(lines: list[str], place: Place) -> Problem | None:
    """What is wrong with a line that starts in a column where no map or list above it does."""
    own = lines[place.line - 1] if place.line <= len(lines) else ""
    indent = _column(own)
    open_columns: dict[int, int] = {}  # column -> line of the last entry that starts there, of open maps and lists
    last = ""
    for number, line in enumerate(lines[: place.line - 1], 1):
        if not _is_entry(line):
            continue
        column = _column(line)
        open_columns = {c: n for c, n in open_columns.items() if c < column} | {column: number}
        last = line.strip().split(" #")[0].rstrip()
    deeper = not open_columns or indent > max(open_columns)
    if not open_columns or indent in open_columns or (deeper and re.search(r"[:|>,{\[]\Z|\A-", last)):
        return None
    if not re.match(r"-( |\Z)|[^\s#].*:( |\Z)", own.strip()):
        return None
    near = min(open_columns, key=lambda column: (abs(column - indent), -column))
    beside = open_columns[near]
    what = (
        f"wrong indentation: lines {beside} and {place.line} belong to one map, and start with {near} and"
        f" {_spaces(indent)}"
    )
    wrong, right = (place.line, near)
    if _siblings(lines, beside, indent, min(near, indent)) > _siblings(lines, beside, near, min(near, indent)):
        wrong, right = beside, indent
    start = Place(place.file, wrong, _column(lines[wrong - 1]) + 1)
    remedy = f"give them the same indentation: start line {wrong} with {_spaces(right)}"
    return Problem(what, start, remedy, Code.YAML_SYNTAX)


def _odd_indentation(lines: list[str], place: Place) -> Problem | None:
    """A character in the indentation that looks like a space, on the line of the place or on one of the two above."""
    for number in range(place.line, max(0, place.line - 3), -1):
        line = lines[number - 1] if number <= len(lines) else ""
        at = _column(line)
        if line[at : at + 1] != "\t" and line[at : at + 1].isspace():
            message = f"the character {name_of(line[at])} cannot indent YAML"
            return Problem(message, Place(place.file, number, at + 1), "use spaces", Code.YAML_SYNTAX)
    return None


def _siblings(lines: list[str], among: int, column: int, least: int) -> int:
    """How many entries start in a column, of the lines about line `among` that start in column `least` or further."""
    first, after = among - 1, among
    while first > 0 and (not _is_entry(lines[first - 1]) or _column(lines[first - 1]) >= least):
        first -= 1
    while after < len(lines) and (not _is_entry(lines[after]) or _column(lines[after]) >= least):
        after += 1
    return sum(_is_entry(line) and _column(line) == column for line in lines[first:after])


def _column(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _spaces(number: int) -> str:
    return f"{number} space{'' if number == 1 else 's'}"


def ambiguity(text: str) -> tuple[str, str] | None:
    """How YAML reads a plain scalar about which its versions disagree, and the remedy; None if they agree."""
    if len(text) > 100:  # not a number, and some of these patterns are slow on long text
        return None
    short = text[:40]
    if match := _YES_NO.match(text):
        truth = "true" if match[1] else "false"
        return f"YAML turns the bare word {short} into {truth}", f'write {truth}, or quote it: "{short}"'
    if _BASE_60.match(text):
        return f"YAML turns the bare {short} into a number in base 60{_base_60(text)}", f'quote it: "{short}"'
    if _DATE.match(text):
        return f"YAML turns the bare {short} into a date", f'quote it: "{short}"'
    if _UNDERSCORED.match(text):
        digits = short.replace("_", "")
        return f"YAML turns the bare {short} into the number {digits}", f'write {digits}, or quote it: "{short}"'
    if _OCTAL.match(text) and text not in {"0", "-0", "+0"}:
        number = int(text.replace("0o", "0").replace("o", "")[-20:], 8)
        return f"YAML turns the bare {short} into the octal number {number}", f'write {number}, or quote it: "{short}"'
    if _LEADING_ZERO.match(text):
        return f"YAML reads the bare {short} as a number or as text", f'drop the leading zero, or quote it: "{short}"'
    if _BINARY.match(text):
        return f"YAML turns the bare {short} into a binary number", f'write it in decimal, or quote it: "{short}"'
    if _EXPONENT.match(text) and not FLOAT.match(text):
        exact = float(text)
        plain = f": {exact:.0f}" if exact.is_integer() and abs(exact) < 1e15 else ""
        return f"YAML reads the bare {short} as a number or as text", f"write the number without exponent{plain}"
    return None


def _base_60(text: str) -> str:
    parts = text.lstrip("+-").split(":")
    if len(text) > 12 or not all(part.isdigit() for part in parts):
        return ""
    total = 0
    for part in parts:
        total = total * 60 + int(part)
    return f", {total}"
