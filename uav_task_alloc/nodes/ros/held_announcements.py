# SPDX-License-Identifier: Apache-2.0
"""Announcements that wait until the origin is known: in WGS84, and all after one of them."""
from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions.announcements import is_in_wgs84
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS


class HeldAnnouncements:
    """A queue of as many announcements as the topic keeps; the order of all counts.

    Args:
        log: writes one line.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._held: deque[m.TaskAnnouncement] = deque()

    def holds(self, msg: m.TaskAnnouncement) -> bool:
        """Hold a message where it has to wait.

        Args:
            msg: received while the origin is not known; not yet checked.

        Returns:
            Whether it waits; otherwise it does not depend on the origin.

        Raises:
            InvalidValue: it has to wait, and too many do.
        """
        if not self._held and not is_in_wgs84(msg):
            return False
        if len(self._held) >= ANNOUNCEMENTS.depth:
            raise InvalidValue('fleet_origin', 'unknown', 'an origin for tasks in WGS84')
        if not self._held:
            self._log('tasks in WGS84, and later ones, wait for fleet_origin')
        self._held.append(msg)
        return True

    def release(self) -> Iterator[m.TaskAnnouncement]:
        """Return what waited, in order, when the origin is known."""
        while self._held:
            yield self._held.popleft()
