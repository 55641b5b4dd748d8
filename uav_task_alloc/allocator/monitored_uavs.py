# SPDX-License-Identifier: Apache-2.0
"""What each UAV does next, by its reports, list and holds, for the monitor of separation.

Who keeps its way, the first first: UAVs that the allocator does not fly (a pilot, another station,
silent), one that an operator holds, one that lands, takes off or is low on battery, one that
returns; then the one that is earlier at its next stop; last, those on the ground.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.report_ages import ReportAges
from uav_task_alloc.allocator.sent_lists import SentLists
from uav_task_alloc.allocator.state.fleet import UavRecord, above_reserve
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.timed_ways import (
    MOVES,
    TimedPoints,
    seems_to_return,
    timed_along,
    timed_drift,
    timed_home,
    timed_own_return,
    top_of_climb,
)
from uav_task_alloc.geometry.polyline import points_passed
from uav_task_alloc.model import Point
from uav_task_alloc.separation.monitor import MonitoredUav
from uav_task_alloc.separation.prediction import HORIZON, Way
from uav_task_alloc.separation.rule import FORGOTTEN

_ARMING = 3.0  # [s] on the ground before it climbs
_SETS_OUT = 4.0  # [s] between the end of a take-off and the leg
_SPARE = 60.0  # [s] at least for which a UAV that is low on battery could hold
FOREIGN_CLAIM, HELD_CLAIM = 9.0, 8.0  # see above
_URGENT, _RETURNS, _FLIES, _WAITS = 5.0, 3.0, 1.0, 0.0  # claims
_STAYS = 'has no tasks and stays: a task for it, or its return, ends that'
_GIVES_WAY = 'has no tasks: it gives way where that is safe, else a task or its return ends that'
_OURS = ('', 'UNKNOWN', 'HELD')  # authority over a UAV in the air that flies its list


class MonitoredUavs:
    """The UAVs as the monitor takes them, by the state of the world.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world, self._sent, self._ages = world, SentLists(world), ReportAges(world)

    def at(self, stamp: float) -> dict[str, MonitoredUav]:
        """Return what each UAV does next, without those on the ground to stay, and lost ones.

        Args:
            stamp: [s] published clock.

        Returns:
            By id.
        """
        records = self._world.uav_records()
        self._sent.update()
        self._ages.forget_removed()
        return {uav_id: each for uav_id, record in records.items()
                if (each := self._monitored(uav_id, record, stamp)) is not None}

    def clock_jumped(self, by: float) -> None:
        """Shift since when UAVs are silent with the published clock.

        Args:
            by: [s] of the jump.
        """
        self._ages.clock_jumped(by)

    def _monitored(self, uav_id: str, record: UavRecord, stamp: float
                   ) -> MonitoredUav | None:
        """A UAV with what it does next; None: it is on the ground to stay, or lost."""
        report, flight = record.report, self._world.flights.of(uav_id, stamp)
        hold = self._world.orders.holds.get(uav_id)
        is_held = hold is not None and hold.hold
        silent = self._ages.silent_for(uav_id, record, stamp)
        age = self._ages.age(uav_id, record, stamp)
        if silent > FORGOTTEN or flight is None:
            return None
        if report.standby:
            stops = self._stops(uav_id, stamp, flight)
            if not stops or is_held or not self._world.usable(uav_id):
                return None
            way = self._way(record, self._list_points(self._world.list_of(uav_id), stops, flight,
                                                      True))
            return MonitoredUav(way, (_WAITS, -stops[0].start), early=True)
        if record.silent or report.foreign or report.mode == 'FAULT' or (
                report.authority not in _OURS):
            why = 'is silent' if record.silent else 'is not flown by the allocator'
            points = (timed_own_return(record, flight.pace)
                      if not silent and seems_to_return(record)
                      else timed_drift(record, age))
            way = self._way(record, points)
            if record.silent:  # it may fly its list on
                way = replace(way, on_board=tuple((t - age, point) for t, point in (
                    self._along_reported(uav_id, record, flight))))
            return MonitoredUav(way, (FOREIGN_CLAIM,), False, f'{uav_id} {why}',
                                stays=why if way.speed < MOVES else '')
        if is_held:
            return MonitoredUav(self._way(record, [(0.0, report.position)]), (HELD_CLAIM,), False,
                                f'an operator holds {uav_id}')
        each = self._flying(uav_id, record, flight, stamp)
        return replace(each, way=replace(each.way, on_board=tuple(
            self._on_board(uav_id, record, flight))))

    def _on_board(self, uav_id: str, record: UavRecord, flight: UavFlight) -> TimedPoints:
        """Where a UAV is until the list in force is on board; []: it is, or nothing is known.

        During an upload, which may take long or begin again, one autopilot flies its mission on,
        and another one stands.
        """
        report = record.report
        if report.list_revision == self._world.list_of(uav_id).revision:
            return []
        if report.mode == 'HOLD':
            return [(0.0, flight.position)]
        return self._along_reported(uav_id, record, flight)

    def _along_reported(self, uav_id: str, record: UavRecord, flight: UavFlight) -> TimedPoints:
        """Along the list that a UAV in mission mode reports to be on board; []: not known."""
        report = record.report
        each = self._sent.sent(uav_id, report.list_revision)
        if each is None or report.mode not in ('ON_MISSION', 'RETURNING'):
            return []
        stops = [stop for stop in timed_stops(each.stops, flight)
                 if self._world.tasks.is_open(stop.task.id)]
        begin = next((k for k, stop in enumerate(stops) if stop.task.id == report.active_task), 0)
        if stops:
            return self._list_points(each, stops[begin:], flight)
        return self._way_home(each, record, flight) if each.returns else []

    def _flying(self, uav_id: str, record: UavRecord, flight: UavFlight, stamp: float
                ) -> MonitoredUav:
        """A UAV that flies for the allocator."""
        mode, place = record.report.mode, record.report.position
        if mode == 'LANDING':
            end = (place[0], place[1], min(place[2], record.home[2]))
            down = [(0.0, place), (flight.pace.seconds((place, end)), end)]
            return MonitoredUav(self._way(record, down), (_URGENT,), False, f'{uav_id} lands')
        stops = self._stops(uav_id, stamp, flight)
        # one on its way home that got a task turns round within seconds
        returns = not stops and (mode == 'RETURNING' or self._world.list_of(uav_id).returns)
        if mode == 'TAKEOFF':  # whatever follows; for how long is not known
            top = top_of_climb(record, stops[0].entry[2] if stops else place[2])
            points = [(0.0, place), (flight.pace.seconds((place, top)), top)]
            if returns:
                points = timed_home(points, record, flight.pace,
                                    self._world.list_of(uav_id).end_via)
            return MonitoredUav(self._way(record, points), (_URGENT,), False,
                                f'{uav_id} takes off')
        if record.low or returns:
            way = self._way(record, self._way_home(self._world.list_of(uav_id), record,
                                                   flight))
            if not record.low:
                return MonitoredUav(way, (_RETURNS,), early=True)
            spare = self._spare(record, flight, way.points[-1][0])
            return MonitoredUav(way, (_URGENT, -spare), False, f'{uav_id} is low on battery',
                                early=True, if_need_be=spare > _SPARE)
        points = self._list_points(self._world.list_of(uav_id), stops, flight)
        to_place, stays = () if stops else self._way_to_place(uav_id, place), ''
        if to_place:
            points = timed_along([(0.0, place)], to_place, flight.pace, flight.share(to_place[0]))
        elif not stops:
            placed = self._world.list_of(uav_id).waiting_place is not None
            waits = mode == 'HOLD' or placed
            stays = _GIVES_WAY if self._world.params.approval == 'none' else _STAYS
            points = [(0.0, place)] if waits else timed_drift(record)
        return MonitoredUav(self._way(record, points),
                            (_FLIES, -stops[0].start if stops else -math.inf),
                            bool(stops or to_place), stays=stays)

    def _spare(self, record: UavRecord, flight: UavFlight, seconds_home: float) -> float:
        """[s] for which a UAV may hold and still land with half of its reserve."""
        metres, seconds = above_reserve(record.report, record.battery,
                                        0.5 * self._world.params.battery_reserve)
        if metres is None:
            return 0.0
        most = metres / flight.pace.speed
        return (most if seconds is None else min(most, seconds)) - seconds_home

    def _way_to_place(self, uav_id: str, place: Point) -> tuple[Point, ...]:
        """The points ahead on the way to a waiting place; (): it is there, or has none."""
        each = self._world.list_of(uav_id)
        if each.waiting_place is None or math.dist(place, each.waiting_place) < MOVES:
            return ()
        return each.end_via[points_passed(place, each.end_via):]

    def _way_home(self, each: UavList, record: UavRecord, flight: UavFlight) -> TimedPoints:
        """The points of a list on the way home that are ahead, else its own return."""
        via, place = each.end_via, flight.position
        if not via:
            return timed_own_return(record, flight.pace)
        ahead = via[flight.passed(via):]
        share = flight.share(ahead[0] if ahead else (*record.home[:2], place[2]))
        return timed_home([(0.0, place)], record, flight.pace, ahead, share)

    def _way(self, record: UavRecord, points: TimedPoints) -> Way:
        report = record.report
        return Way(tuple(points), math.hypot(*(report.velocity or (0.0,))),
                   report.standby, report.hold_radius, record.home)

    def _stops(self, uav_id: str, stamp: float, flight: UavFlight) -> tuple[ListStop, ...]:
        """The open stops of the list in force, with their times from now."""
        return tuple(stop for stop in self._world.lists.restamped(uav_id, stamp, flight).stops
                     if self._world.tasks.is_open(stop.task.id))

    def _list_points(self, each: UavList, stops: Sequence[ListStop], flight: UavFlight,
                     climbs: bool = False) -> TimedPoints:
        """Where a UAV is and when [s from now], along the stops of a list in the next 30 s."""
        record = self._world.uav_records()[each.uav]
        place = flight.position
        clock = _ARMING if flight.on_ground else 0.0
        points = [(0.0, place), (clock, place)]
        for k, stop in enumerate(stops):
            leg, share = stop.line, 0.0
            # as the bridge does, not at the task
            waits_before = k > 0 or flight.on_ground or flight.waiting == stop.task.id
            if waits_before and stop.wait > 0.0:
                clock += stop.wait
                points.append((clock, place))
            if k == 0:
                leg = leg[flight.passed(leg):]
                share = 0.0 if climbs or clock > 0.0 else flight.share(leg[0])
                if climbs:
                    top = top_of_climb(record, leg[0][2])
                    clock += flight.pace.seconds((place, top))
                    points += [(clock, top), (clock + _SETS_OUT, top)]
                    place, clock = top, clock + _SETS_OUT
            points = timed_along([*points, (clock, place)], leg, flight.pace, share)
            place = stop.exit
            clock = points[-1][0] + max(0.0, stop.task.stay - stop.served)
            clock += 0.0 if waits_before else stop.wait
            points.append((clock, place))
            if clock > HORIZON:
                return points
        return timed_home(points, record, flight.pace, each.end_via) if each.returns else points
