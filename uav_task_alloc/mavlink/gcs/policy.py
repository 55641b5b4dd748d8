# SPDX-License-Identifier: Apache-2.0
"""What the operator wants of the bridge."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.model import ThreatZone


@dataclass(frozen=True, slots=True)
class Policy:
    """What the operator wants of the bridge."""

    takeoff: bool = False  # arm and take off
    cruise_altitude: float = 50.0  # [m] above home, to take off to
    when_empty: str = 'hold'  # or 'return': an empty list in flight
    when_foreign: str = 'yield'  # or 'reassert': a mission that somebody else put there
    relaunch: str = 'operator'  # or 'automatic': whether it starts again after a landing of ours
    zones: tuple[ThreatZone, ...] = ()  # which RTL does not know
    grounded: str = ''  # what whoever is on the ground waits for; '': nothing
