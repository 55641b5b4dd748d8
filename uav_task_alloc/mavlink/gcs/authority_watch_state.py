# SPDX-License-Identifier: Apache-2.0
"""What is known of one vehicle as far as authority is concerned; shared by all that judge it."""
from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority import Authority, AuthorityEvent, AuthorityState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass, mode_class, mode_name
from uav_task_alloc.mavlink.gcs.sent_commands import SentCommands
from uav_task_alloc.mavlink.gcs.status_texts import StatusTexts
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Point

DOUBT = 5.0  # [s] in which a message under way may explain a change of mode


@dataclass(slots=True)
class Doubt:
    """A change of mode that a message under way may explain."""

    until: float  # [s]
    explained: Callable[[float], bool]
    why: str  # it is lost otherwise
    ours: int | None = None  # custom_mode of ours that explains it


@dataclass(slots=True)
class AuthorityWatchState:
    """What was seen of one vehicle and sent to it, and what of that is still open."""

    profile: Profile
    telemetry: Telemetry
    authority: Authority
    sent: SentCommands
    flown: bool = False  # armed since the grant
    texts: StatusTexts = field(default_factory=StatusTexts)
    notes: deque[OperatorNote] = field(default_factory=deque)
    mode: int | None = None  # custom_mode of the newest heartbeat
    armed: bool = False
    status: int = 0  # MAV_STATE
    unconfirmed: bool = False  # the next heartbeat tells the mode, and is no change
    doubt: Doubt | None = None
    rest: tuple[float, Point] | None = None  # since when [s], where: STICK -> HOLD
    mission_on_ground: bool = False  # MISSION was set on the ground, by another
    maybe_ours: bool = False  # in MISSION when the bridge started
    hold_due: bool = False  # first, where it turns out to be in the air after a restart
    descending: bool = False  # by our RETURN
    was_airborne: bool = False
    swap_at: float | None = None  # [s] since when we hold it for an upload

    def class_of(self, mode: int | None) -> ModeClass | None:
        """Who decides in a mode; None: not known."""
        return None if mode is None else mode_class(self.profile.family, mode)

    def name_of(self, mode: int | None) -> str:
        """A mode, as its own ground station shows it."""
        return 'no mode' if mode is None else mode_name(self.profile.family, mode)

    def returns(self, mode: int | None) -> bool:
        """Whether a mode takes it home."""
        return mode is not None and self.profile.mode_function(mode) is ModeFunction.RETURN

    @property
    def booting(self) -> bool:
        """A heartbeat says so: while SUSPENDED nothing asks for a message with its clock."""
        return self.status in (d.MAV_STATE_BOOT, d.MAV_STATE_CALIBRATING)

    def failing(self, now: float) -> bool:
        """A failsafe is active, or was named a moment ago."""
        return bool(self.status >= d.MAV_STATE_CRITICAL) or self.texts.failsafe(now)

    def forget_mode(self) -> None:
        """What was concluded from the mode before holds no longer."""
        self.rest, self.mission_on_ground, self.maybe_ours = None, False, False

    def apply(self, event: AuthorityEvent, now: float, why: str) -> None:
        """Follow the authority table, and drop what the new state makes void.

        Args:
            event: what happened.
            now: steady time [s].
            why: in words, for people.
        """
        before = self.authority.state
        if not self.authority.apply(event, now, why):
            return
        state = self.authority.state
        if state is AuthorityState.LOST and before is not AuthorityState.LOST:
            self.doubt, self.rest = None, None
            self.sent.modes.clear()
        if state is AuthorityState.SUSPENDED and not self.unconfirmed:
            self.sent.modes.clear()
        if state is AuthorityState.HELD and before in (AuthorityState.LOST, AuthorityState.NONE):
            self.flown = self.armed
        if self.swap_at is not None:
            self.swap_at = (
                now if state in (AuthorityState.HELD, AuthorityState.SUSPENDED) else None
            )
        back = self.authority.given_back_by
        self.notes.append(
            OperatorNote(
                'info' if state in (AuthorityState.HELD, AuthorityState.NONE) else 'warning',
                f'authority {state.name}: {why}' + (f'; given back by {back}' if back else ''),
            )
        )

    def take(self, why: str, now: float) -> None:
        """Somebody else has changed the mode."""
        swap = self.swap_at is not None and self.authority.held
        self.apply(
            AuthorityEvent.SWAP_TAKEN if swap else AuthorityEvent.TAKEN,
            now,
            f'not by the bridge: {why}',
        )

    def wait_for_reason(self, explained: Callable[[float], bool], why: str, now: float, *,
                        within: float = DOUBT, ours: int | None = None) -> None:
        """A change of mode that nothing explains yet: SUSPENDED until something does.

        Args:
            explained: whether something explains it by a time [s].
            why: what changed, in words.
            now: steady time [s].
            within: [s] in which it has to be explained; it is lost after that.
            ours: custom_mode of ours that explains it, if it is seen.
        """
        self.doubt = Doubt(now + within, explained, why, ours)
        self.apply(AuthorityEvent.UNEXPLAINED, now, why)
