# SPDX-License-Identifier: Apache-2.0
"""Whether a node that has died is started again, and when; no launch in it."""
from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

REFUSED = 1  # exit status of a node that refuses its parameters, see run.py
SHORT = 30.0  # [s] a life that ends earlier makes the next one wait longer
FIRST, LONGEST = 1.0, 30.0  # [s] before it is started again
MOST_REFUSALS = 5  # in a row, after it had run


class RestartVerdict(Enum):
    """What becomes of a node that has died."""

    AGAIN = auto()  # started again after `Restarts.delay`
    END_ALL = auto()  # it never ran: its parameters are wrong, and nobody flies yet
    GIVE_UP = auto()  # it refuses its parameters again and again; the others go on


@dataclass
class RestartPolicy:
    """The lives of one node."""

    delay: float = FIRST  # [s]
    lives: int = 0
    refusals: int = 0  # in a row

    def died(self, status: int, lived: float) -> RestartVerdict:
        """It has ended with an exit status after a life of so many seconds."""
        self.lives += 1
        self.refusals = self.refusals + 1 if status == REFUSED else 0
        if status == REFUSED and self.lives == 1:
            return RestartVerdict.END_ALL
        if self.refusals >= MOST_REFUSALS:
            return RestartVerdict.GIVE_UP
        short = lived < SHORT and self.lives > 1
        self.delay = min(2.0 * self.delay, LONGEST) if short else FIRST
        return RestartVerdict.AGAIN
