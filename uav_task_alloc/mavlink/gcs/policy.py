# SPDX-License-Identifier: Apache-2.0
"""Operator policy of the bridge."""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from uav_task_alloc.geometry.fence_area import zones_outside
from uav_task_alloc.mavlink.fence.rally import RallyPoint
from uav_task_alloc.mavlink.fence.shapes import FenceShape
from uav_task_alloc.model import ThreatZone


@dataclass(frozen=True, slots=True)
class Policy:
    """Operator settings that the mission executors follow."""

    takeoff: bool = False  # the bridge may arm and take off
    cruise_altitude: float = 50.0  # [m] above home after a take-off
    when_empty: str = 'hold'  # or 'return': with an empty list in flight
    when_foreign: str = 'yield'  # or 'reassert': with a mission of another station
    relaunch: str = 'operator'  # or 'automatic': take-off after a landing by the bridge
    zones: tuple[ThreatZone, ...] = ()  # that a return must not cross
    clock: float = 0.0  # [s] ROS time
    grounded: str = ''  # what a vehicle on the ground waits for before a take-off; '': nothing
    fences: str = 'off'  # or 'warn', 'require': whether vehicles carry the zones as fences
    zones_known: bool = False  # `zones` were received; else they are empty until then
    fence_area: FenceShape | None = None  # that all vehicles stay in
    rally: tuple[RallyPoint, ...] = ()  # places to return to; the store is left alone without
    settling: str = ''  # what take-offs and lists in the air wait for at the start; soon over

    @property
    def no_fly_zones(self) -> tuple[ThreatZone, ...]:
        """The zones, and what is outside of `fence_area`: no way of the bridge enters them."""
        if self.fence_area is None:
            return self.zones
        return (*self.zones, *_outside(self.fence_area))


@lru_cache(maxsize=8)
def _outside(area: FenceShape) -> tuple[ThreatZone, ...]:
    return zones_outside(area.corners)
