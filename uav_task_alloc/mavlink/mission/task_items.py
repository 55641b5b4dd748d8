# SPDX-License-Identifier: Apache-2.0
"""The items of a list compared with those read from a vehicle: which of them are of its tasks?"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import chain

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.mission.items import (
    Item,
    MissionStop,
    TaskList,
    alike,
    mission_items,
)
from uav_task_alloc.mavlink.mission.long_legs import with_points_between
from uav_task_alloc.mavlink.mission.piece_coverage import PieceCoverage


class TaskItems:
    """Makes the items of tasks as they would be on board.

    Args:
        profile: of the autopilot.
        origin: of the local ENU frame.
        coverage: how much of the ways is flown.
        cruise: cruise speed [m/s]; NaN: not known.
    """

    def __init__(self, profile: Profile, origin: Origin, coverage: PieceCoverage,
                 cruise: Callable[[], float]) -> None:
        self._profile, self._origin = profile, origin
        self._coverage, self._cruise = coverage, cruise

    def items_of(self, stops: tuple[MissionStop, ...]) -> tuple[Item, ...]:
        """Return the items of stops without their detour points, and of no refused task.

        Args:
            stops: in order.
        """
        rules, origin, cruise = self._profile.rules, self._origin, self._cruise()
        divided = with_points_between(TaskList(0, stops)).stops
        rows = tuple(replace(stop, via=()) for stop in divided)
        try:
            return mission_items(TaskList(0, rows), rules, origin, cruise=cruise)
        except MissionError as error:
            others = tuple(stop for stop in stops if stop.task.id != error.task)
            return self.items_of(others) if len(others) < len(stops) else ()

    def tagged(self, held: tuple[Item, ...], tasks: TaskList) -> tuple[Item, ...]:
        """Return items that were read, with the tasks of a list and their positions.

        Args:
            held: the items, without home.
            tasks: the list.
        """
        stops = tuple(self._coverage.rest(MissionStop(s.task, reversed=s.reversed))
                      for s in tasks.stops)
        wanted, found, at = self.items_of(stops), [], 0
        for each in held:  # ways may share points: the order tells which of them it is
            order = chain(range(at, len(wanted)), range(at))
            n = next((n for n in order if alike(wanted[n], each)), None)
            found.append(each if n is None else wanted[n])
            at = at if n is None else n + 1
        return tuple(found)
