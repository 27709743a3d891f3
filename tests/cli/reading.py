"""Parse what the command line prints on standard error."""

from __future__ import annotations

import re


def problems(stderr: str) -> list[str]:
    """Return errors and warnings as lines `place: message; help`, warnings prefixed by `warning: `, and other lines."""
    found: list[list[str]] = []
    for line in stderr.splitlines():
        head = re.match(r"(error|warning)\[[a-z-]+\]: (.*)", line)
        if head:
            found.append(["warning: " if head[1] == "warning" else "", "", head[2], ""])
        elif found and (place := re.match(r" *--> (.*)", line)):
            found[-1][1] = f"{place[1]}: "
        elif found and line.startswith("help: "):
            found[-1][3] = f"; {line[6:]}"
        elif line and not re.match(r" *\d* \||note: ", line):
            found.append(["", "", line, ""])
    return ["".join(parts) for parts in found]


def one_line_each(stderr: str, warnings: bool = True) -> str:
    """Return these lines as text, optionally without warnings."""
    lines = problems(stderr)
    return "".join(f"{line}\n" for line in lines if warnings or not line.startswith("warning: "))
