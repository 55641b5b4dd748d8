# SPDX-License-Identifier: Apache-2.0
"""What is reported just before a restart and comes after it; the end of a mission of PX4."""
from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.mavlink.mission.completed_tasks import CompletedTasks
from uav_task_alloc.mavlink.mission.current_item import CurrentItem
from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.flown_path import CLOSE
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY, PositionHistory
from uav_task_alloc.mavlink.mission.reached_series import ReachedSeries
from uav_task_alloc.mavlink.transport.codec import Message


class EndBeforeRestart:
    """Keeps the current item where the vehicle was at it, or almost, when it was restarted.

    Args:
        epoch: the mission on board.
        tasks: of the vehicle.
        positions: of the vehicle.
        moves: the current item of `epoch`.
    """

    def __init__(self, epoch: Epoch, tasks: CompletedTasks, positions: PositionHistory,
                 moves: CurrentItem) -> None:
        self._epoch, self._tasks, self._positions, self._moves = epoch, tasks, positions, moves
        # index, item, until when [s]; the item that was flown when the vehicle was restarted
        self._ending: tuple[int, Item, float] | None = None
        self._at_end = False  # it was the last one, and the vehicle at it
        self._ended: tuple[int, int, float] | None = None  # epoch, index, reported at [s]
        self._named = False  # its REACHED may repeat one of before

    def note_restart(self, now: float, series: ReachedSeries) -> None:
        """Note that the vehicle was restarted; call before the epoch ends.

        Args:
            now: steady time [s].
            series: the REACHED received.
        """
        epoch, back = self._epoch, self._moves.set_back_from
        current = epoch.current if back is None or now - back[1] > MAX_MESSAGE_DELAY else back[0]
        item = (
            None if current is None or current >= len(epoch.items) else epoch.items[current])
        self._ending, self._at_end = None, False
        if item is not None and current is not None and self._flies(now) and self._may_reach(item):
            self._ending = current, item, now + MAX_MESSAGE_DELAY
            self._named = series.named_lately(current, current + 1, now)
            self._at_end = current == epoch.last_flown and self._is_at(item)
            if self._at_end and self._ended is not None and (
                    self._ended[:2] == (epoch.number, current)
                    and now - self._ended[2] < MAX_MESSAGE_DELAY):
                self._tasks.credit(item)
        self._ended = None

    def _is_at(self, item: Item) -> bool:
        return self._positions.distance(item) <= item.radius + CLOSE

    def _may_reach(self, item: Item) -> bool:
        """Whether it is at an item, or comes there within a second if it keeps its velocity."""
        return self._is_at(item) or (item.position is not None and self._positions.path.approached(
            item.position, item.radius, -math.inf, math.inf))

    def _flies(self, now: float) -> bool:
        """Whether it is in mission mode at `now` [s], or was until a moment ago."""
        left_at, positions = self._moves.mode.left_at, self._positions
        return self._moves.mode.in_mission or (math.isfinite(left_at) and max(
            positions.path.newest, positions.vehicle_time(now)) - left_at < MAX_MESSAGE_DELAY)

    def note_reached(self, seq: int, now: float) -> None:
        """Take a MISSION_ITEM_REACHED: a restarted vehicle has reached nothing yet.

        Args:
            seq: index without home.
            now: steady time [s].
        """
        if self._ending is not None and seq == self._ending[0] and not self._named and (
                now < self._ending[2]):
            self._tasks.credit(self._ending[1])
            self._ending = None

    def note_current(self, message: Message, now: float, by_mission: bool) -> None:
        """Take a MISSION_CURRENT: a restarted vehicle has not flown its mission to the end yet.

        Args:
            message: as PX4 sends it.
            now: steady time [s].
            by_mission: whether no take-off or landing can have ended, which PX4 reports the same.
        """
        if message.mission_state != dialect.MISSION_STATE_COMPLETE:
            self._note_next(message, now)
            return
        if by_mission and self._flies(now) and message.seq == self._epoch.last_flown:
            self._ended = self._epoch.number, message.seq, now
            self._credit_last(message.seq, now)
        if self._ending is None:
            return
        seq, item, deadline = self._ending
        if self._at_end and message.seq == seq and now < deadline:
            self._tasks.credit(item)
        self._ending = None

    def _note_next(self, message: Message, now: float) -> None:
        """Take the report that the next item is flown; after a restart the first one is."""
        if self._ending is None or message.mission_state != dialect.MISSION_STATE_ACTIVE:
            return
        seq, item, deadline = self._ending
        if message.seq == seq + 1 and now < deadline and not self._moves.mode.in_mission:
            self._tasks.credit(item)
            self._ending = None

    def _credit_last(self, seq: int, now: float) -> None:
        """Complete the last item where it was inside: its REACHED may be lost before a cut."""
        epoch, moves, positions = self._epoch, self._moves, self._positions
        item = epoch.items[seq]
        until = min(positions.vehicle_time(now), moves.mode.left_at)
        if epoch.current == seq and positions.was_at(
                item, moves.current_since(item), until, close=0.0):
            self._tasks.credit(item)
