"""`CITATION.cff` of a dataset whose recipe names its authors: what GitHub and Zenodo offer as its citation."""

from __future__ import annotations

import re

from recipe_compiler.ir.plan import DatasetPlan

_UNQUOTED = re.compile("[^ !#-\\[\\]-~\xa1-\xac\xae-\u1fff\u3001-\ud7ff]")  # what needs an escape in quotes


def citation(dataset: DatasetPlan, identity: str) -> str:
    """Return the file in the Citation File Format 1.2.0; texts are quoted."""
    about = dataset.about
    by_url = about.licence.startswith("http")
    rows = {
        "cff-version": "1.2.0",
        "message": "If you use this dataset, please cite it, and print its identity line.",
        "type": "dataset",
        "title": dataset.recipe,
        "abstract": dataset.description,
        "license": about.licence if about.licence_url and not by_url else "",
        "license-url": about.licence if by_url else "",
        "url": about.url,
        "version": about.version,
    }
    lines = [f"{key}: {quoted(text)}" for key, text in rows.items() if text]
    lines += ["authors:", *(f"  - name: {quoted(name)}" for name in about.authors)]
    lines += ["identifiers:", "  - type: other", f"    value: {quoted(identity)}"]
    return "\n".join([*lines, "    description: identity line of the dataset"]) + "\n"


def quoted(text: str) -> str:
    """Return a text in double quotes, as YAML has it."""
    return '"' + _UNQUOTED.sub(lambda match: f"\\U{ord(match[0]):08x}", text) + '"'
