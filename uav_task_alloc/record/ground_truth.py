# SPDX-License-Identifier: Apache-2.0
"""Where the simulated vehicles really were: the judge of a run, apart from what any node says."""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.geometry.zones import distance
from uav_task_alloc.model import Point
from uav_task_alloc.record.run_state import Line, SeenZone, read_lines

FILE = 'flight.jsonl'
SAME_PLACE = 1.5  # [m] between a task and an item that flies it
_STEP = 1.0  # [m] between points of a track that are held against the zones


@dataclass(frozen=True, slots=True)
class TrueSample:
    """A vehicle at one moment."""

    wall: float  # [unix s]
    point: Point  # [m]


@dataclass(frozen=True, slots=True)
class Reached:
    """A mission item was reached; `point` is its target as stored on board."""

    uav: str
    wall: float  # [unix s]
    point: Point  # [m]


@dataclass(frozen=True, slots=True)
class ZoneEntry:
    """A vehicle flew into a zone."""

    uav: str
    zone: str
    wall: float  # [unix s]
    point: Point  # [m]


@dataclass
class Truth:
    """Tracks and events of all vehicles."""

    tracks: dict[str, list[TrueSample]] = field(default_factory=dict)
    reached: list[Reached] = field(default_factory=list)
    died: dict[str, TrueSample] = field(default_factory=dict)

    def take(self, line: Line) -> None:
        """Fold in one line of the simulator's log."""
        uav, wall = line['uav'], line['wall']
        event = line.get('event')
        if event is None and line.get('alive', True):
            self.tracks.setdefault(uav, []).append(
                TrueSample(wall, (line['x'], line['y'], line['z'])))
        elif event == 'item_reached':
            self.reached.append(Reached(uav, wall, (line['x'], line['y'], line['z'])))
        elif event == 'died' and self.tracks.get(uav):
            self.died[uav] = TrueSample(wall, self.tracks[uav][-1].point)

    def metres(self) -> float:
        """Length of all tracks [m]."""
        return math.fsum(polyline_length([sample.point for sample in track])
                         for track in self.tracks.values())


def read_truth(out_dir: Path) -> Truth:
    """The simulator's log of a run."""
    truth = Truth()
    for line in read_lines(out_dir / FILE):
        truth.take(line)
    return truth


def visits(truth: Truth, tasks: Mapping[str, Point]) -> dict[str, list[Reached]]:
    """Which items were reached at each task; an item counts for the task nearest to it."""
    found: dict[str, list[Reached]] = {name: [] for name in tasks}
    for reached in truth.reached:
        near = min(tasks, key=lambda name: math.dist(tasks[name], reached.point), default=None)
        if near is not None and math.dist(tasks[near], reached.point) <= SAME_PLACE:
            found[near].append(reached)
    return found


def entries(truth: Truth, zones: Sequence[SeenZone]) -> list[ZoneEntry]:
    """Every flight from outside into a zone as it is, without margin, while it was there.

    A zone that appears around a vehicle is not entered by it.
    """
    return [entry for uav, track in truth.tracks.items() for seen in zones
            for entry in _entries(uav, track, seen)]


def _entries(uav: str, track: Sequence[TrueSample], seen: SeenZone) -> Iterator[ZoneEntry]:
    outside = False  # known to be outside while the zone is there
    for wall, point in fine(track):
        if not seen.since <= wall < seen.until:
            outside = False
            continue
        within = distance(point, seen.zone) <= 0.0
        if within and outside:
            yield ZoneEntry(uav, seen.zone.id, wall, point)
        outside = not within


def fine(track: Sequence[TrueSample]) -> Iterable[tuple[float, Point]]:
    """(wall [unix s], point [m]) along a track, at most STEP apart."""
    for a, b in pairwise(track):
        steps = max(1, math.ceil(math.dist(a.point, b.point) / _STEP))
        for k in range(steps):
            share = k / steps
            x, y, z = (p + share * (q - p) for p, q in zip(a.point, b.point, strict=True))
            yield a.wall + share * (b.wall - a.wall), (x, y, z)
    if track:
        yield track[-1].wall, track[-1].point
