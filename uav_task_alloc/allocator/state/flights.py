# SPDX-License-Identifier: Apache-2.0
"""How each UAV flies its list: measured pace, time lost at stops, the task that it serves."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.fleet import LEAST_ENDURANCE, Fleet
from uav_task_alloc.allocator.state.flight_pace import (
    FlightPace,
    UavFlight,
    measured_stop,
)
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.wind import WindEstimate
from uav_task_alloc.model import Point, Task, Uav
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.rule import FORGOTTEN

_SAMPLE_PERIOD = 1.0  # [s] between two samples of the ground velocity of a UAV
_STEADY = 0.5  # [m/s2] largest acceleration of a sample
_MOVING = 0.3  # share of the cruise speed below which a UAV hovers, turns or lands
_FASTEST = 3.0  # times the cruise speed above which a velocity cannot be
_LEVEL = 0.5  # share of the climb or descent speed above which the vertical sets the pace
AT_HOME = 10.0  # [m] from its home within which a UAV on the ground is at its base
_AT_STOP = 3.0  # [m] within which a task is reached that has no radius of its own
_SMOOTHING = 0.3  # weight of a new time lost at a stop
_SHORTEST_LEG = 1.0  # [s] at full speed below which a leg says nothing about stops
_AT_WAIT = 10.0  # [m] from a stop within which a UAV waits there
_CIRCLE = 1.2  # times the radius of a hold within which a fixed wing waits
SHORTEST_WAIT = 1.0  # [s] of a wait before a leg; a shorter one is not flown
_LONGEST_STOP = 20.0  # [s] a longer delay is not that of a stop
_OWN_STOPS = 3  # stops after which a UAV has a mean of its own
_ERRORS = 2.0  # times the mean error that is expected
_SHORT = 10.0  # [s] a shorter leg has the relative error of one of that time
_USED = 0.95  # charge of a battery below which it may be changed
OVERDUE = 3.0  # times its turnaround after which nobody seems to change the battery of a UAV
_RETURN_HEIGHT = 60.0  # [m] above home: RTL_RETURN_ALT of PX4; RTL_ALT of ArduPilot is 15 m
_CONTINGENCY = 0.05  # of the endurance with a full battery, where no reserve is known
_TAKEOFF = 4.0  # [s] from the command until it climbs at its rate: arming, spooling up


def top_of(task: Task) -> float:
    """Return the height of a task [m] ENU: of its position, or the highest of its path.

    Args:
        task: at a point or along a path.

    Returns:
        [m].
    """
    return max(z for _, _, z in (task.path or (task.position,)))


@dataclass(slots=True)
class _Stops:
    """The smoothed time that stops cost [s], and how many were measured."""

    mean: float = 0.0
    count: int = 0

    def add(self, seconds: float) -> None:
        weight = max(_SMOOTHING, 1.0 / (self.count + 1))
        self.mean += weight * (seconds - self.mean)
        self.count += 1


@dataclass(slots=True)
class _Leg:
    """The leg that a UAV has begun at a completion, and how long it takes without a stop."""

    task: str  # at its end
    began: float  # [s]
    seconds: float  # planned, at full speed
    corners: float  # in stops
    service: float  # [s]
    predicted: float  # [s] with its stop


@dataclass(slots=True)
class _LegErrors:
    """By how much the flight times of legs differed from the predicted ones, smoothed."""

    seconds: float = 0.0  # [s]
    share: float = 0.0
    count: int = 0

    def add(self, error: float, predicted: float) -> None:
        weight = max(_SMOOTHING, 1.0 / (self.count + 1))
        self.seconds += weight * (abs(error) - self.seconds)
        self.share += weight * (abs(error) / max(predicted, _SHORT) - self.share)
        self.count += 1


class Flights:
    """Measures flights from reports and events; times are [s] of the published clock.

    Args:
        fleet, lists: the present state.
        params: returns the parameters in force.

    Arguments of methods:
        uav_id: of a UAV.
        stamp: [s] published clock.
    """

    def __init__(self, fleet: Fleet, lists: PublishedLists,
                 params: Callable[[], AllocatorParams]) -> None:
        self._fleet, self._lists, self._params = fleet, lists, params
        self.wind = WindEstimate()
        self._sampled: dict[str, tuple[float, tuple[float, float]]] = {}  # stamp and velocity
        self._reached: dict[str, tuple[str, float]] = {}  # task and stamp of the arrival
        self._all_stops, self._stops = _Stops(), dict[str, _Stops]()
        self._legs: dict[str, _Leg] = {}
        self._waits: dict[str, tuple[str, Point]] = {}  # the next task, and where it waits first
        self._errors: dict[str, _LegErrors] = {}
        self._reported: dict[str, float] = {}  # [s] stamp of the last report
        self._landed: dict[str, float] = {}  # [s] stamp since which it is on the ground at home

    def update(self, report: UavReport, stamp: float) -> None:
        """Measure by a report that is known to the fleet."""
        self._reported[report.uav_id] = stamp
        self._sample(report, stamp)
        home = self._fleet.records[report.uav_id].home
        if report.standby and math.dist(report.position, home) <= AT_HOME:
            self._landed.setdefault(report.uav_id, stamp)
        else:
            self._landed.pop(report.uav_id, None)
        stops = self._lists.get(report.uav_id).stops
        task = stops[0].task if stops else None
        leg = self._legs.get(report.uav_id)
        if leg is not None and stamp > leg.began and (
                task is None or leg.task != task.id or report.mode == 'HOLD'):
            del self._legs[report.uav_id]  # it flies elsewhere, or nowhere, or was held
        self._end_wait(report, [stop.task.id for stop in stops[:2]])
        reached = self._reached.get(report.uav_id, ('', 0.0))[0]
        if task is not None and reached == task.id and task.path:
            return  # it flies along its path
        if task is None or math.dist(report.position, stops[0].entry) > max(
                _AT_STOP, task.acceptance_radius or 0.0):
            self._reached.pop(report.uav_id, None)
        elif reached != task.id:
            self._reached[report.uav_id] = task.id, stamp

    def _end_wait(self, report: UavReport, ahead: Sequence[str]) -> None:
        """Note that a UAV waits no more: it has set out, or has another task.

        Args:
            report: of the UAV.
            ahead: ids of its next two tasks; the first may just be completed.
        """
        waits_for, place = self._waits.get(report.uav_id, ('', report.position))
        if waits_for not in ahead or math.dist(place, report.position) > (
                _AT_WAIT + _CIRCLE * report.hold_radius):
            self._waits.pop(report.uav_id, None)

    def _sample(self, report: UavReport, stamp: float) -> None:
        """Take the ground velocity of steady level flight."""
        if report.velocity is None:
            return
        vx, vy, vz = report.velocity
        last = self._sampled.get(report.uav_id)
        if last is not None and 0.0 <= stamp - last[0] < _SAMPLE_PERIOD:
            return
        self._sampled[report.uav_id] = stamp, (vx, vy)
        planned = self._planned(report)
        steady = last is not None and 0.0 < stamp - last[0] < 5.0 * _SAMPLE_PERIOD and (
            math.dist(last[1], (vx, vy)) <= _STEADY * (stamp - last[0]))
        level = -_LEVEL * planned.descent < vz < _LEVEL * planned.climb
        moving = _MOVING * planned.speed < math.hypot(vx, vy) < _FASTEST * planned.speed
        if steady and level and moving and report.active_task:
            self.wind.add(report.uav_id, planned.speed, (vx, vy), stamp)

    def completed(self, uav_id: str, task_id: str, stamp: float) -> None:
        """Measure by the completion of the first task of a list that is still in force."""
        leg = self._legs.pop(uav_id, None)
        if leg is not None and leg.task == task_id:
            flown = stamp - leg.began - leg.service
            if abs(flown - leg.seconds) < _LONGEST_STOP and leg.seconds > _SHORTEST_LEG:
                lost = measured_stop(leg.seconds, flown, leg.corners)
                self._all_stops.add(lost)
                self._stops.setdefault(uav_id, _Stops()).add(lost)
                self._errors.setdefault(uav_id, _LegErrors()).add(flown - leg.predicted,
                                                                  leg.predicted)
        stops = self._lists.get(uav_id).stops
        if (uav_id not in self._fleet.records or len(stops) < 2
                or stops[0].task.id != task_id):
            return
        following = stops[1]
        way = stops[0].exit, *following.line
        pace = self.pace(uav_id)
        seconds, predicted = pace.seconds(way), pace.from_stop(way)
        begins = max(following.task.earliest, following.begin_after)
        if max(begins - predicted, following.task.release) > stamp + SHORTEST_WAIT:
            self._waits[uav_id] = following.task.id, stops[0].exit
        elif max(begins - seconds, following.task.release) < stamp:
            self._legs[uav_id] = _Leg(following.task.id, stamp, seconds, pace.corners(way),
                                      following.task.stay, predicted)

    def clock_jumped(self, by: float) -> None:
        """Drop what was measured across a jump of the published clock, and shift the rest.

        Args:
            by: [s] of the jump.
        """
        self._legs.clear()
        self._waits.clear()
        self._sampled.clear()
        self._reached = {uav_id: (task_id, stamp + by)
                         for uav_id, (task_id, stamp) in self._reached.items()}
        for stamps in (self._landed, self._reported):
            stamps.update((uav_id, stamp + by) for uav_id, stamp in stamps.items())

    def forget(self, uav_id: str) -> None:
        """Drop what is kept of a UAV."""
        self.wind.forget(uav_id)
        for kept in (self._sampled, self._reached, self._stops, self._legs, self._landed,
                     self._waits, self._errors, self._reported):
            kept.pop(uav_id, None)

    def serving(self, uav_id: str) -> str:
        """Return the task that a UAV has reached and not completed; '' for none."""
        return self._reached.get(uav_id, ('', 0.0))[0]

    def of(self, uav_id: str, stamp: float) -> UavFlight | None:
        """Return the flight of a UAV; None where it has not reported."""
        record = self._fleet.records.get(uav_id)
        if record is None:
            return None
        task_id, reached = self._reached.get(uav_id, ('', stamp))
        errors, report = self._errors.get(uav_id, _LegErrors()), record.report
        top = record.home[2] + report.takeoff_height if report.takeoff_height else -math.inf
        return UavFlight(
            report.position, self.pace(uav_id), stamp, on_ground=report.standby,
            climbing=report.mode == 'TAKEOFF', serving=task_id,
            served=max(0.0, stamp - reached),
            waiting=self._waits.get(uav_id, ('',))[0], home=record.home, velocity=report.velocity,
            takeoff_top=top, late=errors.seconds,
            time_error=_ERRORS * errors.share if errors.count >= _OWN_STOPS else math.inf)

    def is_forgotten(self, uav_id: str, stamp: float) -> bool:
        """Return whether a UAV has been silent for so long that others need not keep apart.

        Args:
            uav_id: of a UAV.
            stamp: [s] published clock.
        """
        record = self._fleet.records.get(uav_id)
        return record is not None and record.silent and (
            stamp - self._reported.get(uav_id, -math.inf) > FORGOTTEN)

    def reported_at(self, uav_id: str) -> float:
        """Return when a UAV reported last [s]; inf: not since the clock jumped."""
        return self._reported.get(uav_id, math.inf)

    def at_home_since(self, uav_id: str) -> float | None:
        """Return since when a UAV is on the ground at its home [s]; None: it is not."""
        return self._landed.get(uav_id)

    def in_battery_change(self, uav_id: str, stamp: float | None = None) -> bool:
        """Return whether the battery of a UAV may be out, so that its silence is no fault.

        Args:
            uav_id: of a known UAV.
            stamp: [s] published clock; None: just after its landing.

        Returns:
            True for one without tasks at its base, with a used battery, for three times its
            turnaround.
        """
        record, landed = self._fleet.records[uav_id], self._landed.get(uav_id)
        turnaround, battery = record.report.turnaround, record.battery
        if landed is None or turnaround is None or battery is None or battery >= _USED or (
                self._lists.get(uav_id).stops):
            return False
        return stamp is None or stamp - landed <= OVERDUE * turnaround

    def silence(self, uav_id: str) -> tuple[str, bool]:
        """Return the line of the log about a UAV that reports no more, and whether it warns."""
        text = f'{uav_id} silent for {self._params().uav_timeout:g} s'
        if self.in_battery_change(uav_id):
            return f'{text} at its base: its battery may be out', False
        return f'{text}: its tasks go to the others', True

    @property
    def stop_time(self) -> float:
        """The time that a stop costs the UAVs of the fleet on average [s]; see `pace`."""
        if self._all_stops.count:
            return self._all_stops.mean
        usual = [self._planned(record.report).usual_stop
                 for record in self._fleet.records.values()]
        return sum(usual) / len(usual) if usual else 0.0

    def pace(self, uav_id: str) -> FlightPace:
        """Return how fast a known UAV flies: as measured where it was, else as planned.

        A stop costs what was measured of the UAV, else of the fleet, else what it costs a usual
        copter.
        """
        planned = self._planned(self._fleet.records[uav_id].report)
        speed, wind = self.wind.of(uav_id, planned.speed)
        own, stop_time = self._stops.get(uav_id), planned.usual_stop
        if own is not None and own.count >= _OWN_STOPS:
            stop_time = own.mean
        elif self._all_stops.count:
            stop_time = self._all_stops.mean
        return FlightPace(speed, planned.climb, planned.descent, wind, stop_time, _TAKEOFF)

    def spendable(self, uav: Uav, top: float) -> Uav:
        """Return a UAV with the endurance that is left for its legs.

        A vehicle climbs before it flies. It returns at the height of its tasks or that of its
        return mode, if that is more, and comes down over its home. A leg counts the slower of its
        horizontal and its vertical motion only. _CONTINGENCY is for what no plan foresees, such
        as an upload on the way; where the charge is known the reserve is for that.

        Args:
            uav: with its endurance.
            top: [m] height of the highest task.

        Returns:
            The UAV itself where it has no endurance.
        """
        if math.isinf(uav.endurance):
            return uav
        home = uav.home or uav.position
        height = max(0.0, top - home[2])
        down = 0.0
        if self._params().route_end == 'home':
            most = max(height, _RETURN_HEIGHT)
            down = (most - height) / uav.climb_speed + most / uav.descent_speed
        up = self.pace(uav.id).takeoff + height / uav.climb_speed
        full = uav.full_endurance
        if self._fleet.records[uav.id].battery is None:
            down += _CONTINGENCY * (uav.endurance if full is None else full)
        left = uav.endurance - down - (up if uav.at_base else 0.0)
        return replace(
            uav, endurance=max(LEAST_ENDURANCE, left),
            full_endurance=None if full is None else max(LEAST_ENDURANCE, full - up - down))

    def _planned(self, report: UavReport) -> FlightPace:
        params = self._params()
        return FlightPace(report.cruise_speed or params.default_cruise_speed,
                          report.climb_speed or params.default_climb_speed,
                          report.descent_speed or params.default_descent_speed)
