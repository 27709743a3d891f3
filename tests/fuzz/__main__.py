"""`python -m tests.fuzz TARGET [libFuzzer's options]`: fuzz one target with atheris, guided by coverage.

A case may take 60 s and 1 GiB; `tests/runtime/dataset/test_hostile_documents.py` tests the largest documents.

A finding is written to the current folder as `crash-...`. Fix the bug and move the file to tests/fuzz/findings/ as
`TARGET-WHAT`; the quick tests then include it. Without a target, this prints the names of targets.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["recipe_compiler", "recipe_runtime", "yaml", "zipfile", "json"]):
    from tests.fuzz.targets import TARGETS


def main() -> None:
    if len(sys.argv) < 2:
        print(*TARGETS)
        return
    target = TARGETS[sys.argv.pop(1)]
    with tempfile.TemporaryDirectory(prefix="recipe-corpus-") as folder:
        for number, seed in enumerate(target.seeds()):
            (Path(folder) / str(number)).write_bytes(seed)
        bounds = ["-timeout=60", "-rss_limit_mb=1024", "-max_len=200000"]
        with tempfile.NamedTemporaryFile("w", prefix="recipe-words-") as words:
            words.writelines(f'"{_escaped(word)}"\n' for word in target.words())
            words.flush()
            options = [*bounds, f"-dict={words.name}"] if target.json else bounds
            atheris.Setup([sys.argv[0], folder, *options, *sys.argv[1:]], target.feed)
            atheris.Fuzz()


def _escaped(word: bytes) -> str:
    """Return a word in the syntax of libFuzzer's dictionaries."""
    return "".join(chr(b) if 32 <= b < 127 and chr(b) not in '"\\' else f"\\x{b:02x}" for b in word)


main()
