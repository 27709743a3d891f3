"""`recipe attest`: statements in the form of in-toto, to sign and to publish."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import REPLACE, LocalPath, output_option, writing
from recipe_cli.console import print_document, say

_BUILDER = "urn:dataset-recipe:unnamed-builder"


@click.command("attest")
@click.argument("target", type=LocalPath(path_type=Path))
@click.option(
    "--report",
    type=LocalPath(path_type=Path, dir_okay=False),
    help="State what this verification found: a file that `recipe verify --json` wrote.",
)
@click.option("--builder", metavar="URI", default=_BUILDER, show_default=True, help="Who built the dataset.")
@output_option(LocalPath(path_type=Path, dir_okay=False), "The file to write; printed by default.")
@REPLACE
def command(target: Path, report: Path | None, builder: str, output: Path | None, replace: bool) -> None:
    """Write a statement about TARGET, a dataset or a lockfile, in the form of in-toto.

    Without --report, it states how the dataset was built (SLSA Provenance v1): recipe, plans and versions of tools.
    With it, what a verification found (Test Result v0.1): verdict, nonce, sample and bound. Statements are not signed.
    """
    from recipe_compiler.ir.canonical import pretty
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.core.outputs import check_not_input, check_output, write_output
    from recipe_runtime.lifecycle import attestation

    from recipe_cli.suggestions import check_exists

    check_exists(target)
    if ":" not in builder or not builder.isprintable() or " " in builder:
        raise InputError(f"--builder: {builder!r} is not a URI; give one such as https://example.org/ci")
    if output is not None:
        check_output(output, replace=replace)
        check_not_input(output, [target] if report is None else [target, report])
    about = attestation.Target(target)
    if report is None:
        statement = attestation.provenance(about, builder)
    else:
        statement = attestation.test_result(about, attestation.read_report(report, about.lock.identity))
    if output is None:
        print_document(pretty(statement))
        return
    with writing(output):
        write_output(output, pretty(statement).encode(), replace=replace)
    say(f"{output}  {statement['predicateType']}")
    say(about.lock.identity)
