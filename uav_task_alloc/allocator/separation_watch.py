# SPDX-License-Identifier: Apache-2.0
"""Keeps UAVs apart in flight: steps the monitor of separation, and says what is predicted."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.allocator.monitored_uavs import FOREIGN_CLAIM, HELD_CLAIM, MonitoredUavs
from uav_task_alloc.allocator.obstructed_tasks import ObstructedTasks
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.timed_ways import timed_along
from uav_task_alloc.model import Point
from uav_task_alloc.separation.monitor import (
    AlertAction,
    MonitoredUav,
    MonitorStep,
    SeparationMonitor,
)
from uav_task_alloc.separation.prediction import FlightPredictions

_PERIOD = 0.5  # [s] of the published clock between two steps
_ASK_AGAIN = 10.0  # [s] between plans for UAVs that wait for each other
_PATIENCE = 10.0  # [s] for which one that waits by its list, or stands, is waited for
_RESTS = 1.0  # [m/s] below that a UAV stands
_PUT_OFF = 30.0  # [s] for which one that stands at a task is waited for there
_LONG, _LONG_AGAIN = 60.0, 300.0  # [s] of a hold until it is logged once more, and between those
_SHOWN = 60.0  # [s] of a hold from which its text says how long it lasts


class SeparationWatch:
    """Steps the monitor with the state of the world.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world, self.monitor = world, SeparationMonitor()
        self._monitored, self._obstructed = MonitoredUavs(world), ObstructedTasks(world)
        self._stepped = self._asked = -math.inf  # [s] published clock; of the last plan asked for
        # [s] published clock, by ids of a UAV that holds and of one that waits by its list, or
        # stands with a pilot
        self._both_wait: dict[tuple[str, str], float] = {}
        self._uavs: dict[str, MonitoredUav] = {}  # of the last step, by id
        # [s] published clock, since when each UAV holds, and when that is logged next, by id
        self._since: dict[str, tuple[float, float]] = {}

    def step(self, now: float, stamp: float, lists_changed: bool) -> MonitorStep:
        """Predict and decide, where it is time or lists have changed.

        Args:
            now: [s] steady clock.
            stamp: [s] published clock.
            lists_changed: some are about to be published: what they need comes first.

        Returns:
            What is to be published.
        """
        rule = separation_of(self._world.params)
        due = lists_changed or not 0.0 <= stamp - self._stepped < _PERIOD
        in_force = rule.on or self.monitor.holding or self.monitor.alerts
        if not due or not (in_force or self._world.obstructed):
            return MonitorStep()
        self._stepped = stamp
        self._uavs = self._monitored.at(stamp)
        step = self.monitor.step(stamp, self._uavs, rule)
        for alert in step.alerts:
            self._world.note(alert.text, warning=alert.action in (AlertAction.HOLD,
                                                                  AlertAction.UNRESOLVED))
        for one, other in step.unresolved:
            self._world.request_replan(f'{one} and {other} lose separation', now)
        self._world.stuck = self.monitor.stuck | self._waiting_for_held(stamp)
        if self._world.stuck and not 0.0 <= stamp - self._asked < _ASK_AGAIN:
            self._asked = stamp
            waiting = ', '.join(sorted(name for name in self._world.stuck
                                       if not self._stands(name)))
            stands = ', '.join(filter(self._stands, sorted(self._world.stuck)))
            self._world.request_replan(f'{waiting} wait for {stands or "each other"}', now)
        self._note_long_holds(stamp)
        standing = [*filter(self._stands, self._uavs)]
        if self._obstructed.update([pair for pair, since in self._both_wait.items()
                                    if stamp - since > _PUT_OFF and pair[1] in standing],
                                   standing, rule):
            self._world.request_replan('tasks where a UAV hovers', now)
        return step

    def _note_long_holds(self, stamp: float) -> None:
        """Warn of UAVs that go on holding: after a minute, and then every five."""
        self._since = {uav_id: self._since.get(uav_id, (stamp, stamp + _LONG))
                       for uav_id in self.monitor.holding}
        for uav_id, reason in self.monitor.holding.items():
            since, due = self._since[uav_id]
            if stamp >= due:
                self._since[uav_id] = since, stamp + _LONG_AGAIN
                self._world.note(f'{reason}: for {stamp - since:.0f} s by now', warning=True)

    def _stands(self, uav_id: str) -> bool:
        """Whether a UAV hovers that the allocator does not fly, as a pilot's."""
        each = self._uavs.get(uav_id)
        return each is not None and each.claim[0] == FOREIGN_CLAIM and each.way.speed < _RESTS

    def _waiting_for_held(self, stamp: float) -> frozenset[str]:
        """UAVs that hold for one that waits by its list or stands, and those."""
        waiting = {uav_id for uav_id in self._uavs if self._stands(uav_id) or ((
            flight := self._world.flights.of(uav_id, stamp)) is not None and flight.waiting)}
        pairs = {(uav_id, other) for uav_id, others in self.monitor.waits.items()
                 for other in others & waiting}
        self._both_wait = {pair: self._both_wait.get(pair, stamp) for pair in pairs}
        return frozenset(name for pair, since in self._both_wait.items()
                         if stamp - since > _PATIENCE for name in pair)

    def clock_jumped(self, by: float) -> None:
        """Shift since when UAVs are silent, or wait for each other, with the published clock.

        Args:
            by: [s] of the jump.
        """
        self._monitored.clock_jumped(by)
        self._both_wait.update((pair, stamp + by) for pair, stamp in self._both_wait.items())
        self._since = {uav_id: (since + by, due + by)
                       for uav_id, (since, due) in self._since.items()}

    def texts(self) -> dict[str, str]:
        """Return what is predicted for each UAV, by id."""
        found: dict[str, str] = {}
        for pair, alert in self.monitor.alerts.items():
            if alert.action is not AlertAction.RELEASE:
                seconds = self._stepped - self._since.get(alert.holder, (math.inf,))[0]
                text = alert.text + (f' (for {seconds:.0f} s)' if seconds >= _SHOWN else '')
                for uav_id in pair:
                    found[uav_id] = '; '.join(filter(None, (found.get(uav_id), text)))
        return found

    def waited_for(self) -> dict[str, str]:
        """Return the UAVs that keep another one from going on, by id the id of one of those.

        With both of two for which no hold keeps them apart, where the allocator flies both.
        """
        found = {other: uav_id for uav_id, others in sorted(self.monitor.waits.items())
                 for other in others}
        for pair, alert in self.monitor.alerts.items():
            uavs = [self._uavs[name] for name in pair if name in self._uavs]
            if alert.action is AlertAction.UNRESOLVED and len(uavs) == len(pair) and all(
                    each.claim[0] < HELD_CLAIM for each in uavs):
                found |= dict(zip(pair, pair[::-1], strict=True))
        return found

    def is_free(self, uav_id: str, line: Sequence[Point]) -> bool:
        """Return whether a UAV loses separation to nobody where it flies along a line, and stays.

        Args:
            uav_id: of a UAV in flight, as of the last step.
            line: [m] ENU.

        Returns:
            For the next 30 s, in which those that hold go on holding.
        """
        flight = self._world.flights.of(uav_id, self._stepped)
        if flight is None or uav_id not in self._uavs:
            return False
        points = timed_along([(0.0, flight.position)], line, flight.pace)
        ways = {name: each.way for name, each in self._uavs.items()}
        ways[uav_id] = replace(ways[uav_id], points=tuple(points))
        predicted = FlightPredictions(ways, separation_of(self._world.params),
                                      self.monitor.holding)
        return not predicted.losses_of(uav_id, holds=False, wide=True)
