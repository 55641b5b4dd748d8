# SPDX-License-Identifier: Apache-2.0
"""What the operator wants of the bridge, and what the bridge reports of tasks."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Policy:
    """What the operator wants of the bridge."""

    takeoff: bool = False  # arm and take off
    cruise_altitude: float = 50.0  # [m] above home, to take off to
    when_empty: str = 'hold'  # or 'return': an empty list in flight
    when_foreign: str = 'yield'  # or 'reassert': a mission that somebody else put there


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """STARTED, COMPLETED or FAILED, of a task on this UAV."""

    task: str
    event: str
    revision: int
    reason: str = ''
