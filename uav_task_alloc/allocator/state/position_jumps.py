# SPDX-License-Identifier: Apache-2.0
"""Positions that no UAV can have flown to: logged once, planned for; two sources under one id."""
from __future__ import annotations

import math
from collections.abc import Callable

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.callbacks import Note, RequestReplan
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.params import AllocatorParams

_FASTEST = 10.0  # times the cruise speed: faster is a jump, in accelerated simulations too
_JUMPS_APART, _SEVERAL_JUMPS = 2.0, 4  # [s] at most, and how many then show two sources


class PositionJumps:
    """Compares each position with the one before; those that have jumped are accepted.

    Args:
        params: returns the parameters in force.
        note, request_replan: of the world.

    Arguments of methods:
        uav_id: of a UAV.
    """

    def __init__(self, params: Callable[[], AllocatorParams], note: Note,
                 request_replan: RequestReplan) -> None:
        self._params, self._note, self._request_replan = params, note, request_replan
        # by UAV: when its position last jumped [s], and how often shortly after one another
        self._jumps: dict[str, tuple[float, int]] = {}

    def check(self, before: UavRecord | None, report: UavReport, now: float) -> None:
        """Compare a report with the one before.

        Args:
            before: record of the last report; None: there was none.
            report: the new one.
            now: [s] steady clock.
        """
        uav_id, params = report.uav_id, self._params()
        last, count = self._jumps.get(uav_id, (-math.inf, 0))
        if now - last > _JUMPS_APART:
            count = 0
        speed = report.cruise_speed or params.default_cruise_speed
        metres = _jump_distance(before, report, now, speed, params.position_jump)
        if metres:
            if now - last > params.uav_timeout:
                self._note(f'{uav_id} jumped by {metres:.0f} m', warning=True)
            last, count = now, count + 1
            self._request_replan(f'{uav_id} jumped', now)
        self._jumps[uav_id] = last, count

    def in_two_places(self, uav_id: str) -> bool:
        """Return whether its position keeps jumping: two sources report under its id."""
        return self._jumps.get(uav_id, (0.0, 0))[1] >= _SEVERAL_JUMPS

    def forget(self, uav_id: str) -> None:
        """Drop what is kept of a UAV."""
        self._jumps.pop(uav_id, None)


def _jump_distance(before: UavRecord | None, report: UavReport, now: float, speed: float,
                   most: float) -> float:
    """How far a position jumped [m]; 0.0 where the UAV can have flown there.

    speed: cruise speed [m/s]; most: [m] beyond that flight which are no jump.
    """
    if before is None or before.silent:
        return 0.0
    metres = math.dist(before.report.position, report.position)
    return metres if metres > most + _FASTEST * speed * (now - before.received) else 0.0
