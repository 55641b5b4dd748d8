# SPDX-License-Identifier: Apache-2.0
"""The state of one vehicle that all checks of authority share: modes, arming, pending causes."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority import Authority, AuthorityEvent
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass, mode_class, mode_name
from uav_task_alloc.mavlink.gcs.sent_commands import SentCommands
from uav_task_alloc.mavlink.gcs.status_texts import StatusTexts
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Point

EXPLANATION_TIME = 5.0  # [s] in which a delayed message may explain a change of mode


# what a battery change looks like: silence, a reboot; after any other event nothing is granted
_BATTERY_CHANGE_EVENTS = frozenset({
    AuthorityEvent.OWN, AuthorityEvent.LINK_STALE, AuthorityEvent.LINK_BACK,
    AuthorityEvent.LINK_CHANGED, AuthorityEvent.REBOOTED_FLOWN, AuthorityEvent.BATTERY_CHANGED})


@dataclass(slots=True)
class UnexplainedChange:
    """A change of mode that a delayed message may still explain."""

    until: float  # [s]
    explained: Callable[[float], bool]
    why: str  # reason of LOST otherwise
    ours: int | None = None  # custom_mode commanded by us that explains it


@dataclass(slots=True)
class AuthorityWatchState:
    """What was received from one vehicle and sent to it, as far as authority depends on it."""

    profile: Profile
    telemetry: Telemetry
    authority: Authority
    sent: SentCommands
    flown: bool = False  # armed since the grant
    texts: StatusTexts = field(default_factory=StatusTexts)
    notes: deque[OperatorNote] = field(default_factory=deque)
    mode: int | None = None  # custom_mode of the newest heartbeat
    heartbeat_at: float = -math.inf  # [s] the newest heartbeat before this one
    in_mission_since: float = -math.inf  # [s] a heartbeat has shown the change to MISSION
    armed: bool = False
    status: int = 0  # MAV_STATE
    unconfirmed: bool = False  # the next heartbeat shows the mode, without a change of mode
    unexplained: UnexplainedChange | None = None
    rest: tuple[float, Point] | None = None  # since when [s], and where: STICK -> HOLD
    mission_on_ground: bool = False  # another station has set MISSION on the ground
    maybe_ours: bool = False  # in MISSION when the bridge started
    hold_due: bool = False  # command HOLD if it is airborne, after a restart of the bridge
    descending: bool = False  # by our RETURN
    left_return_at: float = -math.inf  # [s] another command of ours has ended our RETURN
    was_airborne: bool = False
    landed_battery: float = math.nan  # 0..1, at its own landing, while it may start again
    rebooted_on_ground: bool = False  # since that landing
    replacing_since: float | None = None  # [s] since when it is held for a mission replacement

    def class_of(self, mode: int | None) -> ModeClass | None:
        """The class of a custom_mode; None: not known."""
        return None if mode is None else mode_class(self.profile.family, mode)

    def name_of(self, mode: int | None) -> str:
        """The name of a custom_mode, as the vehicle's own ground station shows it."""
        return 'no mode' if mode is None else mode_name(self.profile.family, mode)

    def is_return(self, mode: int | None) -> bool:
        """Whether a custom_mode returns the vehicle to its home."""
        return mode is not None and self.profile.mode_function(mode) is ModeFunction.RETURN

    @property
    def booting(self) -> bool:
        """Whether the autopilot boots, by its heartbeat (SUSPENDED, no clock is requested)."""
        return self.status in (d.MAV_STATE_BOOT, d.MAV_STATE_CALIBRATING)

    def failsafe_active(self, now: float) -> bool:
        """Whether a failsafe is active, or was reported by a STATUSTEXT a moment ago."""
        return bool(self.status >= d.MAV_STATE_CRITICAL) or self.texts.recent_failsafe(now)

    def forget_mode(self) -> None:
        """Clear what was concluded from the previous mode."""
        self.rest, self.mission_on_ground, self.maybe_ours = None, False, False

    def apply(self, event: AuthorityEvent, now: float, why: str) -> None:
        """Make the transition of the authority table, and clear what the new state invalidates.

        Args:
            event: what happened.
            now: steady time [s].
            why: the reason shown to the operator.
        """
        if event not in _BATTERY_CHANGE_EVENTS:
            self.landed_battery, self.rebooted_on_ground = math.nan, False
        before, back = self.authority.state, self.authority.given_back_by
        self.authority.awaits_battery = self.rebooted_on_ground
        if not self.authority.apply(event, now, why):
            if self.authority.given_back_by == back:
                return
            why = self.authority.why  # what gives it back has changed
        state = self.authority.state
        if state is AuthorityState.LOST and before is not AuthorityState.LOST:
            self.unexplained, self.rest = None, None
            self.sent.modes.clear()
        if state is AuthorityState.SUSPENDED and not self.unconfirmed:
            self.sent.modes.clear()
        if state is AuthorityState.HELD and before in (AuthorityState.LOST, AuthorityState.NONE):
            self.flown = self.armed
        if self.replacing_since is not None:
            self.replacing_since = (
                now if state in (AuthorityState.HELD, AuthorityState.SUSPENDED) else None
            )
        back = self.authority.given_back_by
        self.notes.append(
            OperatorNote(
                'info' if self.rebooted_on_ground or state in (
                    AuthorityState.HELD, AuthorityState.NONE) else 'warning',
                f'authority {state.name}: {why}' + (f'; given back by {back}' if back else ''),
            )
        )

    def apply_taken(self, why: str, now: float) -> None:
        """Apply a change of mode by a pilot or another station.

        Args:
            why: the change of mode, for the reason shown to the operator.
            now: steady time [s].
        """
        replacing = self.replacing_since is not None and self.authority.held
        self.apply(
            AuthorityEvent.REPLACEMENT_TAKEN if replacing else AuthorityEvent.TAKEN,
            now,
            f'not by the bridge: {why}',
        )

    def suspend_until_explained(self, explained: Callable[[float], bool], why: str, now: float,
                                *, within: float = EXPLANATION_TIME,
                                ours: int | None = None) -> None:
        """Suspend authority after a change of mode that no message explains yet.

        Args:
            explained: whether the change is explained at a steady time [s].
            why: the change of mode, for the reason shown to the operator.
            now: steady time [s].
            within: [s] in which it has to be explained; LOST after that.
            ours: custom_mode commanded by us that explains it when a heartbeat shows it.
        """
        self.unexplained = UnexplainedChange(now + within, explained, why, ours)
        self.apply(AuthorityEvent.UNEXPLAINED, now, why)
