"""`recipe schema`: the JSON Schema of recipes."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import LocalPath, writing
from recipe_cli.console import print_document, say


@click.command("schema")
@click.option("-o", "--output", type=LocalPath(path_type=Path, dir_okay=False), help="Write it to this file.")
def command(output: Path | None) -> None:
    """Print the JSON Schema of recipes, so that editors complete and check them."""
    import json

    from recipe_compiler.schema import json_schema

    text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    if output is None:
        print_document(text)
    else:
        with writing(output):
            output.write_text(text + "\n", encoding="utf-8")
        say(f"{output} written", err=True)
