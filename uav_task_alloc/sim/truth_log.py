# SPDX-License-Identifier: Apache-2.0
"""The ground truth of one simulated vehicle: what happened on board, where, and who caused it."""
from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from uav_task_alloc.model import Point
from uav_task_alloc.sim.config import TruthEvent


class TruthLog:
    """Records events at the present time and true position.

    Args:
        present: returns the vehicle time [s] and the position [m] ENU.

    Attributes:
        cause: of what is done now, see `TruthEvent`.
    """

    def __init__(self, present: Callable[[], tuple[float, Point]]) -> None:
        self._present = present
        self._events: list[TruthEvent] = []
        self.cause = 'self'

    @contextmanager
    def caused_by(self, cause: str) -> Iterator[None]:
        """Have this cause within the context instead of the one before."""
        before, self.cause = self.cause, cause
        try:
            yield
        finally:
            self.cause = before

    def note(self, name: str, *, point: Point | None = None, seq: int | None = None,
             mode: int | None = None, cause: str = '', command: str = '') -> None:
        """Record an event; see `TruthEvent` for its fields.

        Args:
            name, seq, mode, cause, command: of the event.
            point: its place [m] ENU; None: the position of the vehicle.
        """
        now, position = self._present()
        self._events.append(TruthEvent(
            now, name, position if point is None else point, seq, mode, cause, command))

    def take(self) -> list[TruthEvent]:
        """Return the events since the last call, and clear them."""
        events, self._events = self._events, []
        return events
