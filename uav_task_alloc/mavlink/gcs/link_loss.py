# SPDX-License-Identifier: Apache-2.0
"""Judges silence, a new address and a restart of the vehicle: is it still as it was left?"""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.authority import AuthorityEvent, Suspension
from uav_task_alloc.mavlink.gcs.authority_watch_state import DOUBT, AuthorityWatchState, Doubt
from uav_task_alloc.mavlink.gcs.telemetry import STALE


class LinkLoss:
    """The link to one vehicle, as far as its mode may have changed unseen."""

    def __init__(self, state: AuthorityWatchState) -> None:
        self._state = state
        self.was_lost = False  # the link, and the mode is not confirmed yet
        # modes and armed states that are no news when the link is back
        self._modes: frozenset[int | None] = frozenset()
        self._armed: frozenset[bool] = frozenset()

    def step(self, now: float) -> None:
        """Let time pass."""
        state, telemetry = self._state, self._state.telemetry
        self.was_lost = state.unconfirmed and (self.was_lost or telemetry.lost(now))
        if telemetry.stale(now) and not state.unconfirmed and state.mode is not None:
            self._lose_sight(now)
            state.apply(AuthorityEvent.LINK_STALE, now, 'nothing heard for 3 s')

    def new_address(self, now: float) -> None:
        """It speaks from elsewhere: the same vehicle, or another one with its id."""
        if not self._state.unconfirmed:
            self._lose_sight(now)
        self._state.apply(AuthorityEvent.NEW_ADDRESS, now, 'heard from a new address')

    def _lose_sight(self, now: float) -> None:
        """The next heartbeat is compared with what is known, and what we have just asked for."""
        state, sent = self._state, self._state.sent
        state.unconfirmed = True
        sent.acks.clear()
        arms = {True} if now <= sent.arm_until + STALE else set()
        self._modes = frozenset({state.mode, *sent.under_way(now - STALE)})
        self._armed = frozenset({state.armed} | arms)

    def confirm(self, now: float) -> None:
        """The first heartbeat after silence, from a new address, or after a reboot."""
        state = self._state
        if not state.authority.suspended_by(Suspension.LINK):
            state.unconfirmed = False
            return
        if (state.mode in self._modes and state.armed in self._armed) or (
                state.booting and not (state.flown or state.armed)):
            state.unconfirmed, state.doubt = False, None
            state.apply(
                AuthorityEvent.LINK_BACK, now, f'heard again, in {state.name_of(state.mode)}'
            )
            return
        names = ' or '.join(sorted(map(state.name_of, self._modes)))
        why = f'heard again, in {state.name_of(state.mode)} instead of {names}'
        if state.flown or state.armed:
            state.unconfirmed = False
            state.apply(AuthorityEvent.LINK_CHANGED, now, why)
        elif state.doubt is None:  # its clock will tell whether it was restarted
            state.doubt = Doubt(now + DOUBT, lambda t: False, why)

    def rebooted(self, now: float) -> None:
        """Its clock went back."""
        state = self._state
        state.apply(AuthorityEvent.REBOOTED_FLOWN if state.flown else AuthorityEvent.REBOOTED, now,
                    'the vehicle was restarted')
        if not state.authority.suspended_by(Suspension.LINK):
            state.unconfirmed = True
        elif not state.flown:
            state.unconfirmed = False
            state.apply(
                AuthorityEvent.LINK_BACK, now, 'the vehicle was restarted, and never armed'
            )
        state.sent.drop()
        state.descending = state.was_airborne = state.mission_on_ground = False
