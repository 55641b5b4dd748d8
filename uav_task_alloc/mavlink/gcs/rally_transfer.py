# SPDX-License-Identifier: Apache-2.0
"""The rally points of one vehicle: chosen for its list, and transferred like a fence."""
from __future__ import annotations

from collections.abc import Sequence

from uav_task_alloc.geometry.zones_on_path import zone_across_path
from uav_task_alloc.mavlink.fence.onboard_fence import FenceState, OnboardFence
from uav_task_alloc.mavlink.fence.rally import RallyPoint, choose_rally, rally_items
from uav_task_alloc.mavlink.fence.shapes import FenceShape
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.model import Point, ThreatZone

RALLY_BUDGET = 32  # points of PX4's store; ArduPilot's has room for more


class RallyTransfer:
    """Keeps the rally points on board those that the list wants.

    Args:
        transfer: of rally points, with the vehicle.
    """

    def __init__(self, transfer: OnboardFence) -> None:
        self.transfer = transfer
        self.chosen: tuple[RallyPoint, ...] = ()
        self.left_out: tuple[RallyPoint, ...] = ()
        self._chosen_for: object = None

    def choose(self, points: Sequence[RallyPoint], zones: Sequence[ThreatZone],
               tasks: TaskList | None, home: Point, area: FenceShape | None = None) -> None:
        """Choose the points for a list.

        Args:
            points: that may be used.
            zones: that returns are not to cross.
            tasks: the list of the vehicle; None: none yet.
            home: of the vehicle [m] ENU.
            area: that its fence keeps it in: no point outside of it is used; None: none.
        """
        key = tuple(points), tuple(zones), tasks, home, area, self.transfer.budget
        if key == self._chosen_for:
            return
        self._chosen_for = key
        stops = () if tasks is None else tasks.stops
        path = [home, *(p for stop in stops for p in (*stop.via, *stop.way))]
        inside = [p for p in points if area is None or area.contains(p.position)]
        self.chosen = choose_rally(inside, path, home, lambda a, b: (
            zone_across_path(a, b, zones) is not None))[:self.transfer.budget]
        self.left_out = tuple(point for point in points if point not in self.chosen)
        self.transfer.wanted = rally_items(self.chosen)

    def step(self, now: float, may_upload: bool) -> list[Message]:
        """Go on with the transfer, or begin the one that is due.

        Args:
            now: steady time [s].
            may_upload: whether the authority allows an upload.

        Returns:
            Messages to send.
        """
        if self.transfer.busy:
            return self.transfer.step(now)
        return self.transfer.begin(now, may_upload)

    @property
    def text(self) -> str:
        """State of the rally points for operators."""
        state, text = self.transfer.state, self.transfer.state.name
        if state is FenceState.VERIFIED:
            text += f', {len(self.chosen)} on board'
        if self.left_out:
            text += ', not used: ' + ', '.join(point.text for point in self.left_out)
        return text + (f' ({self.transfer.reason})' if self.transfer.reason else '')
