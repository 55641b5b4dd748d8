# SPDX-License-Identifier: Apache-2.0
"""The times of a plan: departures, arrivals, starts of services, ends of routes."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone

_WALL = 1e8  # [s] times of a ROS clock above it are of the wall clock, below it simulated


@dataclass(frozen=True, slots=True)
class Timetable:
    """When each UAV takes off, each task is reached and served, and each route ends.

    All times in [s] from the moment of the plan.

    Attributes:
        arrivals: at each task served, by task id.
        starts: of the services, by task id: after `arrivals` where the UAV waits there.
        trips: task ids of each trip, by UAV id; at the end of each but the last the UAV visits
            its base.
        departures: of each trip, by UAV id.
        ends: of each route with tasks, by UAV id: the end of the last service, or at home.
        response: [s] value-weighted mean time from the announcement to the start of the service.
        late: [s] by which services start after `latest`, by task id, where any do.
    """

    arrivals: Mapping[str, float] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)
    trips: Mapping[str, tuple[tuple[str, ...], ...]] = field(default_factory=dict)
    departures: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    ends: Mapping[str, float] = field(default_factory=dict)
    response: float = 0.0
    late: Mapping[str, float] = field(default_factory=dict)


def clock_text(seconds: float, now: float | None = None) -> str:
    """Return a time of a ROS clock for people.

    Args:
        seconds: [s] of the clock; finite.
        now: [s] of the clock; None: unknown.

    Returns:
        `95.0 s` of a simulated clock; of the wall clock `12:30:05 UTC`, with the day where that
        is not the day of `now`.
    """
    if seconds < _WALL:
        return f'{seconds:.1f} s'
    then = datetime.fromtimestamp(seconds, timezone.utc)
    today = now is not None and now >= _WALL and (
        datetime.fromtimestamp(now, timezone.utc).date() == then.date())
    return then.strftime('%H:%M:%S UTC' if today else '%Y-%m-%d %H:%M:%S UTC')
