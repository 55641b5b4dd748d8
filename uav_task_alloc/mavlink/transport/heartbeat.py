# SPDX-License-Identifier: Apache-2.0
"""The heartbeat of the bridge: a monitored thread that no other work can block."""
from __future__ import annotations

import math
import threading
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.refused_messages import failure

_PERIOD = 1.0  # [s]
_OVERDUE = 3.0  # periods without a heartbeat


class Heartbeat:
    """Sends HEARTBEAT periodically from a thread of its own.

    Args:
        send: thread safe; sends a message to all remotes.
        period: [s] between heartbeats.
    """

    def __init__(self, send: Callable[[Message], None], period: float = _PERIOD) -> None:
        self.sent = 0  # number of heartbeats
        self.restarts = 0  # number of restarts of the thread after an error
        self.trouble = ''  # why no heartbeat is sent; '': it is sent
        self._send, self._period, self._stop = send, period, threading.Event()
        self._thread: threading.Thread | None = None
        self._seen, self._seen_at = -1, -math.inf

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name='heartbeat', daemon=True)
        self._thread.start()

    def watch(self, now: float) -> None:
        """Restart the thread if it has ended; `trouble` holds the reason until the next heartbeat.

        Args:
            now: steady time [s].
        """
        if self._thread is None or self._stop.is_set():
            return
        if not self._thread.is_alive():
            self.restarts += 1
            self.start()
        if self.sent != self._seen:
            self._seen, self._seen_at = self.sent, now
        elif now - self._seen_at > _OVERDUE * self._period and not self.trouble:
            self.trouble = f'none was sent for more than {_OVERDUE * self._period:g} s'

    def close(self) -> None:
        """Stop the thread; returns when it has ended, or after some periods."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(2.0 * self._period + 1.0)

    def _run(self) -> None:
        try:
            while not self._stop.wait(self._period):
                self._send(d.MAVLink_heartbeat_message(
                    d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID, 0, 0, d.MAV_STATE_ACTIVE, 3))
                self.sent, self.trouble = self.sent + 1, ''
        except Exception as error:
            self.trouble = f'its thread has ended: {failure(error)}'
