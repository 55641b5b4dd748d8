# SPDX-License-Identifier: Apache-2.0
"""The last moment to turn home of each UAV in flight: what its battery has above the reserve."""
from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

from uav_task_alloc.allocator.state.fleet import UavRecord, above_reserve
from uav_task_alloc.allocator.state.flight_pace import FlightPace, UavFlight
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point

_PERIOD = 1.0  # [s] between two checks, by the clock that is faster: steady or published
_CLOSE = 60.0  # [s] before the last moment in which the way home is searched for at each check
_SEARCH = 20.0  # [s] between two searches before that
_ASK_AGAIN = 5.0  # [s] between two plans that are requested for one UAV
_EXCESS = 0.02  # share by which a list may be beyond what is left: the next plan changes it
_TOLERANCE = 1.0  # [m]


class BatteryWatch:
    """Turns UAVs home in time, and requests plans for lists that a battery no longer carries.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.turns: dict[str, float] = {}  # [s] published clock: the last moment, by UAV
        self._checked = self._checked_at = -math.inf  # [s] steady clock, published clock
        self._ways: dict[str, tuple[Point, float, float]] = {}  # from where, metres, when
        self._asked: dict[str, float] = {}  # [s] steady clock

    def tick(self, now: float, stamp: float) -> None:
        """Check all UAVs in flight; `now` [s] steady, `stamp` [s] published clock."""
        world = self._world
        passed = abs(stamp - self._checked_at)
        if max(now - self._checked, passed) < _PERIOD or not world.kernels_ready:
            return
        # a simulated clock may be so fast that the last moment is between two checks
        lead = passed if _PERIOD < passed < _CLOSE and now - self._checked < passed else 0.0
        self._checked, self._checked_at = now, stamp
        turns: dict[str, float] = {}
        for uav_id, record in world.uav_records().items():
            metres, seconds = self._above_reserve(record)
            flight = self._planned_flight(uav_id, stamp) if metres is not None else None
            if metres is None or flight is None:
                self._ways.pop(uav_id, None)
                continue
            left = self._seconds_left(record, flight, now, metres, seconds)
            turns[uav_id] = stamp + left
            if record.low:
                continue
            if left < lead:
                world.fleet.turn(uav_id)
                world.note(f'{uav_id} turns home: the last moment by its battery '
                           f'({100.0 * (record.battery or 0.0):.0f} %)', warning=True)
                world.request_replan(f'{uav_id} turns home', now)
            elif now - self._asked.get(uav_id, -math.inf) >= _ASK_AGAIN and (
                    self._list_exceeds(record, flight, stamp)):
                self._asked[uav_id] = now
                world.request_replan(f'the battery of {uav_id} does not last for its list', now)
        self.turns = turns

    def texts(self, stamp: float) -> dict[str, str]:
        """Return the last moment of each UAV in flight for operators; `stamp` as of `tick`."""
        return {uav_id: f'at {turn:.0f} s, in {turn - stamp:.0f} s'
                for uav_id, turn in sorted(self.turns.items())}

    def _planned_flight(self, uav_id: str, stamp: float) -> UavFlight | None:
        """Where a UAV is, at planned speeds: the metres of its battery count what it flew slower.

        Winds measured in gusts on a single course can be far off; none may turn a UAV home.
        """
        flight = self._world.flights.of(uav_id, stamp)
        return flight and replace(flight, pace=FlightPace.of(self._world.uav(uav_id)))

    def _above_reserve(self, record: UavRecord) -> tuple[float | None, float | None]:
        """Metres and seconds; no metres: it is on the ground, or its range is not known."""
        report = record.report
        if report.standby or record.silent or report.range is None or record.battery is None:
            return None, None
        return above_reserve(report, record.battery, self._world.params.battery_reserve)

    def _seconds_left(self, record: UavRecord, flight: UavFlight, now: float, metres: float,
                      seconds: float | None) -> float:
        """[s] until it has to turn, with this much above the reserve of its battery."""
        report = record.report
        speed = flight.pace.speed
        landing = max(0.0, report.position[2] - record.home[2]) / flight.pace.descent
        for search in (False, True):
            way = self._way_home(record, now, search)
            left = (metres + _TOLERANCE - way) / speed
            if seconds is not None:
                left = min(left, seconds + _TOLERANCE - way / speed - landing)
            if left > _CLOSE:
                break
        return left

    def _way_home(self, record: UavRecord, now: float, search: bool) -> float:
        """[m] of a safe way home: at most the last one found and the way since then."""
        report, known = record.report, self._ways.get(record.report.uav_id)
        if known is not None and not search and now - known[2] < _SEARCH:
            return known[1] + math.dist(report.position, known[0])
        leg = self._world.airspace.paths().leg(report.position, record.home)
        metres = math.dist(report.position, record.home) if leg is None else leg.length
        self._ways[report.uav_id] = report.position, metres, now
        return metres

    def _list_exceeds(self, record: UavRecord, flight: UavFlight, stamp: float) -> bool:
        """Whether the battery does not last for the rest of the list."""
        world, report = self._world, record.report
        uav_list = world.list_of(report.uav_id)
        metres, seconds = above_reserve(report, record.battery, world.params.battery_reserve)
        if not uav_list.stops or metres is None:
            return False
        first = uav_list.stops[0]
        length = world.airspace.paths().rest(report.position, first.through, first.exit) or 0.0
        length += math.fsum(polyline_length((a.exit, *b.line))
                            for a, b in pairwise(uav_list.stops))
        if uav_list.returns:
            length += polyline_length((uav_list.stops[-1].exit, *uav_list.end_via,
                                       record.home))
        if length > (1.0 + _EXCESS) * metres:
            return True
        finish = finish_time(world.lists.restamped(report.uav_id, stamp, flight), flight)
        return seconds is not None and finish > (1.0 + _EXCESS) * seconds
