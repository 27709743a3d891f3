"""`recipe cache`: shows and prunes what is kept between runs."""

from __future__ import annotations

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import JSON
from recipe_cli.console import print_json, say


@click.command("cache")
@click.option("--prune", is_flag=True, help="Remove the least recently used entries, down to --size.")
@click.option(
    "--size",
    metavar="SIZE",
    help="With --prune: the size limit, such as 500M; RECIPE_CACHE_LIMIT by default.",
)
@JSON
def command(prune: bool, size: str | None, as_json: bool) -> None:
    """Show what the cache holds: traces, and compiled kernels. All of it can be recomputed.

    A build that made something prunes it to RECIPE_CACHE_LIMIT (10G unless that is set; `none`: never).
    """
    from recipe_compiler.estimate import size as size_text
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.cache import pruning
    from recipe_runtime.core.files import host_errors

    if size is not None and not prune:
        raise InputError("--size says how much --prune leaves; give both")
    limit = pruning.limit() if size is None else pruning.bytes_of(size)
    roots = pruning.folders()
    with host_errors(f"the cache {' or '.join(map(str, roots))}", "allow writing, or set RECIPE_CACHE"):
        removed = pruning.prune(roots, limit) if prune and limit is not None else []
    sizes = pruning.sizes(pruning.entries(roots))
    if as_json:
        kinds = {kind: {"entries": number, "bytes": total} for kind, (number, total) in sizes.items()}
        freed = sum(entry.size for entry in removed)
        print_json(
            {"folders": [str(root) for root in roots], "kinds": kinds, "removed": len(removed), "freed_bytes": freed}
        )
        return
    if prune:
        gone = size_text(sum(entry.size for entry in removed))
        say(f"removed {count(len(removed), 'entry', 'entries')}, {gone}")
    say(f"{', '.join(map(str, roots))}: {size_text(sum(total for _, total in sizes.values()))}")
    for kind, (number, total) in sizes.items():
        say(f"  {kind:8} {number:6}  {size_text(total)}")
