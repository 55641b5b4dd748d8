# SPDX-License-Identifier: Apache-2.0
"""Finds a take-off of the bridge that ended below its height, where no other mode was shown."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.mission_evidence import MissionEvidence

CLIMBED = 0.9  # of the commanded height: the take-off ended normally
_RISE = 0.3  # [m] a vehicle that climbs rises by at least that
_STOPPED = 10.0  # [s] of its clock, within which it does


class ClimbCheck:
    """Follows the height of one vehicle from a take-off command on.

    ArduPilot stays in GUIDED when somebody has ended its climb by another mode and a command of
    the bridge that the link delayed sets GUIDED again; no heartbeat may have shown that mode.

    Args:
        state: of the vehicle; changed by the methods.
        evidence: of its mission; gives the time of its positions.
    """

    def __init__(self, state: AuthorityWatchState, evidence: MissionEvidence) -> None:
        self._state, self._evidence = state, evidence
        self._goal: float | None = None  # [m] above home; None: no take-off to follow
        self._highest = -math.inf  # [m]
        self._risen_at = -math.inf  # vehicle time [s]

    def begin(self, height: float) -> None:
        """Follow a take-off to a height [m] above home."""
        self._goal, self._highest = height, -math.inf

    def end(self) -> None:
        """Follow it no longer, as after a command of another mode."""
        self._goal = None

    def step(self, now: float) -> None:
        """Apply that another party has ended the take-off where it does not rise any more."""
        goal, telemetry = self._goal, self._state.telemetry
        if goal is None:
            return
        state = self._state.authority.state
        if state in (AuthorityState.LOST, AuthorityState.NONE) or (
                telemetry.height >= CLIMBED * goal):
            self._goal = None
            return
        at, suspended = self._evidence.position_time(), state is AuthorityState.SUSPENDED
        if suspended or not telemetry.airborne or not telemetry.height < self._highest + _RISE:
            self._highest, self._risen_at = telemetry.height, at
        elif at - self._risen_at >= _STOPPED:
            self._goal = None
            self._state.apply_taken(
                f'its take-off ended at {telemetry.height:.1f} m of {goal:.1f} m', now)
