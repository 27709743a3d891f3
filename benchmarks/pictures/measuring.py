"""What detectors see in the pictures of a place: the work of one process."""

from __future__ import annotations

from benchmarks.pictures import crowd, detection, scores
from examples.attacks.detectors import opened, use_one_thread

Task = tuple[str, str, tuple[str, ...], str]
"""A place, a weather, the names of detectors, and the device on which they run."""


def measured(task: Task) -> list[tuple[str, scores.Seen]]:
    """Return what each detector saw in the pictures of a place and a weather."""
    place, weather, names, device = task
    use_one_thread(device)
    detectors = {name: opened(name.split(" ")[0]) for name in names}
    shown = crowd.sweep() if place == crowd.SWEEP else crowd.pictures(place, weather)
    found = []
    for picture in shown:
        for name, detector in detectors.items():
            rows = tuple(detection.detections(name, detector, picture.pixels))
            found.append((name, scores.Seen(place, picture.weather, picture.empty, picture.truths, rows)))
    return found
