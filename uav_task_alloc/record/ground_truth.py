# SPDX-License-Identifier: Apache-2.0
"""The log of the simulator: true tracks, by which a run is judged independently of the nodes."""
from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from uav_task_alloc.geometry.polyline import point_at, polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.record.record_file import Line, read_lines
from uav_task_alloc.record.reported import ZoneInterval
from uav_task_alloc.record.run_state import RunState, read_record

TRUTH_FILE = 'flight.jsonl'
_VISIT_RADIUS = 1.5  # [m] between a task and the mission item of its visit
_SAME_PLACE = 0.1  # [m] between tasks that one item cannot tell apart
_NEARNESS = ('separation_lost', 'separation_regained', 'least_distance')  # events
_STEP = 1.0  # [m] between the points of a track that are tested against the zones


@dataclass(frozen=True, slots=True)
class TrueSample:
    """The position of a vehicle at one time."""

    wall: float  # [unix s]
    point: Point  # [m]


@dataclass(frozen=True, slots=True)
class Reached:
    """A mission item was reached; `point` is the target stored on board."""

    uav: str  # id
    wall: float  # [unix s]
    point: Point  # [m]


@dataclass(frozen=True, slots=True)
class ZoneEntry:
    """A vehicle flew into a zone."""

    uav: str
    zone: str
    wall: float  # [unix s]
    point: Point  # [m]


@dataclass(frozen=True, slots=True)
class TrueNearness:
    """How near two vehicles came in the air."""

    uavs: tuple[str, str]  # ids
    wall: float  # [unix s]
    horizontal: float  # [m]
    vertical: float  # [m], at the same time

    @property
    def distance(self) -> float:
        """Straight distance [m]."""
        return math.hypot(self.horizontal, self.vertical)


@dataclass
class GroundTruth:
    """Tracks and events of all simulated vehicles."""

    # samples by UAV, in order of time
    tracks: dict[str, list[TrueSample]] = field(default_factory=dict)
    reached: list[Reached] = field(default_factory=list)  # items reached, in order of time
    died: dict[str, TrueSample] = field(default_factory=dict)  # last sample by UAV that was lost
    losses: list[TrueNearness] = field(default_factory=list)  # of separation, in order of time
    least: list[TrueNearness] = field(default_factory=list)  # of all pairs that were in the air
    simulated: bool = False  # times are those of /clock

    def apply(self, line: Line) -> None:
        """Apply one line of the simulator's log.

        Args:
            line: with `uav`, `wall` and `clock` [unix s], and a position or an event.
        """
        uav, wall = line['uav'], line['clock' if self.simulated else 'wall']
        event = line.get('event')
        if event is None and line.get('alive', True):
            self.tracks.setdefault(uav, []).append(
                TrueSample(wall, (line['x'], line['y'], line['z'])))
        elif event == 'item_reached':
            self.reached.append(Reached(uav, wall, (line['x'], line['y'], line['z'])))
        elif event == 'died' and self.tracks.get(uav):
            self.died[uav] = TrueSample(wall, self.tracks[uav][-1].point)
        elif event in _NEARNESS:
            self._near(TrueNearness((uav, line['other']), wall, line['horizontal'],
                                    line['vertical']), event)

    def _near(self, found: TrueNearness, event: str) -> None:
        if event == 'least_distance':
            self.least.append(found)
            return
        if event == 'separation_regained':  # the line of its beginning has the distance then
            at = max(k for k, loss in enumerate(self.losses) if loss.uavs == found.uavs)
            found = min(found, self.losses.pop(at), key=lambda loss: loss.distance)
        self.losses.append(found)

    def least_distance(self) -> float | None:
        """The least distance of two vehicles in the air [m]; None: never two, or not judged."""
        return min((pair.distance for pair in [*self.least, *self.losses]), default=None)

    def metres(self) -> float:
        """Length of all tracks [m]."""
        return math.fsum(polyline_length([sample.point for sample in track])
                         for track in self.tracks.values())


def read_truth(out_dir: Path, simulated: bool = False) -> GroundTruth:
    """Read the simulator's log of a run.

    Args:
        out_dir: folder with flight.jsonl.
        simulated: times are those of /clock, as in the record of the run.

    Returns:
        Of all vehicles.

    Raises:
        OSError: the file cannot be read.
    """
    truth = GroundTruth(simulated=simulated)
    for line in read_lines(out_dir / TRUTH_FILE):
        truth.apply(line)
    return truth


def read_run(out_dir: Path) -> tuple[RunState, GroundTruth]:
    """Read the record and the simulator's log of a run, with times of one clock.

    Args:
        out_dir: folder with record.jsonl and flight.jsonl.

    Returns:
        What the nodes reported, and what was flown.

    Raises:
        OSError: a file cannot be read.
    """
    state = read_record(out_dir)
    return state, read_truth(out_dir, state.scale.simulated)


def visits(truth: GroundTruth, tasks: Mapping[str, Point], waited: Container[str] = (),
           owners: Mapping[str, str] = {}) -> dict[str, list[Reached]]:
    """The mission items reached at each task.

    Args:
        truth: of the run.
        tasks: positions [m] by id.
        waited: ids of tasks where UAVs may have waited: items that a UAV reaches there one after
            the other are one visit.
        owners: ids of the UAVs that completed tasks, by task id.

    Returns:
        By task id; an item counts for the nearest task, if that is within 1.5 m. Of several at
        one place it counts for one that its UAV completed, where there is one, and for each of
        them before it counts for one again.
    """
    visited: dict[str, list[Reached]] = {name: [] for name in tasks}
    last: dict[str, str | None] = {}  # task visited last, by UAV
    for reached in truth.reached:
        near = _nearest(reached.point, tasks)
        own = [name for name in near if owners.get(name) == reached.uav] or near
        name = min(own, key=lambda task: len(visited[task]), default=None)
        if name is not None and not (visited[name] and last.get(reached.uav) in own
                                     and any(task in waited for task in own)):
            visited[name].append(reached)
        last[reached.uav] = name
    return visited


def _nearest(point: Point, tasks: Mapping[str, Point]) -> list[str]:
    """The task that is nearest to a point, with those at its place; none beyond 1.5 m."""
    apart = {name: math.dist(place, point) for name, place in tasks.items()}
    least = min(apart.values(), default=math.inf)
    return [name for name, distance in apart.items()
            if least <= _VISIT_RADIUS and distance <= least + _SAME_PLACE]


def zone_entries(truth: GroundTruth, zones: Sequence[ZoneInterval]) -> list[ZoneEntry]:
    """Return every entry of a vehicle into a zone in force, without its margin.

    A vehicle around which a zone appears, or over which it moves, does not enter it.

    Args:
        truth: with all tracks.
        zones: with the times in which they were in force.

    Returns:
        By UAV and zone, not by time.
    """
    by_id: dict[str, list[ZoneInterval]] = {}
    for interval in sorted(zones, key=lambda each: each.since):
        by_id.setdefault(interval.zone.id, []).append(interval)
    return [entry for uav, track in truth.tracks.items() for intervals in by_id.values()
            for entry in _entries(uav, track, intervals)]


def _entries(uav: str, track: Sequence[TrueSample],
             intervals: Sequence[ZoneInterval]) -> Iterator[ZoneEntry]:
    """Entries into one zone, which may have changed from interval to interval."""
    from uav_task_alloc.geometry.zones import distance  # imports numba
    at, before = 0, None  # index of the interval; the point before, while the zone was in force
    for wall, point in resampled(track):
        while at < len(intervals) and wall >= intervals[at].until:
            at += 1
        if at == len(intervals):
            return
        zone = intervals[at].zone
        if wall < intervals[at].since:
            before = None
            continue
        if (before is not None and distance(point, zone) <= 0.0
                and distance(before, zone) > 0.0):
            yield ZoneEntry(uav, zone.id, wall, point)
        before = point


def resampled(track: Sequence[TrueSample]) -> Iterable[tuple[float, Point]]:
    """Return points of a track that are at most 1 m apart.

    Args:
        track: of one vehicle.

    Yields:
        Time [unix s] and place [m].
    """
    for a, b in pairwise(track):
        steps = max(1, math.ceil(math.dist(a.point, b.point) / _STEP))
        for k in range(steps):
            share = k / steps
            x, y, z = point_at(a.point, b.point, share)
            yield a.wall + share * (b.wall - a.wall), (x, y, z)
    if track:
        yield track[-1].wall, track[-1].point
