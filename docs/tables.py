"""Write the generated parts of the documentation: `make tables`.

A page marks such a part with the comments `<!-- generated: NAME -->` and `<!-- end -->`: each on a line of its own for
a block, or both within a paragraph. `PARTS` has a function for each name, which returns the text from what the code
declares. `tests/test_tables_of_docs.py` fails if a page is not current.
"""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path

from recipe_compiler.ir.modalities import CHOICES, KINDS, MODALITIES
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.library import towns, weather
from recipe_compiler.schema.weather import Preset
from recipe_runtime.modalities import declared
from recipe_runtime.transfer import formats

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
_PART = re.compile(r"(<!-- generated: ([a-z_]+) -->)(.*?)(<!-- end -->)", re.DOTALL)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown; cells may contain Markdown."""
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])


def code(names: Iterable[object]) -> str:
    """Return names as code, separated by commas."""
    return ", ".join(f"`{name}`" for name in names)


def paragraph(text: str, indent: str = "") -> str:
    """Return a text broken into lines of at most 120 characters; all but the first have the indent."""
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False, subsequent_indent=indent)


def renewed(text: str) -> str:
    """Return the text of a page with all of its generated parts renewed.

    Raises:
        KeyError: the page marks a part that `PARTS` lacks.
    """
    return _PART.sub(_filled, text)


def _filled(found: re.Match[str]) -> str:
    start, name, old, end = found.groups()
    gap = "\n\n" if old.startswith("\n") else ""
    return f"{start}{gap}{PARTS[name]()}{gap}{end}"


def presets() -> str:
    """Return a paragraph with the names of all presets."""
    return paragraph(f"Presets, as of CARLA 0.9.16: {code(weather.PRESETS)}.")


def weather_parameters() -> str:
    """Return the table of weather parameters; the defaults are those of a recipe without weather."""
    default = weather.preset(Preset.model_fields["preset"].default)
    rows = ((f"`{n}`", f"{p.low:,} to {p.high:,}", f"{default[n]:g}", p.effect) for n, p in PARAMETERS.items())
    return table(("parameter", "range", "default", "effect on a picture"), rows)


def town_table() -> str:
    """Return the table of towns with their parameters."""

    def parameters(name: str) -> str:
        return "; ".join(
            f"`{key}`: {p.description}, {p.low} to {p.high}, `{json.dumps(p.default)}`"
            for key, p in towns.TOWNS[name].PARAMETERS.items()
        )

    rows = ((f"`{name}`", towns.TOWNS[name].SUMMARY, parameters(name)) for name in towns.NAMES)
    return table(("town", "content", "parameters, with range and default"), rows)


def modality_names() -> str:
    """Return the names of all modalities."""
    return code(MODALITIES)


def modalities() -> str:
    """Return the table of modalities, their arrays and files."""
    rows = []
    for name, kind in KINDS.items():
        made = declared(name)
        shape = "[H, W]" if made.channels == 1 else f"[H, W, {made.channels}]"
        files = "; ".join(f"`.{form.ending}`: {form.help}" for form in kind.forms)
        rows.append((f"`{name}`", kind.help, f"{made.dtype} {shape}", files))
    return table(("modality", "value of a pixel", "array", "files"), rows)


def modality_forms() -> str:
    """Return the table of the keys that choose the form of a modality's files."""
    rows = []
    for name, forms in CHOICES.items():
        for form in forms:
            copy = f"; with `kwcoco`, which does not read it, a `.{form.copy}` beside each" if form.copy else ""
            default = " (default)" if form is forms[0] else ""
            rows.append((f"`{name}: {form.name}`", f"{form.help}{copy}{default}"))
    return table(("key", "files"), rows)


def format_names() -> str:
    """Return the names of the export formats in one line."""
    return code(formats.FORMATS)


def format_list() -> str:
    """Return the list of export formats with their options."""
    lines = []
    for name, kind in formats.FORMATS.items():
        options = (f" `--{option.name}` {option.metavar}: {option.help}." for option in kind.options)
        text = f"- [`{name}`](dataset.md#{name}): {kind.help}.{''.join(options)}"
        lines.append(paragraph(text, indent="  "))
    return "\n".join(lines)


def format_sections() -> str:
    """Return a section for each export format: the docstring of its module."""
    docs = {name: inspect.getdoc(import_module(f"{formats.__name__}.{name}")) for name in formats.FORMATS}
    return "\n\n".join(f"### {name}\n\n{text}" for name, text in docs.items())


def detector_scores() -> str:
    """Return the table of what detectors see in the crowds, before and after the pictures were improved."""
    folder = ROOT / "benchmarks" / "pictures" / "results"
    before, after = (json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in ("before", "after"))
    detectors = list(after)

    def cell(detector: str, row: str) -> str:
        old, new = before[detector].get(row), after[detector][row]
        if old is None:  # a class that was not scored apart then
            return f"{new['precision']:.2f} ({new['recall']:.2f})"
        return f"{old['precision']:.2f} → {new['precision']:.2f} ({old['recall']:.2f} → {new['recall']:.2f})"

    rows = []
    for row, value in after[detectors[0]].items():
        if isinstance(value, dict):
            words = row.replace(" 40 ", ", 40 to 90 px, ").replace(" 90 ", ", over 90 px, ")
            rows.append((words, f"{value['objects']:,}", *(cell(d, row) for d in detectors)))
    alarms = [f"{before[d]['false alarms']:.2f} → {after[d]['false alarms']:.2f}" for d in detectors]
    return table(("objects", "number", *detectors), [*rows, ("false alarms in an empty street", "", *alarms)])


PARTS: dict[str, Callable[[], str]] = {
    "detector_scores": detector_scores,
    "format_list": format_list,
    "format_names": format_names,
    "format_sections": format_sections,
    "modalities": modalities,
    "modality_forms": modality_forms,
    "modality_names": modality_names,
    "presets": presets,
    "towns": town_table,
    "weather_parameters": weather_parameters,
}
"""Name -> function that returns the text of the part."""


def main() -> None:
    """Rewrite all pages with generated parts."""
    for page in PAGES:
        old = page.read_text(encoding="utf-8")
        new = renewed(old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
