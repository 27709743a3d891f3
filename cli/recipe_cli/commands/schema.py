"""`recipe schema`: the JSON Schema of recipes."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import REPLACE, LocalPath, writing
from recipe_cli.console import print_document, say


@click.command("schema")
@click.option("-o", "--output", type=LocalPath(path_type=Path, dir_okay=False), help="Write it to this file.")
@REPLACE
def command(output: Path | None, replace: bool) -> None:
    """Print the JSON Schema of recipes, so that editors complete and check them."""
    import json

    from recipe_compiler.schema import json_schema

    text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    if output is None:
        print_document(text)
    else:
        from recipe_runtime.outputs import write_output

        with writing(output):
            write_output(output, f"{text}\n".encode(), replace=replace)
        say(f"{output} written", err=True)
