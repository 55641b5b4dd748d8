# SPDX-License-Identifier: Apache-2.0
"""How long the search for ways may go on: kernels count their work and ask a clock now and then.

A unit of work is a look at one zone or one corner, a few nanoseconds. A search that was cut short
has found out nothing: its way is not known, which is not the same as that there is none.
"""
from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from uav_task_alloc.geometry.numba_pointers import float_of, ints_at
from uav_task_alloc.geometry.obstacles import Ints
from uav_task_alloc.kernel import allocating_kernel

SINCE, OVER, MOST, CUT, ASK = range(5)  # what the state holds
_EVERY = 50_000  # units between two looks at the clock
UNLIMITED = 1 << 62

_Question = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class SearchBudget:
    """What searches may spend: all together until `over` says so, each at most `most` units."""

    def __init__(self, over: Callable[[], bool] | None = None) -> None:
        self.state = np.zeros(5, np.int64)
        self.state[MOST] = UNLIMITED
        self._over = over
        self._error: BaseException | None = None
        self._question = _Question(self._ask) if over else None
        if self._question:
            self.state[ASK] = ctypes.cast(self._question, ctypes.c_void_p).value or 0

    def _ask(self, *_: int) -> float:
        """Called by kernels; what is raised here would be lost there."""
        try:
            return 1.0 if self._over and self._over() else 0.0
        except BaseException as error:
            self._error = self._error or error
            return 1.0

    def begin(self, most: int = UNLIMITED) -> None:
        """A stage in which each search may take `most` units; nothing is cut yet."""
        self.state[[OVER, MOST, CUT]] = 0, most, 0
        self.look()

    def look(self) -> bool:
        """Ask the clock now; whether the time is over. Raises what the question raised."""
        if self._ask() > 0.0:
            self.state[OVER] = 1
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        return self.is_over

    @property
    def is_over(self) -> bool:
        """Whether the time was over when the clock was asked last."""
        return bool(self.state[OVER])

    @property
    def cut(self) -> int:
        """Searches cut short in this stage."""
        return int(self.state[CUT])


@allocating_kernel
def is_over(address: int) -> bool:
    """Whether no search may go on."""
    return address != 0 and ints_at(address)[OVER] != 0


@allocating_kernel
def new_work(address: int) -> Ints:
    """The account of one search: units spent, where the state is (0: unlimited), cut short."""
    work = np.zeros(3, np.int64)
    work[1] = address
    return work


@allocating_kernel
def spend(work: Ints, units: int) -> bool:
    """Spend units of work; whether the search has to end."""
    if work[1] == 0:
        return False
    state = ints_at(work[1])
    work[0] += units
    state[SINCE] += units
    if state[SINCE] > _EVERY:
        state[SINCE] = 0
        if state[ASK] != 0 and float_of(state[ASK], 0, 0, 0) != 0.0:
            state[OVER] = 1
    if state[OVER] != 0 or work[0] > state[MOST]:
        work[2] = 1
    return bool(work[2] != 0)
