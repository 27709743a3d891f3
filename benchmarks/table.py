"""Format the figures as a Markdown table for docs/performance.md."""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.simulation import GOALS

BUSY = 0.5  # processes running in the minute before the first contender


def text_of(found: dict[str, Any]) -> str:
    """Format all figures of a run."""
    lines = [
        f"Machine: {found['machine']}; load {found['load before']} before, {found['load after']} after.",
        *(["Others used the machine: do not rely on these figures."] if found["load before"][0] > BUSY else []),
        "800x600: RGB, depth and instance; ours also annotated, hashed, and written as a whole dataset.",
        "",
        "| goal | reached |",
        "|---|---|",
        *_goals(found),
        "",
        "| contender | frames | frames/s | ms a frame | start-up, s | peak, MiB | where the time goes |",
        "|---|---|---|---|---|---|---|",
    ]
    for scene, ours, plain in (("listing", "ours", "plain"), ("town", "town", "town plain")):
        lines += [_row(f"{scene}: Dataset Recipe, {name}", row) for name, row in found[ours].items()]
        lines += [_row(f"{scene}: plain script, {name}", row) for name, row in found[plain].items()]
    lines += [f"{line}; skipped" for line in found["skipped"]]
    lines += ["", *_ratios(found), "", *_simulation(found["simulation"]), "", *_kernels(found["kernels"])]
    lines += ["", *textures_table(found["textures"])]
    return "\n".join(lines)


def textures_table(found: dict[str, Any]) -> list[str]:
    """List the times of frames with other textures, and the plain script's frame time as a multiple of them."""
    weathers, plain = found["weathers"], found["plain"]
    stages = list(dict.fromkeys(stage for row in weathers.values() for stage in row))
    lines = [f"| a frame with a patch, CPU ms | {' | '.join(weathers)} |", "|---" * (1 + len(weathers)) + "|"]
    for stage in stages:
        cells = [statistics.median(row[stage]) if stage == "update" else row[stage] for row in weathers.values()]
        lines.append(f"| {stage} | {' | '.join(f'{cell:.1f}' for cell in cells)} |")
    if "forward and backward" not in stages:
        lines.append("SceneView was not measured: PyTorch is not installed (`make test-torch` installs it)")
    lines.append("")
    for name, frames in plain.items():
        lines.append(
            f"- plain script, {name}, CPU ms a frame, in alternating runs: {', '.join(f'{ms:.0f}' for ms in frames)}"
        )
        for weather, row in weathers.items():
            ratios = [f"{slow / fast:.0f}" for slow, fast in zip(frames, row["update"], strict=True)]
            lines.append(f"- times an update, {weather}, in alternating runs: {', '.join(ratios)}")
    return lines


def texture_goals(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the results of texture updates and `SceneView` beside their goals, in the slower weather."""
    rows = []
    for name, frames in found["plain"].items():
        ratios = [
            slow / max(row["update"][turn] for row in found["weathers"].values()) for turn, slow in enumerate(frames)
        ]
        rows.append(
            (
                f"100 texture updates: 30 times 100 frames of the plain script ({name})",
                f"{statistics.median(ratios):.0f}",
            )
        )
    passes = [row["forward and backward"] for row in found["weathers"].values() if "forward and backward" in row]
    reached = f"{max(passes):.0f} ms" if passes else "not measured: PyTorch is not installed"
    return [*rows, ("SceneView, forward and backward of a frame on one core: under 60 ms", reached)]


def _goals(found: dict[str, Any]) -> list[str]:
    """List the goals for two cores, and what this run reached."""
    two, town, turns = found["ours"]["2 workers"], found["town"]["2 workers"], found["workers"]
    peak = max(row["peak"] for row in (*found["ours"].values(), *found["town"].values()))
    rows = [
        *_times("listing: 20 times the plain script", two, found["plain"], "TinyRenderer"),
        *_times("listing: 4 times the plain script through EGL", two, found["plain"], "EGL"),
        *_times("town, moving camera: 10 times the plain script", town, found["town plain"], "TinyRenderer"),
        *[(f"an additional weather, {n}: 0.6 of the first", _middle(r["shares"])) for n, r in found["further"].items()],
        *[
            (f"an additional weather, {n}: 0.6 of a first that just meets its goal", _middle(_share_of_goal(r, found)))
            for n, r in found["further"].items()
        ],
        (
            f"an additional weather, the mean of {len(found['twelve']['alone']) - 1}: 0.6 of a first",
            f"{_mean(found):.2f}",
        ),
        ("twelve weathers: 8 times one (the mean of the twelve, each built alone)", f"{_twelve(found):.1f}"),
        (
            "2 workers: 1.9 times one, while frames are rendered (mean of alternating runs)",
            f"{sum(turns) / len(turns):.2f}",
        ),
        ("memory of a worker: under 1,536 MiB", f"{peak:.0f} MiB"),
        *texture_goals(found["textures"]),
    ]
    return [f"| {goal} | {reached} |" for goal, reached in rows]


def _middle(values: list[float]) -> str:
    return f"{statistics.median(values):.2f}"


def _share_of_goal(row: dict[str, Any], found: dict[str, Any]) -> list[float]:
    """Share of an additional weather in the cost of a first one that just meets its goal, 20 times the script."""
    plain = found["plain"]["TinyRenderer, shadows"]
    allowed = 2 * plain["steady"] / plain["frames"] / 20
    return [seconds / allowed for seconds in row["seconds"]]


def _twelve(found: dict[str, Any]) -> float:
    alone = found["twelve"]["alone"]
    return float(found["twelve"]["together"] * len(alone) / sum(alone))


def _mean(found: dict[str, Any]) -> float:
    """Mean cost of an additional weather, as a share of the mean cost of a weather that is built alone."""
    return (_twelve(found) - 1.0) / (len(found["twelve"]["alone"]) - 1)


def _times(goal: str, ours: dict[str, Any], plain: dict[str, Any], kind: str) -> list[tuple[str, str]]:
    """Ratio of the frame rate to that of every plain script of a kind."""
    rows = [(name, row) for name, row in plain.items() if name.startswith(kind)]
    return [(f"{goal} ({name})", f"{ours['fps'] / row['fps']:.1f}") for name, row in rows]


def _simulation(found: dict[str, dict[str, float]]) -> list[str]:
    """Format the speed of the simulation, by the number of actors."""
    lines = [
        "| simulation, actors | times real time | goal | of that, poses | bare PyBullet steps | ratio of CPU time |",
        "|---|---|---|---|---|---|",
    ]
    for actors, row in found.items():
        goal, share = GOALS[int(actors)], 100 * row["recording"]
        cells = f"{row['real_time']:.1f} | {goal:.0f} | {share:.0f} % | {row['bare']:.0f} | {row['ratio']:.1f}"
        lines.append(f"| {actors} | {cells} |")
    return lines


def _kernels(found: dict[str, dict[str, float]]) -> list[str]:
    """Milliseconds of one thread per frame, by stage and scene, the most expensive first."""
    stages = sorted(
        {s for row in found.values() for s in row}, key=lambda s: -max(r.get(s, 0.0) for r in found.values())
    )
    lines = [f"| stage, ms a frame | {' | '.join(found)} |", "|---" * (1 + len(found)) + "|"]
    for stage in stages:
        cells = [f"{row.get(stage, 0.0):.1f}" for row in found.values()]
        lines += [f"| {stage} | {' | '.join(cells)} |"] if any(cell != "0.0" for cell in cells) else []
    total = [f"{sum(row.values()):.0f}" for row in found.values()]
    return [*lines, f"| all | {' | '.join(total)} |"]


def _row(name: str, row: dict[str, Any]) -> str:
    each = 1000 * row["steady"] / row["frames"]
    peak = f"{row['peak']:.0f}" if "peak" in row else "-"
    start = f"{row['start_up']:.1f}"
    return f"| {name} | {row['frames']} | {row['fps']:.2f} | {each:.0f} | {start} | {peak} | {_shares(row)} |"


def _shares(row: dict[str, Any]) -> str:
    """Each stage's share of the time without start-up, the most expensive first."""
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
    lines.append(
        f"- 2 workers: {two['fps'] / one['fps']:.2f} times 1 worker, including the simulation and the end of the build"
    )
    lines.append(f"- 2 workers, alternating runs: {', '.join(f'{ratio:.2f}' for ratio in found['workers'])}")
    for name, row in found["further"].items():
        figures = ", ".join(
            f"{1000 * each:.0f} ({share:.2f})" for each, share in zip(row["seconds"], row["shares"], strict=True)
        )
        lines.append(
            f"- {name} in addition to the first weather, alternating runs, ms a frame (share of the first): {figures}"
        )
    least = min(found["twelve"]["alone"])
    lines.append(
        f"- twelve weathers at once: {found['twelve']['together'] / least:.1f} times the cheapest of them alone"
    )
    if "cold start" in found:
        lines.append(f"- first picture with an empty cache, all kernels compiled: {found['cold start']:.0f} s")
    return lines
