# SPDX-License-Identifier: Apache-2.0
"""Finds that another station flies a vehicle in HOLD, as by "go to": no mode shows that."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.gcs.authority_watch_state import AuthorityWatchState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass
from uav_task_alloc.mavlink.gcs.hand_over import REST_SPEED
from uav_task_alloc.model import Point

_MOVED, _MOVES = 20.0, 2.0  # [m] in plan view from where it rested, and [m/s] then
_HEARTBEAT_DELAY = 1.5  # [s] after which one shows the mode in which it has moved


class MovedInHold:
    """Applies that a vehicle was taken that leaves the place where it held.

    A climb is no sign of that: an ArduPilot takes off in the same mode. Nor is an estimate that
    jumps, as the vehicle has to move; a fixed wing circles, and is not judged.

    Args:
        state: of the vehicle; changed by `step`.
    """

    def __init__(self, state: AuthorityWatchState) -> None:
        self._state = state
        self._place: Point | None = None  # [m] where it came to rest; None: it does not hold
        self._moved_at = math.inf  # [s] it was seen away from there
        self._leaves = False  # a command of ours ends the mode, which no heartbeat has shown yet

    def note_command(self, holds: bool) -> None:
        """Note a command of the bridge that sets a mode, or takes off.

        Args:
            holds: it sets HOLD.
        """
        self._place, self._leaves = None, not holds

    def step(self, now: float) -> None:
        """Compare its place with where it came to rest.

        Args:
            now: steady time [s].
        """
        state, telemetry = self._state, self._state.telemetry
        holds = state.class_of(state.mode) is ModeClass.HOLD
        self._leaves = self._leaves and holds
        if not (state.authority.held and telemetry.airborne and holds and telemetry.has_position
                ) or self._leaves or state.profile.rules.loiters:
            self._place = None
            return
        if self._place is None:
            self._place = telemetry.position if telemetry.speed < REST_SPEED else None
            self._moved_at = math.inf
            return
        metres = math.dist(self._place[:2], telemetry.position[:2])
        if not metres > _MOVED:
            self._moved_at = math.inf
        elif self._moved_at == math.inf and telemetry.speed > _MOVES:
            self._moved_at = now
        elif state.heartbeat_at > self._moved_at + _HEARTBEAT_DELAY:  # it still shows HOLD
            self._place = None
            state.apply_taken(f'moved by {metres:.0f} m in {state.name_of(state.mode)}', now)
