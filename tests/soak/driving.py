"""How vehicles are driven: accelerations, lane changes, headways and speeds.

All lengths are in metres, speeds in m/s, accelerations in m/s2, times in seconds. Accelerations are second central
differences of the positions in the Trace, along and across the heading; those across are means over 0.3 s.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.soak.hazards import Hazards
from tests.soak.tracks import Array, Tracks

LATERAL, ENTRY, HARD = 2.0, 3.0, 5.0  # m/s2
CHANGES = (0.2, 0.6)  # lane changes per vehicle-km
HEADWAY = (1.2, 2.5)  # seconds, the median
ABOVE = (0.03, 0.6)  # share of the steady free speeds that are above the limit
_SMOOTH = 0.3  # seconds over which accelerations across are averaged
_ENTERED = 5.0  # seconds after an entry
_BRAKES, _ONSET = 1.0, 3.0  # m/s2 that count as braking; seconds before a peak in which its begin is searched
_CHANGED = 0.75  # widths of a lane, from the middle of the old lane
_DRIFT = 0.05  # m/s sideways at which a lane change begins and ends
_UNDONE = 6.0  # seconds after a change within which its reverse begins
_FOLLOWS, _MOVES = 100.0, 5.0  # metres to the leader; m/s of both
_FREE, _STEADY = 5.0, 0.3  # seconds to the leader; m/s2
_SAMPLES = 300  # seconds of observation, the least from which a share or a median is judged


@dataclass(frozen=True)
class LaneChange:
    """A change of a vehicle to an adjacent lane."""

    vehicle: int
    start: float
    crossing: float  # of the line between the lanes
    end: float
    side: int  # 1: to the left, -1: to the right


@dataclass
class Driving:
    """The measurements of all vehicles in one run. Quantiles of nothing are NaN."""

    crashes: list[str] = field(default_factory=list)  # contacts between vehicles
    lateral: float = 0.0  # the peak
    entry_braking: float = 0.0  # the peak
    hard_brakings: int = 0
    kilometres: float = 0.0  # on roads with several lanes
    changes: list[LaneChange] = field(default_factory=list)
    undone: float = float("nan")  # share of the changes
    duration: float = float("nan")  # median of the changes
    headways: Array = field(default_factory=lambda: np.zeros(0))  # of followers, from bumper to bumper, each second
    speeds: Array = field(default_factory=lambda: np.zeros(0))  # free and steady, relative to the limit, each second
    messages: list[str] = field(default_factory=list)

    @property
    def change_rate(self) -> float:
        """Lane changes per vehicle-km."""
        return len(self.changes) / self.kilometres if self.kilometres else float("nan")

    @property
    def above(self) -> float:
        """Share of the speeds that are above the limit by over 1 %."""
        return float((self.speeds > 1.01).mean()) if len(self.speeds) else float("nan")

    def faults(self) -> list[str]:
        """Return a message for each violation."""
        found = [*self.crashes, *self.messages]
        if self.kilometres and not CHANGES[0] <= self.change_rate <= CHANGES[1]:
            found.append(f"{self.change_rate:.2f} lane changes per vehicle-km")
        if self.kilometres and len(self.headways) >= _SAMPLES:  # in towns, vehicles approach queues
            median = float(np.median(self.headways))
            if not HEADWAY[0] <= median <= HEADWAY[1]:
                found.append(f"the median headway is {median:.2f} s")
            if self.headways.min() >= 1.0:
                found.append("no headway is under 1 s")
        if len(self.speeds) >= _SAMPLES and not ABOVE[0] <= self.above <= ABOVE[1]:
            found.append(f"{self.above:.0%} of the free speeds are above the limit")
        return found


def quantiles(values: Array, *shares: float) -> list[float]:
    """Return quantiles of values; NaN if there are none."""
    return [float(np.quantile(values, share)) if len(values) else float("nan") for share in shares]


def measure(tracks: Tracks, group: Sequence[int]) -> Driving:
    """Measure the vehicles of a group (numbers of actors)."""
    made = Driving(crashes=list(_crashes(tracks)))
    usable = tracks.together() & ~tracks.touched
    along, across = _accelerations(tracks, usable)
    mean = np.full(max(1, round(_SMOOTH * tracks.fps)), 1.0)
    peaks = np.abs(np.stack([np.convolve(across[:, n], mean / len(mean), "same") for n in group], axis=-1))
    made.lateral = float(peaks.max(initial=0.0))
    if made.lateral > LATERAL:
        frame, column = np.unravel_index(int(np.argmax(peaks)), peaks.shape)
        n, count = group[int(column)], int((peaks.max(axis=0) > LATERAL).sum())
        made.messages.append(
            f"{count} of {len(group)} vehicles accelerate sideways by over {LATERAL:g} m/s2, {tracks.name(n)} by "
            f"{made.lateral:.1f} at {frame / tracks.fps:.1f} s and {tracks.speed[frame, n]:.1f} m/s"
        )
    _measure_braking(tracks, along, group, made)
    lanes = _Lanes(tracks)
    _measure_changes(tracks, lanes, group, made)
    _measure_following(tracks, lanes, along, usable, group, made)
    return made


def _crashes(tracks: Tracks) -> Iterator[str]:
    """Return the contacts between vehicles."""
    for pair, times in tracks.pairs.items():
        both = sorted(pair)
        if len(both) == 2 and all(tracks.scene.actors[n].category == "vehicle" for n in both):
            yield f"{tracks.name(both[0])} and {tracks.name(both[1])} collide at {times[0][0] + 0.5:.1f} s"


def _accelerations(tracks: Tracks, usable: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return [F, A] accelerations along the heading and to the left of it; 0 where the motion is not usable."""
    found = np.zeros((*usable.shape, 2))
    found[1:-1] = np.diff(tracks.at[..., :2], n=2, axis=0) * tracks.fps**2
    found[~usable] = 0.0
    ux, uy = np.moveaxis(tracks.ahead, -1, 0)
    return found[..., 0] * ux + found[..., 1] * uy, found[..., 1] * ux - found[..., 0] * uy


def _measure_braking(tracks: Tracks, along: Array, group: Sequence[int], made: Driving) -> None:
    hazards, fps = Hazards(tracks), tracks.fps
    for n in group:
        entries = np.flatnonzero(tracks.here[1:, n] & ~tracks.here[:-1, n]) + 1
        for frame in entries.tolist():
            braking = float(-along[frame : frame + int(_ENTERED * fps), n].min(initial=0.0))
            made.entry_braking = max(made.entry_braking, braking)
            if braking > ENTRY:
                made.messages.append(f"{tracks.name(n)} enters at {frame / fps:.1f} s and brakes by {braking:.1f} m/s2")
        hard = along[:, n] < -HARD
        for frame in (np.flatnonzero(hard[1:] & ~hard[:-1]) + 1).tolist():
            made.hard_brakings += 1
            onset = frame
            while onset > max(0, frame - _ONSET * fps) and along[onset - 1, n] < -_BRAKES:
                onset -= 1
            if hazards.ahead(n, onset) == hazards.ahead(n, frame) == "nothing":
                end = frame + int(np.argmin(hard[frame:]))
                made.messages.append(
                    f"{tracks.name(n)} brakes by {-along[frame : end + 1, n].min():.1f} m/s2 from "
                    f"{tracks.speed[onset, n]:.1f} m/s at {frame / fps:.1f} s with nothing in the way"
                )


class _Lanes:
    """Where vehicles are on the roads: limits, and lanes of carriageways.

    Attributes:
        limit: [F, A] m/s; NaN off the road.
        number: [F, A] lane, counted from the right, whole in the middle of a lane; NaN on streets and off the road.
        width: Of a lane; 0 without carriageways.
    """

    def __init__(self, tracks: Tracks) -> None:
        self.limit = np.full(tracks.here.shape, np.nan)
        self.number = np.full(tracks.here.shape, np.nan)
        self.width = 0.0
        for element in tracks.scene.town.elements:
            if element.kind not in ("road", "carriageway"):
                continue
            yaw = np.radians(element.pose.yaw)
            d = tracks.at[..., :2] - [element.pose.x, element.pose.y]
            aside = d[..., 1] * np.cos(yaw) - d[..., 0] * np.sin(yaw)
            on = np.abs(d[..., 0] * np.cos(yaw) + d[..., 1] * np.sin(yaw)) <= element.size[0] / 2
            on &= np.abs(aside) <= element.size[1] / 2
            self.limit[on] = element.shape["limit"] / 3.6
            if element.kind == "carriageway":
                self.width = element.shape["lane"]
                from_right = aside + element.size[1] / 2 - element.shape["shoulder"]
                self.number[on] = from_right[on] / self.width - 0.5


def _measure_changes(tracks: Tracks, lanes: _Lanes, group: Sequence[int], made: Driving) -> None:
    together = tracks.together()
    for n in group:
        on = together[:, n] & ~np.isnan(lanes.number[:, n])
        made.kilometres += float(tracks.speed[on, n].sum()) / tracks.fps / 1000.0
        edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2).tolist():
            number = lanes.number[first:last, n]
            made.changes += _changes(n, number, first, lanes.width, tracks.fps)
    if made.changes:
        later = {}  # the next change of the same vehicle
        for one, two in zip(made.changes, made.changes[1:], strict=False):
            if one.vehicle == two.vehicle:
                later[one] = two
        undone = [b.side == -a.side and b.start - a.end < _UNDONE for a, b in later.items()]
        made.undone = sum(undone) / len(made.changes)
        made.duration = float(np.median([change.end - change.start for change in made.changes]))


def _changes(vehicle: int, number: Array, first: int, width: float, fps: int) -> Iterator[LaneChange]:
    """Yield the lane changes in a continuous motion, given the lane at each frame; the first frame is `first`."""
    if len(number) < 3:
        return
    drift = np.abs(np.gradient(number)) * width * fps > _DRIFT
    lane = round(float(number[0]))
    for k in np.arange(len(number)).tolist():
        if abs(number[k] - lane) <= _CHANGED:
            continue
        side = 1 if number[k] > lane else -1
        crossing = k
        while crossing > 0 and (number[crossing] - lane) * side > 0.5:
            crossing -= 1
        start, end = crossing, k
        while start > 0 and drift[start - 1]:
            start -= 1
        while end + 1 < len(number) and drift[end + 1]:
            end += 1
        yield LaneChange(vehicle, (first + start) / fps, (first + crossing) / fps, (first + end) / fps, side)
        lane += side


def _measure_following(
    tracks: Tracks, lanes: _Lanes, along: Array, usable: NDArray[np.bool_], group: Sequence[int], made: Driving
) -> None:
    vehicles = np.array([a.category == "vehicle" for a in tracks.scene.actors])
    motor = np.array([n in group and "bicycle" not in a.blueprint for n, a in enumerate(tracks.scene.actors)])
    headways, speeds = [], []
    for frame in range(0, len(tracks.at), tracks.fps):
        gap, leader = _leaders(tracks, lanes, frame, vehicles)
        speed = tracks.speed[frame]
        follows = motor & usable[frame] & (gap < _FOLLOWS) & (speed > _MOVES) & (speed[leader] > _MOVES)
        headways.append(gap[follows] / speed[follows])
        free = motor & usable[frame] & (gap > _FREE * speed) & (np.abs(along[frame]) < _STEADY) & (speed > 1.0)
        free &= ~np.isnan(lanes.limit[frame])
        speeds.append(speed[free] / lanes.limit[frame, free])
    made.headways, made.speeds = np.concatenate(headways), np.concatenate(speeds)


def _leaders(tracks: Tracks, lanes: _Lanes, frame: int, vehicles: NDArray[np.bool_]) -> tuple[Array, NDArray[np.int64]]:
    """Return [A] the gap to the vehicle ahead in the same lane, from bumper to bumper, and its number.

    The gap is infinite if there is none. On streets, the lane is straight ahead.
    """
    at, ahead = tracks.at[frame, :, :2], tracks.ahead[frame]
    d = at[None] - at[:, None]  # [follower, leader]
    along = d[..., 0] * ahead[:, None, 0] + d[..., 1] * ahead[:, None, 1]
    aside = d[..., 1] * ahead[:, None, 0] - d[..., 0] * ahead[:, None, 1]
    alike = ahead @ ahead.T > 0.9
    number = lanes.number[frame]
    same = np.where(np.isnan(number)[:, None], np.abs(aside) < 1.5, np.abs(number[:, None] - number[None]) < 0.5)
    present = tracks.here[frame] & vehicles
    gap = along - tracks.half[:, None, 0] - tracks.half[None, :, 0]
    gap = np.where(same & alike & (along > 0.0) & present[None] & present[:, None], np.maximum(gap, 0.0), np.inf)
    leader = np.argmin(gap, axis=1)
    return gap[np.arange(len(gap)), leader], leader
