# SPDX-License-Identifier: Apache-2.0
"""Compares a vehicle with its last known mode after silence, a new address or a reboot."""
from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch_state import (
    EXPLANATION_TIME,
    AuthorityWatchState,
    UnexplainedChange,
)
from uav_task_alloc.mavlink.gcs.boot_clock import CLOCK_TIME
from uav_task_alloc.mavlink.gcs.link_times import STALE
from uav_task_alloc.mavlink.gcs.telemetry import UNKNOWN

_SAME_CLOCK = 8000.0  # [ms] by which the clock of one vehicle differs at most, with late messages
_SAME_PLACE, _FASTEST = 100.0, 40.0  # [m], and [m/s], by which its place differs at most
_HEARTBEAT_DELAY = 1.0  # [s]; one received later than that after a boot was sent after it


class LinkLoss:
    """Detects changes of mode and arming that no heartbeat has shown.

    Args:
        state: of the vehicle; changed by the methods.
    """

    def __init__(self, state: AuthorityWatchState) -> None:
        self._state = state
        self.was_lost = False  # the link was, and the mode is not confirmed yet
        # the clock of the vehicle before a new address, with the time [s] of that
        self._forecast: Callable[[float], float] | None = None
        self._moved_at = self._position_at = -math.inf
        self._position = UNKNOWN  # [m] ENU before it
        # modes and armed states that count as unchanged when the link is back
        self._modes: frozenset[int | None] = frozenset()
        self._armed: frozenset[bool] = frozenset()

    def step(self, now: float) -> None:
        """Detect a stale link."""
        state, telemetry = self._state, self._state.telemetry
        self.was_lost = state.unconfirmed and (self.was_lost or telemetry.link.lost(now))
        if telemetry.link.stale(now) and not state.unconfirmed and state.mode is not None:
            self._expect_unchanged(now)
            state.apply(AuthorityEvent.LINK_STALE, now, telemetry.link.stale_text(now))

    def address_changed(self, now: float) -> None:
        """Await a heartbeat: the messages may come from another vehicle with the same id."""
        if not self._state.unconfirmed:
            self._expect_unchanged(now)
        telemetry = self._state.telemetry
        self._forecast, self._moved_at = telemetry.clock_forecast(), now
        self._position, self._position_at = telemetry.position, telemetry.position_at
        self._state.apply(AuthorityEvent.NEW_ADDRESS, now, 'its messages come from a new address')

    def _expect_unchanged(self, now: float) -> None:
        """Store which modes and armed states the next heartbeat may show, pending ones too."""
        state, sent = self._state, self._state.sent
        state.unconfirmed = True
        entered = sent.acks.mode_entered_by(state.telemetry.frame + 1)
        before = state.mode if entered is None else entered  # no heartbeat has shown it
        sent.acks.clear()
        arms = {True} if now <= sent.arm_until + STALE else set()
        self._modes = frozenset({before, *sent.pending_modes(now - STALE)})
        self._armed = frozenset({state.armed} | arms)

    def confirm(self, now: float) -> None:
        """Check the first heartbeat after silence, from a new address, or after a reboot."""
        state = self._state
        if not state.authority.suspended_by(Suspension.LINK):
            state.unconfirmed = False
            if state.authority.held and state.armed and not state.flown and (
                    now > state.sent.arm_until):  # no vehicle boots armed
                state.apply(AuthorityEvent.ARMED_BY_OTHER, now, 'armed, not by the bridge')
            return
        if self._forecast is not None and self._awaits_clock(self._forecast, now):
            return
        if (state.mode in self._modes and state.armed in self._armed) or (
                state.booting and not (state.flown or state.armed)):
            state.unconfirmed = False
            if not state.authority.suspended_by(Suspension.UNEXPLAINED):
                state.unexplained = None  # else it is still to be explained, or lost
            state.apply(AuthorityEvent.LINK_BACK, now,
                        f'the link is back, in {state.name_of(state.mode)}')
            return
        names = ' or '.join(sorted(map(state.name_of, self._modes)))
        why = f'the link is back, in {state.name_of(state.mode)} instead of {names}'
        if state.flown or state.armed:
            state.unconfirmed = False
            state.apply(AuthorityEvent.LINK_CHANGED, now, why)
        elif state.unexplained is None:  # its clock will show whether it rebooted
            state.unexplained = UnexplainedChange(now + EXPLANATION_TIME, lambda t: False, why)

    def _awaits_clock(self, forecast: Callable[[float], float], now: float) -> bool:
        """Whether the clock at a new address is awaited, or shows another vehicle in flight.

        A vehicle continues to send what was asked for: one that sends no clock is another one.
        """
        state, telemetry = self._state, self._state.telemetry
        known = telemetry.boot_ms > 0 and telemetry.has_position
        if not known and now - self._moved_at < CLOCK_TIME:
            return True
        self._forecast = None
        reach = _SAME_PLACE + _FASTEST * (now - self._position_at)
        same = known and abs(telemetry.boot_ms - forecast(now)) <= _SAME_CLOCK and (
            not math.dist(telemetry.position, self._position) > reach)
        if same or not (state.flown or state.armed):
            return False
        state.unconfirmed = False
        state.apply(AuthorityEvent.LINK_CHANGED, now, 'by its clock or place the vehicle at its '
                    'new address is another one')
        return True

    def vehicle_rebooted(self, now: float) -> None:
        """Apply a reboot of the vehicle, of which its clock went back."""
        state = self._state
        state.rebooted_on_ground = not math.isnan(state.landed_battery)
        state.apply(AuthorityEvent.REBOOTED_FLOWN if state.flown else AuthorityEvent.REBOOTED, now,
                    'the vehicle rebooted')
        if not state.authority.suspended_by(Suspension.LINK):
            state.unconfirmed = not self._has_shown_boot_mode()
        elif not state.flown:
            state.unconfirmed = False
            state.apply(AuthorityEvent.LINK_BACK, now,
                        'the vehicle rebooted, and was never armed')
        state.sent.clear_pending()
        state.descending = state.was_airborne = state.mission_on_ground = False

    def _has_shown_boot_mode(self) -> bool:
        """Whether a heartbeat sent after the boot has shown the mode; another has set a later one.

        While it reports that it boots, its mode is not final.
        """
        state = self._state
        return (state.authority.state in (AuthorityState.HELD, AuthorityState.SUSPENDED)
                and state.status >= d.MAV_STATE_STANDBY
                and state.heartbeat_at > state.telemetry.booted_at + _HEARTBEAT_DELAY)
