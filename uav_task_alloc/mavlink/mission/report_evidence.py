# SPDX-License-Identifier: Apache-2.0
"""Was the vehicle at an item when a MISSION_ITEM_REACHED was sent, and may that be a repetition?

It decides which of two missions a report is of that came while one was replaced by the other.
"""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.mission_mode import MissionMode
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.mission.reached_series import ReachedSeries


class ReportEvidence:
    """Compares reports with the positions of the vehicle; changes nothing but the series.

    Args:
        epoch: the mission on board.
        positions: of the vehicle.
        mode: when it was in mission mode.
        series: the REACHED received, to which those asked about are added.

    Arguments of methods:
        item: of a mission.
        when: steady time [s] at which a report was received.
        since: vehicle time [s] before which the item was not reached.
        seq: of a REACHED, an index without home.
        now: steady time [s] at which that was received.
        frame: its number.
    """

    def __init__(self, epoch: Epoch, positions: PositionHistory, mode: MissionMode,
                 series: ReachedSeries) -> None:
        self._epoch, self._positions, self._mode, self._series = epoch, positions, mode, series

    def was_at(self, item: Item, when: float, since: float = -math.inf) -> bool:
        """Whether an item was reached before a report."""
        return self._positions.was_at(
            item, max(self._epoch.since, since), self._positions.vehicle_time(when))

    def was_exactly_at(self, item: Item, when: float, since: float = -math.inf) -> bool:
        """Whether it was within the radius of an item in mission mode; see `was_at`."""
        until = min(self._positions.vehicle_time(when), self._mode.left_at)
        return self._positions.was_at(item, max(self._epoch.since, since), until, close=0.0)

    def first_at(self, seq: int, now: float, frame: int) -> float:
        """When [s] the first REACHED was received that this one may repeat, of any epoch."""
        return self._series.first_at(self._series.add(seq, now, frame))

    def may_repeat_earlier(self, seq: int, now: float, frame: int) -> bool:
        """Whether a REACHED may repeat one of before the mission on board was taken."""
        reached = self._series.add(seq, now, frame)
        return self._series.first_sent(reached) < self._epoch.taken
