"""`recipe pack`: a recipe with all that it needs, in one file to share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import ALLOW_LARGE, JSON, RECIPE, REPLACE, LocalPath, compile_quietly, output_option, writing
from recipe_cli.console import print_json, say
from recipe_cli.lockfile_paths import FOLDER, check_lockfile_is_of, lockfile_path
from recipe_cli.places import check_utf8, recipe_files, used_files

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled


@click.command("pack")
@RECIPE
@output_option(LocalPath(path_type=Path, dir_okay=False), "<recipe>.recipe by default.")
@click.option(
    "--with-traces",
    is_flag=True,
    help="Fail if there are no traces beside the lockfile; existing ones are always included.",
)
@REPLACE
@ALLOW_LARGE
@JSON
def command(
    recipe: Path, output: Path | None, with_traces: bool, replace: bool, allow_large: bool, as_json: bool
) -> None:
    """Put RECIPE, every file that it uses, its lockfile and traces into one file, and print its identity.

    `plan`, `check`, `shot`, `build`, `verify` and `diff` take such a file in place of a recipe.
    """
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.core.outputs import check_not_input, check_output, write_output
    from recipe_runtime.transfer import bundle

    check_utf8(recipe)
    compiled = compile_quietly(recipe, allow_large=allow_large)
    output = output or Path(f"{compiled.plan.recipe}{bundle.SUFFIX}")
    if not bundle.is_pack(output):
        raise InputError(f"{output}: give --output a name that ends in {bundle.SUFFIX}")
    check_output(output, replace=replace)
    check_not_input(output, used_files(recipe, compiled))
    files = {**recipe_files(recipe, compiled), **_locked(recipe, compiled, with_traces)}
    body = bundle.Pack(recipe.name, files).dumps()
    with writing(output):
        write_output(output, body, replace=replace)
    if as_json:
        rows = {path: len(content) for path, content in sorted(files.items())}
        print_json({"file": str(output), "bytes": len(body), "identity": bundle.identity(body), "files": rows})
        return
    for path, content in sorted(files.items()):
        say(f"  {path}  {count(len(content), 'byte')}")
    say(f"{output}  {bundle.identity(body)}")


def _locked(recipe: Path, compiled: Compiled, with_traces: bool) -> dict[str, bytes]:
    """The lockfile and the traces beside it, by their paths in a pack; empty if the recipe has no lockfile."""
    from dataclasses import replace

    from recipe_compiler.ir import lockfile
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.verify import trace_bundle

    path = lockfile_path(recipe, compiled.plan.recipe)
    motion = trace_bundle.beside(path)
    if with_traces and not motion.exists():
        raise InputError(f"{motion}: there are no traces; `recipe lock --update --with-traces` writes them")
    if not path.exists():
        return {}
    lock = lockfile.read(path)
    check_lockfile_is_of(recipe, compiled.plan, path, lock)
    if not lock.sealed or lock.plan != compiled.plan.digest:
        raise InputError(f"{path} differs from what {recipe} compiles to now; run `recipe lock --update` first")
    name = f"{FOLDER}/{compiled.plan.recipe}"
    found = {f"{name}.lock": replace(lock, source=f"../{recipe.name}", files=compiled.files).dumps().encode()}
    if motion.exists():
        found[f"{name}{trace_bundle.SUFFIX}"] = trace_bundle.dumps(
            trace_bundle.read(motion, lock.traces, trace_bundle.size_limits(compiled.plan))
        )
    return found
