# SPDX-License-Identifier: Apache-2.0
"""The executor of a node: as rclpy's for one thread, for less CPU where there are many topics."""
from __future__ import annotations

import time
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.executors import SingleThreadedExecutor

_EVENT_PERIOD = 1.0  # [s] within which an event, as of an incompatible QoS, is handled


class NodeExecutor(SingleThreadedExecutor):
    """Waits for events of publishers and subscriptions once a second only.

    rclpy adds up to two to each, and prepares all of them before it waits for a message: most of
    what an executor computes. An event that occurs in between is kept by the middleware.

    Args:
        kwargs: of `SingleThreadedExecutor`.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._events_at, self._with_events = 0.0, True  # [s] steady clock

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Execute one callback that is ready.

        Args:
            timeout_sec: how long to wait for one [s]; None: for ever, also for an event.
        """
        now = time.monotonic()
        self._with_events = timeout_sec is None or now >= self._events_at
        if self._with_events:
            self._events_at = now + _EVENT_PERIOD
        super().spin_once(timeout_sec)

    def can_execute(self, entity: object) -> bool:
        """Whether to wait for an entity now."""
        return (self._with_events or not isinstance(entity, EventHandler)) and (
            super().can_execute(entity))
