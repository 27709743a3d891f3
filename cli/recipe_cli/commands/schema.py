"""`recipe schema`: the JSON Schema of recipes."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import JSON, REPLACE, LocalPath, output_option, writing
from recipe_cli.console import print_document, print_json, say


@click.command("schema")
@output_option(LocalPath(path_type=Path, dir_okay=False), "Write it to this file.")
@REPLACE
@JSON
def command(output: Path | None, replace: bool, as_json: bool) -> None:
    """Print the JSON Schema of recipes, so that editors complete and check them."""
    import json

    from recipe_compiler.schema import json_schema

    text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    if output is None:
        print_document(text)
    else:
        from recipe_runtime.core.outputs import write_output

        with writing(output):
            write_output(output, f"{text}\n".encode(), replace=replace)
        if as_json:
            print_json({"file": str(output)})
        else:
            say(f"{output} written", err=True)
