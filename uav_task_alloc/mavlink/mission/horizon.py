# SPDX-License-Identifier: Apache-2.0
"""How many tasks go on board at a time, where the mission store of a vehicle has no space."""
from __future__ import annotations

import re

_SPACE_TEXT = re.compile(r'Only (\d+) items are supported')


class Horizon:
    """Shrinks where the vehicle refuses, and grows again where what is on board fits."""

    def __init__(self) -> None:
        self.stops: int | None = None  # None: all
        self.fits = False  # it is on board: there may be space for more
        self._space: int | None = None  # items that the vehicle says it has space for

    def reset(self) -> None:
        """A new list is tried as a whole."""
        self.stops = None

    def begin(self) -> None:
        """An upload begins: what was said of space was said before."""
        self._space = None

    def verified(self) -> None:
        """What was uploaded is on board."""
        self.fits = self.stops is not None

    def note(self, text: str) -> None:
        """STATUSTEXT: for how many items the vehicle has space."""
        found = _SPACE_TEXT.search(text)
        if found:
            self._space = int(found[1])

    def shrink(self, stops: int) -> str:
        """Fly fewer tasks at a time; where not even one fits the store is not open yet.

        Args:
            stops: tasks that were refused.

        Returns:
            What to tell; `stops` is None where the same is tried again.
        """
        if stops <= 1 or self._space == 0:
            self.stops = None
            return 'no space on board for any task yet: trying again'
        self.stops, self.fits = stops // 2, False
        return (f'no space on board: flying the first {self.stops} tasks of {stops}, '
                'the others follow')

    def cut(self, stops: int, items: int, most: int) -> str:
        """Fly the tasks that a mission can hold; returns what to tell.

        Args:
            stops: tasks that fit, at least one.
            items: what the whole list takes.
            most: what a mission can hold.
        """
        self.stops, self.fits = stops, False
        return (f'the list takes {items} mission items: expected at most {most}: flying the first '
                f'{stops} tasks, the others follow')

    def grow(self) -> bool:
        """Twice as many, where what was tried fits; False: that is not known."""
        if not self.fits or self.stops is None:
            return False
        self.fits, self.stops = False, 2 * self.stops
        return True
