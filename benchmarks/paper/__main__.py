"""Run the paper's studies, all or the named ones, and print a table for each; picture sheets go to docs/paper/."""

from __future__ import annotations

import sys

from benchmarks.paper.studies import STUDIES, Table


def main(names: list[str]) -> None:
    """Run studies by name; all without names."""
    unknown = set(names) - STUDIES.keys()
    if unknown:
        sys.exit(f"unknown study {sorted(unknown)[0]!r}; choose from {', '.join(STUDIES)}")
    for name in names or STUDIES:
        print(f"\n{name}\n\n{markdown(STUDIES[name]())}", flush=True)


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    head = list(table[0])
    rows = [head, ["---"] * len(head), *([row[key] for key in head] for row in table)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


if __name__ == "__main__":
    main(sys.argv[1:])
