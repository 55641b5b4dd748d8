# SPDX-License-Identifier: Apache-2.0
"""Delays an upload while a task is being served, or is about to be reached."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import UNKNOWN, Telemetry
from uav_task_alloc.mavlink.mission.items import Item, alike

_NEAR = 15.0  # [m] beyond the acceptance radius of a point
_ARRIVAL = 2.0  # [s] before a task is reached, plus the time of an upload
_TIMEOUT = 10.0  # [s] after the end of its hold


class UploadHold:
    """Holds back uploads while a task of the list is served: it would be left, and flown again."""

    def __init__(self, onboard: OnboardMission, telemetry: Telemetry, profile: Profile) -> None:
        self._onboard, self._telemetry, self._profile = onboard, telemetry, profile
        self._until = math.inf  # [s]; inf: none

    def active(self, now: float) -> bool:
        """Whether an upload would restart the hold of the task, or make it be reached twice."""
        item = self._onboard.progress.active
        if item is None or self._telemetry.mode is not ModeFunction.MISSION or not any(
                each.completes and self._is_near(item, each) for each in self._onboard.wanted()):
            self._until = math.inf
            return False
        if math.isinf(self._until):
            self._until = now + item.params[0] + _TIMEOUT
        return now < self._until

    def _is_near(self, item: Item, listed: Item) -> bool:
        same, onboard = alike(listed, item), self._onboard
        if not same and item.task != listed.task:
            return False
        distance = math.dist(self._telemetry.position, listed.position or UNKNOWN) - listed.radius
        wanted = onboard.wanted()
        margin = _ARRIVAL * (listed is wanted[0]) + onboard.latest_upload.item_time * len(wanted)
        if same and self._profile.atomic and distance < _NEAR + margin * self._telemetry.pace:
            return True
        being_served = same or item.completes
        return being_served and item.params[0] > 0.0 and distance < _NEAR
