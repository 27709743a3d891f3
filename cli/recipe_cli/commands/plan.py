"""`recipe plan`: what a recipe defines and what it costs, before any work."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count

from recipe_cli import completion
from recipe_cli.arguments import ALLOW_LARGE, JSON, RECIPE, compile_quietly, unpacks, worker_count
from recipe_cli.console import print_document, print_json, say
from recipe_cli.host_limits import memory

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.estimate import Cost


@click.command("plan")
@RECIPE
@ALLOW_LARGE
@click.option(
    "--variant",
    metavar="NAME",
    shell_complete=completion.variants,
    help="Print this variant's expanded plan as JSON.",
)
@JSON
@unpacks("recipe")
def command(recipe: Path, allow_large: bool, variant: str | None, as_json: bool) -> None:
    """Show RECIPE's variants, what they share, and the frames, bytes, minutes and memory of building it."""
    compiled = compile_quietly(recipe, allow_large=allow_large, workers=worker_count(None))
    if variant is not None:
        from recipe_compiler.ir.canonical import pretty

        print_document(pretty(compiled.plan.named(variant).document()))
    elif as_json:
        print_json(_document(compiled))
    else:
        _table(compiled)


def _document(compiled: Compiled) -> dict[str, object]:
    from dataclasses import asdict

    rows = [
        {"name": v.variant, "digest": v.digest, "scene": v.scene.digest, "rig": v.rig.digest}
        | {"appearance": v.appearance.digest}
        for v in compiled.plan.variants
    ]
    plan = compiled.plan
    assets = [
        {"name": a.name, "file": a.path, "sha256": a.file.sha256, "bytes": a.file.bytes, "holds": a.contents}
        for a in compiled.assets
    ]
    head = {"recipe": plan.recipe, "digest": plan.digest, "variants": rows}
    here = memory(worker_count(None))
    room = {"workers": here.workers, "needed": compiled.cost.memory_with(here.workers), "host": here.total}
    return {**head, "assets": assets, "cost": asdict(compiled.cost), "memory": {**room, "process": here.process}}


def _table(compiled: Compiled) -> None:
    from recipe_compiler.estimate import size

    plan = compiled.plan
    say(plan.recipe)
    if plan.description:
        say(f"  {plan.description}")
    width = max(len(name) for name in [*(v.variant for v in plan.variants), *(a.name for a in compiled.assets)])
    say()
    say(f"  {'variant':<{width}}  scene     rig       appearance")
    for v in plan.variants[:40]:
        digests = "  ".join(d[:8] for d in (v.scene.digest, v.rig.digest, v.appearance.digest))
        say(f"  {v.variant:<{width}}  {digests}")
    if len(plan.variants) > 40:
        say(f"  ... and {len(plan.variants) - 40} more; --json lists all")
    if compiled.assets:
        say()
        say(f"  {'asset':<{width}}  digest    size")
    for asset in compiled.assets:
        about = f"{size(asset.file.bytes)}, {asset.contents}, {asset.path}"
        say(f"  {asset.name:<{width}}  {asset.file.sha256[:8]}  {about}")
    say()
    say(str(compiled.cost))
    cost = compiled.cost
    say(
        f"{count(cost.frames, 'frame')}, {count(cost.images, 'image')}, about {size(cost.bytes)}, "
        f"about {_duration(cost.minutes)} of one core{_here(cost)}"
    )
    here = memory(worker_count(None))
    say(
        f"about {size(cost.memory_with(here.workers))} of memory with {count(here.workers, 'worker')}, "
        f"{size(cost.worker_memory)} each; this host has {size(here.total or 0)}"
    )
    say(f"plan sha256:{plan.digest}")


def _here(cost: Cost) -> str:
    """Return the text of the time on this host, all cores of which a build uses; empty for one core."""
    cores = worker_count(None)
    return f", {_duration(cost.minutes_with(cores))} on this host's {cores} cores" if cores > 1 else ""


def _duration(minutes: float) -> str:
    if minutes < 1:
        return f"{max(1, round(minutes * 60))} s"
    return count(round(minutes), "minute") if minutes < 120 else count(round(minutes / 60), "hour")
