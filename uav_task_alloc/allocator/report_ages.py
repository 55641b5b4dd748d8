# SPDX-License-Identifier: Apache-2.0
"""How old what a UAV reports is: since when it is silent, and since when it is where it says."""
from __future__ import annotations

from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Point


class ReportAges:
    """Follows the reports of all UAVs, in seconds of the published clock.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._silent: dict[str, float] = {}  # by id: published clock [s] when it was found silent
        # by id: the last position [m], and the published clock [s] of the first report with it
        self._placed: dict[str, tuple[Point, float]] = {}

    def forget_removed(self) -> None:
        """Forget the UAVs that are no longer in the fleet."""
        for followed in (self._silent, self._placed):
            for uav_id in followed.keys() - self._world.uav_records().keys():
                del followed[uav_id]

    def silent_for(self, uav_id: str, record: UavRecord, stamp: float) -> float:
        """Return for how long a UAV has been known to be silent.

        Args:
            uav_id: of the UAV.
            record: of it.
            stamp: [s] published clock.

        Returns:
            [s]; 0: it is not.
        """
        if not record.silent:
            self._silent.pop(uav_id, None)
            return 0.0
        return stamp - self._silent.setdefault(uav_id, stamp)

    def age(self, uav_id: str, record: UavRecord, stamp: float) -> float:
        """Return since when a UAV was where it reports to be; a stale link repeats its position.

        Args:
            uav_id: of the UAV.
            record: of it.
            stamp: [s] published clock.

        Returns:
            [s]; not much more than it has been silent for.
        """
        silent, place = self.silent_for(uav_id, record, stamp), record.report.position
        if self._placed.get(uav_id, (None,))[0] != place:
            self._placed[uav_id] = place, min(stamp, self._world.flights.reported_at(uav_id))
        age = stamp - self._placed[uav_id][1]
        return max(silent, min(age, silent + 2.0 * self._world.params.uav_timeout))

    def clock_jumped(self, by: float) -> None:
        """Shift all times with the published clock.

        Args:
            by: [s] of the jump.
        """
        self._silent.update((uav_id, stamp + by) for uav_id, stamp in self._silent.items())
        self._placed.update((uav_id, (place, stamp + by))
                            for uav_id, (place, stamp) in self._placed.items())
