# SPDX-License-Identifier: Apache-2.0
"""Asks a vehicle for the messages the bridge lives on, until they come or it is no use."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.telemetry import ESTIMATE, RATES, Telemetry
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message

PERIOD, TRIES = 2.0, 5  # [s] between requests
_SILENT = 10.0  # [s] without a message that came before, and four of its periods
_QUIET = 3.0  # [s] without a position: perhaps restarted, which only new rates will show


class MessageRates:
    """SET_MESSAGE_INTERVAL for each of RATES, again for those that stay away."""

    def __init__(self, peer: Peer, telemetry: Telemetry, now: float) -> None:
        self._peer, self._telemetry = peer, telemetry
        self._silent: set[int] = set()  # came once, and stay away
        self.again(now)

    def again(self, now: float) -> None:
        """A restart forgets what was asked."""
        self._due, self._asked, self._came = now, 0, False

    def step(self, now: float) -> list[Message]:
        """What is to be asked now."""
        quiet = now - self._telemetry.positions_at > _QUIET
        if self._came and quiet and not self._telemetry.stale(now):
            self._telemetry.received_ids.clear()
            self.again(now)
        self._came = self._came or not quiet
        estimate = ESTIMATE.get(self._telemetry.autopilot)
        rates = {**RATES, estimate: 1.0} if estimate is not None else RATES
        last = self._telemetry.received_last
        silent = {number for number, rate in rates.items()
                  if now - last.get(number, now) > _SILENT + 4.0 / rate}
        if silent - self._silent and not self._telemetry.stale(now):
            self.again(now)
        self._silent = silent
        missing = [number for number in rates
                   if number in silent or number not in self._telemetry.received_ids]
        if now < self._due or self._asked >= TRIES or (self._asked and not missing):
            return []
        self._asked += 1
        self._due = now + PERIOD
        # all of them at first: a stream may be there, and too slow
        out = [self._peer.command(d.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rates[number])
               for number in (rates if self._asked == 1 else missing)]
        if self._telemetry.home is None:
            out.append(self._peer.command(d.MAV_CMD_REQUEST_MESSAGE,
                                          d.MAVLINK_MSG_ID_HOME_POSITION))
        return out
