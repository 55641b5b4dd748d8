# SPDX-License-Identifier: Apache-2.0
"""Whether an upload has to wait, as a task is being served or is about to be reached."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import UNKNOWN, Telemetry
from uav_task_alloc.mavlink.mission.items import Item, alike

_NEAR = 15.0  # [m] from a point, beyond its radius: there
ARRIVAL = 2.0  # [s] before a task is reached, and the time of an upload: no swap is begun
_PATIENCE = 10.0  # [s] beyond its hold that a service is waited for


class UploadHold:
    """The service of the first task of the list, where it is also the one flown."""

    def __init__(self, onboard: OnboardMission, telemetry: Telemetry, profile: Profile) -> None:
        self._onboard, self._telemetry, self._profile = onboard, telemetry, profile
        self._until = math.inf  # [s]; inf: none

    def lasts(self, now: float) -> bool:
        """An upload would start the hold of the task anew, or have it reached once more."""
        item, first = self._onboard.progress.active, self._onboard.wanted()[0]
        if item is None or self._telemetry.mode is not ModeFunction.MISSION or not (
                first.completes and self._is_near(item, first)):
            self._until = math.inf
            return False
        if math.isinf(self._until):
            self._until = now + item.params[0] + _PATIENCE
        return now < self._until

    def _is_near(self, item: Item, first: Item) -> bool:
        distance = math.dist(self._telemetry.position, first.position or UNKNOWN) - first.radius
        same, onboard = alike(first, item), self._onboard
        span = ARRIVAL + onboard.item_time * len(onboard.wanted())
        if same and self._profile.atomic and distance < _NEAR + span * self._telemetry.pace:
            return True
        session = same or (item.completes and item.task == first.task)
        return session and item.params[0] > 0.0 and distance < _NEAR
