"""Run the paper's studies, all or the named ones, print a table for each, and write it and a sheet into docs/paper/.

    python -m benchmarks.paper              # all studies
    python -m benchmarks.paper insertion
    python -m benchmarks.paper --check      # write nothing; exit with 1 if a page or a sheet is outdated

The tables and sheets of docs/paper/ are not edited by hand.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.pages import markdown, table_of, write_table
from benchmarks.paper import sheets
from benchmarks.paper.studies import STUDIES, Measured

PAGES = Path(__file__).parents[2] / "docs" / "paper"


def main(arguments: list[str], pages: Path = PAGES) -> int:
    """Run studies by name, all without names, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(STUDIES)}")
    parser.add_argument("--check", action="store_true", help="compare with pages and sheets, and write nothing")
    options = parser.parse_args(arguments)
    unknown = set(options.names) - STUDIES.keys()
    if unknown:
        parser.error(f"unknown study {sorted(unknown)[0]!r}; choose from {', '.join(STUDIES)}")
    outdated = []
    for name in options.names or STUDIES:
        try:
            measured = STUDIES[name]()
        except ModuleNotFoundError as error:
            sys.exit(f"{name}: {error}")
        print(f"\n{name}\n\n{markdown(measured.table)}", flush=True)
        if options.check:
            outdated += differences(name, measured, pages)
        else:
            write_table(pages / f"{name}.md", command(name), measured.table)
            sheets.save(measured.sheet, pages / f"{name}.jpg")
    for message in outdated:
        print(message, file=sys.stderr)
    return 1 if outdated else 0


def command(name: str) -> str:
    """Return the command that measures a study, as its page names it."""
    return f"python -m benchmarks.paper {name}"


def differences(name: str, measured: Measured, pages: Path) -> list[str]:
    """Return which of the table and the sheet of a study differ from what was measured."""
    found = []
    if table_of(pages / f"{name}.md", command(name)) != markdown(measured.table):
        found.append(f"{pages / name}.md: the table differs from what was measured")
    with tempfile.TemporaryDirectory() as folder:
        sheets.save(measured.sheet, Path(folder) / "sheet.jpg")
        if (Path(folder) / "sheet.jpg").read_bytes() != (pages / f"{name}.jpg").read_bytes():
            found.append(f"{pages / name}.jpg: the sheet differs from what was rendered")
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
