# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has flown before this bridge listened: items known by their places only.

No jump of ours leaves out a task that is not flown (see `change`), so what lies behind the
current item of a vehicle has been flown, whoever asked for it.
"""
from __future__ import annotations

import math
import zlib
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.items import Item, MissionStop, TaskList, alike, mission_items
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.model import Point, Task

_NEAR = 15.0  # [m] from the last item: there
MEMORY = 60.0  # [s] after the restart; a task at the same place later on is another one


def checksum(items: Iterable[Item]) -> int:
    """Tells missions apart by what every autopilot gives back unchanged."""
    return zlib.crc32(repr([(item.command, item.x, item.y) for item in items]).encode())


class Resume:
    """Finds the place of a vehicle in its mission once, and the tasks behind it."""

    def __init__(self, profile: Profile, origin: Origin, telemetry: Telemetry,
                 progress: ProgressTable) -> None:
        self._profile, self._origin = profile, origin
        self._telemetry, self._progress = telemetry, progress
        self.unflown: dict[str, Point] = {}  # passed over, not by a bridge
        self.reported: set[str] = set()  # flown, as the bridge before has told
        self.known: tuple[int | None, int | None] = None, None  # mission and item, before
        self.doubtful = False  # what the current item of the vehicle says of earlier ones
        self._rebooted = False
        self.reset()

    def rebooted(self) -> None:
        """Its current item says nothing of what it has flown before."""
        self.reset()
        self._rebooted = True

    def reset(self) -> None:
        """Its place is to be found again: it was restarted, or is another one."""
        self.placed = False
        self._old: tuple[Item, ...] = ()  # behind already when the bridge before was there
        self._epoch, self._placed_at = -1, 0  # in which it was placed, and where
        self._until = -math.inf  # [s]
        self._flown: tuple[Item, ...] = ()  # under missions that are not on board any more

    def place(self, held: tuple[Item, ...], tasks: TaskList, now: float) -> None:
        """Find, once, where in its mission the vehicle is."""
        telemetry = self._telemetry
        if self.placed or not held or telemetry.current is None:
            self.placed = self.placed or not held
            return
        self.placed = True
        if self.doubtful or (
                not self._profile.atomic and telemetry.mode is not ModeFunction.MISSION):
            self._progress.begin(held, None, now)  # held for a swap: current is of the old items
            return
        # not by REACHED: PX4 repeats that of the mission before for some seconds
        current = min(max(0, telemetry.current - self._profile.rules.home_first), len(held))
        if not self._profile.atomic and self._progress.items:  # REACHED came before CURRENT
            current = max(current, self._progress.current or 0)
        flown = len(held) if self._ended(held, current) else current
        self._progress.begin(held, flown, now, read=True)
        self._epoch, self._placed_at = self._progress.epoch, flown
        # what lies before that the bridge before has told of, or knew to be passed over
        same = self.known[0] == checksum(held)
        self._old = held[:self.known[1] or 0] if same else ()
        # on the ground, and the first list ever: what is on board is of an earlier mission
        if not self._rebooted and (telemetry.airborne or tasks.revision > 1):
            self._until = now + MEMORY

    def stash(self) -> None:
        """Another mission goes on board: keep what was flown of this one."""
        self._flown += self._behind()

    def memory(self, now: float) -> tuple[Item, ...]:
        """Items flown that nobody has told of."""
        return (*self._flown, *self._behind()) if now < self._until else ()

    def flown(self, tasks: Iterable[Task], now: float) -> tuple[Task, ...]:
        """Those of the tasks that are flown already."""
        memory = self.memory(now)
        if not memory:
            return ()
        stops = tuple(MissionStop(task) for task in tasks)
        items = mission_items(TaskList(0, stops), self._profile.rules, self._origin)
        return tuple(stop.task for stop, item in zip(stops, items, strict=True)
                     if any(alike(item, m) and (stop.task.id in self.reported or not any(
                         m is old for old in self._old)) for m in memory)
                     and self.unflown.get(stop.task.id) != stop.task.position)

    def _behind(self) -> tuple[Item, ...]:
        progress = self._progress
        if progress.epoch != self._epoch:
            return ()  # read again: what is behind may be of a transfer that broke off
        return tuple(item for n, item in enumerate(progress.items[:progress.current or 0])
                     if not item.task and item.position is None
                     and (n < self._placed_at or n in progress.reached_seqs))

    def _ended(self, held: tuple[Item, ...], current: int) -> bool:
        telemetry, last = self._telemetry, held[-1]
        if telemetry.mission_state == d.MISSION_STATE_COMPLETE and not self._profile.atomic:
            return True  # PX4 says so after a take-off and a landing too
        place = to_enu(self._origin, last.x * 1e-7, last.y * 1e-7, last.z)
        return (
            self._profile.atomic
            and telemetry.airborne
            and telemetry.mode is ModeFunction.HOLD
            and current == len(held) - 1
            and math.dist(telemetry.position, place) < last.params[1] + _NEAR
        )
