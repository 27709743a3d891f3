"""Show rendered crowds to detectors, and write what they saw: `make evidence-pictures`."""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

from benchmarks.pictures import crowd, scores
from benchmarks.pictures.detection import SIDES
from benchmarks.pictures.measuring import Task, measured

_SWEEP_HEIGHTS = (20.0, 1e4)  # pixels: its vehicles are far away


def main() -> None:
    """Measure, print the scores and write them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", default=",".join((*crowd.TOWNS, crowd.SWEEP)))
    parser.add_argument("--weathers", default=",".join(crowd.WEATHERS))
    parser.add_argument("--detectors", default=",".join(SIDES))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--device", default="cpu", help="where the detectors run")
    parser.add_argument("--out", type=Path, required=True, help="the JSON file to write")
    chosen = parser.parse_args()
    detectors = tuple(chosen.detectors.split(","))
    tasks: list[Task] = [
        (place, weather, detectors, chosen.device)
        for place in chosen.places.split(",")
        for weather in (("",) if place == crowd.SWEEP else chosen.weathers.split(","))
    ]
    with ProcessPoolExecutor(chosen.jobs, get_context("spawn")) as pool:
        seen = [found for part in pool.map(measured, tasks) for found in part]
    report = {name: _report([row for detector, row in seen if detector == name]) for name in detectors}
    chosen.out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report, indent=1))


def _report(seen: list[scores.Seen]) -> dict[str, object]:
    """Return what a detector saw as plain JSON."""
    crowds = [picture for picture in seen if picture.place != crowd.SWEEP]
    sweep = [picture for picture in seen if picture.place == crowd.SWEEP]
    report: dict[str, object] = {name: _plain(value) for name, value in scores.summary(crowds).items()}
    for label in crowd.CLASSES:
        report[f"{label} {crowd.SWEEP}"] = _plain(scores.score(sweep, label, _SWEEP_HEIGHTS))
    return report | {"false alarms": round(scores.false_alarms(crowds), 3), "pictures": len(seen)}


def _plain(value: scores.Score) -> dict[str, float]:
    return {name: round(number, 3) for name, number in asdict(value).items()}


if __name__ == "__main__":
    main()
