# SPDX-License-Identifier: Apache-2.0
"""Rolling horizon: the number of tasks uploaded at a time where a mission store is too small."""
from __future__ import annotations

import re

from uav_task_alloc.errors import counted

SPACE_TEXT = re.compile(r'Only (\d+) items are supported')


class Horizon:
    """Halves when the vehicle refuses with NO_SPACE, doubles once the shorter list is on board."""

    def __init__(self) -> None:
        self.stops: int | None = None  # None: all
        self.fits = False  # the shortened list is on board: there may be space for more
        self._space: int | None = None  # [items] reported by STATUSTEXT

    def reset(self) -> None:
        """Try a new list as a whole."""
        self.stops = None

    def begin(self) -> None:
        """Drop the space reported before this upload."""
        self._space = None

    def verified(self) -> None:
        """Note that the uploaded list is on board."""
        self.fits = self.stops is not None

    def note(self, text: str) -> None:
        """Read the space from a STATUSTEXT (ArduPilot)."""
        match = SPACE_TEXT.search(text)
        if match:
            self._space = int(match[1])

    def shrink(self, stops: int) -> str:
        """Fly fewer tasks at a time; where not even one fits, the store is not loaded yet.

        Args:
            stops: number of tasks that were refused.

        Returns:
            A warning for the operator; `self.stops` is None where the whole list is retried.
        """
        if stops <= 1 or self._space == 0:
            self.stops = None
            return 'no space on board for any task yet: retrying'
        self.stops, self.fits = stops // 2, False
        return (f'no space on board: flying the first {counted(self.stops, "task")} of '
                f'{stops}, the others follow')

    def cut(self, stops: int, items: int, most: int) -> str:
        """Fly the tasks that a mission can hold.

        Args:
            stops: number of tasks that fit, at least one.
            items: number of items of the whole list.
            most: number of items that a mission can hold.

        Returns:
            A warning for the operator.
        """
        self.stops, self.fits = stops, False
        return (f'the list takes {items} mission items: expected at most {most}: flying the first '
                f'{counted(stops, "task")}, the others follow')

    def grow(self) -> bool:
        """Double the horizon where the present one is on board; False where that is not known."""
        if not self.fits or self.stops is None:
            return False
        self.fits, self.stops = False, 2 * self.stops
        return True
