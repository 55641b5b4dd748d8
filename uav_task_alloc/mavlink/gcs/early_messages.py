# SPDX-License-Identifier: Apache-2.0
"""Reports of progress that arrive before the first heartbeat of a vehicle.

A bridge that was restarted knows no vehicle until its heartbeat; what a vehicle reaches in that
second is reported once.
"""
from __future__ import annotations

from collections import deque
from collections.abc import Hashable

from uav_task_alloc.mavlink.transport.codec import Message

_KINDS = ('GLOBAL_POSITION_INT', 'MISSION_CURRENT', 'MISSION_ITEM_REACHED')
_KEPT = 64  # messages of a system: two seconds
_SYSTEMS = 64
_MAX_AGE = 5.0  # [s]


class EarlyMessages:
    """Keeps a few messages of each system that is not known yet."""

    def __init__(self) -> None:
        self._kept: dict[int, deque[tuple[Hashable, Message, float]]] = {}

    def keep(self, address: Hashable, message: Message, now: float) -> None:
        """Keep a message of an unknown system, if it reports progress.

        Args:
            address: from which it came.
            message: any.
            now: steady time [s].
        """
        system = message.get_srcSystem()
        if message.get_type() in _KINDS and (
                system in self._kept or len(self._kept) < _SYSTEMS):
            self._kept.setdefault(system, deque(maxlen=_KEPT)).append((address, message, now))

    def take(self, system: int, address: Hashable, now: float) -> list[tuple[Message, float]]:
        """Remove the messages of a system that is known now.

        Args:
            system: its id.
            address: from which its heartbeat came.
            now: steady time [s].

        Returns:
            Those of the last seconds from that address, with the times [s] of their reception.
        """
        return [(message, at) for source, message, at in self._kept.pop(system, ())
                if source == address and now - at <= _MAX_AGE]
