"""The figures as text: a Markdown table that docs/performance.md can take as it is."""

from __future__ import annotations

from typing import Any

BUSY = 0.5  # processes running in the minute before the first contestant


def text_of(found: dict[str, Any]) -> str:
    """All figures of a run."""
    lines = [
        f"Machine: {found['machine']}; load {found['load before']} before, {found['load after']} after.",
        *(["Others used the machine: do not rely on these figures."] if found["load before"][0] > BUSY else []),
        "800x600: RGB, depth and instance; ours also annotated, hashed, and written as a whole dataset.",
        "",
        "| contestant | frames | frames/s | ms a frame | start-up, s | where the time goes |",
        "|---|---|---|---|---|---|",
    ]
    lines += [_row(f"Dataset Recipe, {name}", row) for name, row in found["ours"].items()]
    lines += [_row(f"plain script, {name}, 1 process", row) for name, row in found["plain"].items()]
    lines += [f"{line}; skipped" for line in found["skipped"]]
    lines += ["", *_ratios(found)]
    return "\n".join(lines)


def _row(name: str, row: dict[str, Any]) -> str:
    each = 1000 * row["steady"] / row["frames"]
    return f"| {name} | {row['frames']} | {row['fps']:.2f} | {each:.0f} | {row['start_up']:.1f} | {_shares(row)} |"


def _shares(row: dict[str, Any]) -> str:
    """Each stage's share of the time, the dearest first; without start-up."""
    seconds = {name: s for name, s in row["seconds"].items() if name != "load"}
    total = sum(seconds.values())
    order = sorted(seconds, key=lambda name: -seconds[name])
    return ", ".join(f"{name} {100 * seconds[name] / total:.0f} %" for name in order if seconds[name] > 0.005 * total)


def _ratios(found: dict[str, Any]) -> list[str]:
    one, two = found["ours"]["1 worker"], found["ours"]["2 workers"]
    lines = [
        f"- {workers}: {row['fps'] / plain['fps']:.1f} times {name}"
        for workers, row in found["ours"].items()
        for name, plain in found["plain"].items()
    ]
    lines.append(f"- 2 workers: {two['fps'] / one['fps']:.2f} times 1 worker")
    for name, row in found["further"].items():
        lines.append(f"- {name} on top of the first weather: {row['share']:.2f} of the first's cost")
    if "cold start" in found:
        lines.append(f"- first picture with an empty cache, all kernels compiled: {found['cold start']:.0f} s")
    return lines
