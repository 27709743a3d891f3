"""`recipe plan`: what a recipe stands for and what it costs, before any work."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.wording import count

from recipe_cli.arguments import ALLOW_LARGE, JSON, RECIPE, compile_quietly, print_json, unpacks, worker_count

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.limits import Cost


@click.command("plan")
@RECIPE
@ALLOW_LARGE
@click.option("--variant", metavar="NAME", help="Print this variant's expanded plan as JSON.")
@JSON
@unpacks("recipe")
def command(recipe: Path, allow_large: bool, variant: str | None, as_json: bool) -> None:
    """Show RECIPE's variants, what they share, and the frames, bytes and minutes of building it."""
    compiled = compile_quietly(recipe, allow_large=allow_large)
    if variant is not None:
        from recipe_compiler.canonical import pretty

        click.echo(pretty(compiled.plan.named(variant).document()), nl=False)
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
    return {**head, "assets": assets, "cost": asdict(compiled.cost)}


def _table(compiled: Compiled) -> None:
    from recipe_compiler.limits import size
    from recipe_compiler.source import printable

    plan = compiled.plan
    click.echo(f"{plan.recipe}: {plan.description}" if plan.description else plan.recipe)
    width = max(len(name) for name in [*(v.variant for v in plan.variants), *(a.name for a in compiled.assets)])
    click.echo(f"\n  {'variant':<{width}}  scene     rig       appearance")
    for v in plan.variants[:40]:
        digests = "  ".join(d[:8] for d in (v.scene.digest, v.rig.digest, v.appearance.digest))
        click.echo(f"  {v.variant:<{width}}  {digests}")
    if len(plan.variants) > 40:
        click.echo(f"  ... and {len(plan.variants) - 40} more; --json lists all")
    if compiled.assets:
        click.echo(f"\n  {'asset':<{width}}  digest    size")
    for asset in compiled.assets:
        about = f"{size(asset.file.bytes)}, {asset.contents}, {printable(asset.path)}"
        click.echo(f"  {asset.name:<{width}}  {asset.file.sha256[:8]}  {about}")
    click.echo(f"\n{compiled.cost}")
    cost = compiled.cost
    click.echo(
        f"{count(cost.frames, 'frame')}, {count(cost.images, 'image')}, about {size(cost.bytes)}, "
        f"about {_duration(cost.minutes)} of one core{_here(cost)}"
    )
    click.echo(f"plan sha256:{plan.digest}")


def _here(cost: Cost) -> str:
    """How long that is on the cores of this host, which a build takes all of."""
    cores = worker_count(None)
    return f", {_duration(cost.minutes_with(cores))} on the {cores} here" if cores > 1 else ""


def _duration(minutes: float) -> str:
    if minutes < 1:
        return f"{max(1, round(minutes * 60))} s"
    return count(round(minutes), "minute") if minutes < 120 else count(round(minutes / 60), "hour")
