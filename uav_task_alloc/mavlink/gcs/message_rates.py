# SPDX-License-Identifier: Apache-2.0
"""Requests the messages that the bridge needs: those it flies by until they come."""
from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.telemetry_messages import ESTIMATE, RATES
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message

# without them no mission is flown, or the end of none known
_NEEDED = frozenset({d.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, d.MAVLINK_MSG_ID_MISSION_CURRENT,
                     d.MAVLINK_MSG_ID_EXTENDED_SYS_STATE})
_PERIOD = 2.0  # [s] between requests
MAX_REQUESTS = 5
_SLOW = 10.0  # [s] between later requests of what is needed
_SILENT = 10.0  # [s] plus four periods without a message that was received before
_ROUNDING = 1e-3  # [s] more than sums of times are inexact
_QUIET = 3.0  # [s] without a position: perhaps restarted, which only new rates show


class MessageRates:
    """Sends SET_MESSAGE_INTERVAL for each of RATES, repeated for missing messages."""

    def __init__(self, peer: Peer, telemetry: Telemetry, now: float) -> None:
        self._peer, self._telemetry = peer, telemetry
        self._silent: set[int] = set()  # received once, and missing now
        # until when [s] none can be missing of these rates
        self._complete_until, self._complete = -math.inf, RATES
        self._rates: dict[int | None, dict[int, float]] = {None: RATES}  # by estimator report
        self.restart(now)

    def restart(self, now: float) -> None:
        """Request all again: a restart of the vehicle resets the rates."""
        self._due, self._requests, self._received = now, 0, False

    def step(self, now: float) -> list[Message]:
        """The requests that are due."""
        quiet = now - self._telemetry.positions_at > _QUIET
        if self._received and quiet and not self._telemetry.link.stale(now):
            self._telemetry.received_ids.clear()
            self.restart(now)
        self._received = self._received or not quiet
        estimate = ESTIMATE.get(self._telemetry.autopilot)
        rates = self._rates.get(estimate)
        if rates is None and estimate is not None:
            rates = self._rates[estimate] = {**RATES, estimate: 1.0}
        assert rates is not None
        silent = self._find_silent(rates, now)
        if silent - self._silent and not self._telemetry.link.stale(now):
            self.restart(now)
        self._silent = silent
        if now < self._due:
            return []
        all_asked = self._requests >= MAX_REQUESTS
        self._due = now + (_SLOW if all_asked else _PERIOD)
        missing = [number for number in (_NEEDED if all_asked else rates)
                   if number in silent or number not in self._telemetry.received_ids]
        if self._requests and not missing:
            return []
        self._requests += 1
        # all at first: a stream may be received at a lower rate
        out = [self._peer.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rates[number])
               for number in (rates if self._requests == 1 else missing)]
        if self._telemetry.home is None:
            out.append(self._peer.command(d.MAV_CMD_REQUEST_MESSAGE,
                                          d.MAVLINK_MSG_ID_HOME_POSITION))
        return out

    def _find_silent(self, rates: dict[int, float], now: float) -> set[int]:
        """The messages that were received once, and are missing now."""
        if now < self._complete_until and rates is self._complete:
            return set()  # as at most steps
        last = self._telemetry.received_last
        silent = {number for number, rate in rates.items()
                  if now - last.get(number, now) > _SILENT + 4.0 / rate}
        soonest = min(last.get(number, now) + 4.0 / rate for number, rate in rates.items())
        self._complete_until = -math.inf if silent else soonest + _SILENT - _ROUNDING
        self._complete = rates
        return silent
