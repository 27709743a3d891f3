"""`recipe doctor`: the host's fingerprint, and a self-test of its bytes."""

from __future__ import annotations

from dataclasses import asdict

import click

from recipe_cli.arguments import JSON
from recipe_cli.console import Styled, print_json, say
from recipe_cli.progress import Progress

_MARKS = {"equal": "ok", "differs": "DIFFERS", "may differ": "may differ", "not reached": "-"}
_COLOURS = {"equal": "green", "differs": "red", "may differ": "yellow"}


@click.command("doctor")
@JSON
def command(as_json: bool) -> None:
    """Report the host's fingerprint, build a golden recipe, and report which promises hold here.

    The promises are the tiers of docs/determinism.md; tier A is equal bytes. Exit code 0: nothing differs that must
    not; 1: something does, or the self-test could not be run (tier A: no).
    """
    from recipe_runtime.verify.self_test import STAGES, examine

    with Progress() as progress:
        found = examine(progress)
    if as_json:
        print_json(
            {"fingerprint": found.fingerprint, "checks": [asdict(c) for c in found.checks]}
            | {"gpu": [asdict(c) for c in found.gpu], "tiers": found.tiers}
        )
    else:
        fingerprint = found.fingerprint
        versions = ", ".join(f"{name} {value}" for name, value in fingerprint["versions"].items())
        say(f"{fingerprint['processor']}, {fingerprint['cores']} cores, {' '.join(fingerprint['features'])}")
        say(f"{fingerprint['system']}; {versions}")
        for title, checks in (("processor", found.checks), (", ".join(fingerprint["gpus"]), found.gpu)):
            for check in checks:
                reason = f"  {check.reason}" if check.reason else ""
                mark = Styled(_MARKS[check.state], _COLOURS.get(check.state, ""))
                say(f"  {title:9}  {check.stage:12} {STAGES[check.stage]:30} ", mark, reason)
        for tier, answer in found.tiers.items():
            say(f"tier {tier}: {answer}")
    raise click.exceptions.Exit(0 if found.healthy else 1)
