# SPDX-License-Identifier: Apache-2.0
"""Decides whether a node that has exited is restarted, and when; imports no launch."""
from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

_REFUSED = (1, 2)  # exit statuses of a node that refuses its parameters, see run.py
_SHORT_RUN = 30.0  # [s]; a shorter run doubles the delay
_FIRST_DELAY, _LONGEST_DELAY = 1.0, 30.0  # [s] before a restart
_MOST_REFUSALS = 5  # in a row, after a run without


class RestartVerdict(Enum):
    """What is done about a node that has exited."""

    RESTART = auto()  # after `RestartPolicy.delay`
    END_ALL = auto()  # its first run refused the parameters, and nothing flies yet
    GIVE_UP = auto()  # it refuses its parameters repeatedly; the other nodes go on


@dataclass
class RestartPolicy:
    """Counts the runs of one node."""

    delay: float = _FIRST_DELAY  # [s]
    runs: int = 0
    refusals: int = 0  # in a row

    def on_exit(self, status: int, duration: float) -> RestartVerdict:
        """Decide about a node that has exited.

        Args:
            status: exit status of the process.
            duration: of the run [s].
        """
        self.runs += 1
        refused = status in _REFUSED
        self.refusals = self.refusals + 1 if refused else 0
        if refused and self.runs == 1:
            return RestartVerdict.END_ALL
        if self.refusals >= _MOST_REFUSALS:
            return RestartVerdict.GIVE_UP
        short = duration < _SHORT_RUN and self.runs > 1
        self.delay = min(2.0 * self.delay, _LONGEST_DELAY) if short else _FIRST_DELAY
        return RestartVerdict.RESTART
