"""The scores of detectors on rendered crowds (`benchmarks/pictures`), on pictures whose scores are known."""

from __future__ import annotations

import pytest

from benchmarks.pictures.crowd import Truth
from benchmarks.pictures.scores import HEIGHTS, Seen, false_alarms, score

TALL, SMALL = (10.0, 10.0, 50.0, 130.0), (200.0, 10.0, 220.0, 60.0)
RIDER = (300.0, 10.0, 340.0, 130.0)


def seen(*rows: tuple[str, float, float, float, float, float], empty: bool = False) -> Seen:
    """Return a picture with a tall and a small person and a rider, or an empty one, and detections."""
    truths = (Truth("person", TALL, True), Truth("person", SMALL, True), Truth("", RIDER, False))
    return Seen("plaza", "noon", empty, () if empty else truths, rows)


def test_objects_of_another_height_count_neither_way() -> None:
    both = [seen(("person", *TALL, 0.9), ("person", *SMALL, 0.8))]
    for name in HEIGHTS:
        assert score(both, "person", HEIGHTS[name]).precision == pytest.approx(1.0)
        assert score(both, "person", HEIGHTS[name]).objects == 1


def test_missed_objects_lower_the_recall() -> None:
    assert score([seen(("person", *TALL, 0.9)), seen()], "person", HEIGHTS["90"]).recall == pytest.approx(0.5)


def test_wrong_boxes_lower_the_precision() -> None:
    wrong = seen(("person", 600.0, 10.0, 640.0, 130.0, 0.95), ("person", *TALL, 0.9))
    assert score([wrong], "person", HEIGHTS["90"]).precision == pytest.approx(0.5, abs=0.01)


def test_riders_may_be_detected_as_people() -> None:
    found = seen(("person", *RIDER, 0.95), ("person", *TALL, 0.9))
    assert score([found], "person", HEIGHTS["90"]).precision == pytest.approx(1.0)


def test_false_alarms_are_counted_on_empty_streets_only() -> None:
    alarm = ("person", *RIDER, 0.6)
    assert false_alarms([seen(alarm), seen(alarm, ("vehicle", *TALL, 0.4), empty=True), seen(empty=True)]) == 0.5


def test_heavy_vehicles_are_scored_apart() -> None:
    """A missed truck lowers the score of buses and trucks, and counts neither way in that of cars."""
    truths = (Truth("vehicle", TALL, True), Truth("vehicle", (300.0, 10.0, 400.0, 130.0), True, heavy=True))
    picture = Seen("plaza", "noon", False, truths, (("vehicle", *TALL, 0.9),))
    recalls = [score([picture], "vehicle", HEIGHTS["90"], heavy).recall for heavy in (None, False, True)]
    assert recalls == pytest.approx([0.5, 1.0, 0.0])
