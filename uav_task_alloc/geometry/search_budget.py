# SPDX-License-Identifier: Apache-2.0
"""How long the search for paths may go on: kernels count their work and poll a clock regularly.

A unit of work is a test of one zone or one corner, a few nanoseconds. A search that was cut short
has no result: its path is unknown, which is not the same as that there is none.

Kernels share two int64 arrays. The state of a budget (5): units since the last poll, 1 where the
budget is exhausted, units that one search may take, searches cut short, address of the poll. The
work of one search (3): units spent, address of the state (0: no limit), 1 where it was cut short.
"""
from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from uav_task_alloc.geometry.numba_pointers import call_float, ints_at
from uav_task_alloc.geometry.obstacles import Ints
from uav_task_alloc.kernel import inner_allocating_kernel

UNCHECKED, EXHAUSTED, MAX_UNITS, CUT_SHORT, CLOCK = range(5)  # indices of the state
_EVERY = 50_000  # units between two polls of the clock
UNLIMITED = 1 << 62

_Callback = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class SearchBudget:
    """What searches may spend: all together until `time_is_up`, each at most a number of units.

    Args:
        time_is_up: called by kernels about every 50 000 units; True ends all searches.
            None: the time is never up.
    """

    def __init__(self, time_is_up: Callable[[], bool] | None = None) -> None:
        self.state = np.zeros(5, np.int64)
        self.state[MAX_UNITS] = UNLIMITED
        self._time_is_up = time_is_up
        self._error: BaseException | None = None
        self._callback = _Callback(self._poll) if time_is_up else None
        if self._callback:
            self.state[CLOCK] = ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _poll(self, *_: int) -> float:
        """Called by kernels, which would lose an exception: it is kept for `check`."""
        try:
            return 1.0 if self._time_is_up and self._time_is_up() else 0.0
        except BaseException as error:
            self._error = self._error or error
            return 1.0

    def start_stage(self, max_units: int = UNLIMITED) -> None:
        """Start a stage of the search: nothing is exhausted or cut short yet.

        Args:
            max_units: units of work that each search of the stage may take.

        Raises:
            Exception: what `time_is_up` raised.
        """
        self.state[[EXHAUSTED, MAX_UNITS, CUT_SHORT]] = 0, max_units, 0
        self.check()

    def check(self) -> bool:
        """Poll the clock now.

        Returns:
            Whether the budget is exhausted.

        Raises:
            Exception: what `time_is_up` raised, now or when a kernel called it.
        """
        if self._poll() > 0.0:
            self.state[EXHAUSTED] = 1
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        return self.is_exhausted

    @property
    def is_exhausted(self) -> bool:
        """Whether the time was up at the last poll."""
        return bool(self.state[EXHAUSTED])

    @property
    def interrupted(self) -> int:
        """Number of searches cut short in this stage."""
        return int(self.state[CUT_SHORT])


@inner_allocating_kernel
def is_exhausted(address: int) -> bool:
    """Whether the budget whose state is at an address (0: no limit) is exhausted."""
    return address != 0 and ints_at(address)[EXHAUSTED] != 0


@inner_allocating_kernel
def new_work(address: int) -> Ints:
    """The work of a new search, int64 (3,), for the budget whose state is at an address."""
    work = np.zeros(3, np.int64)
    work[1] = address
    return work


@inner_allocating_kernel
def spend(work: Ints, units: int) -> bool:
    """Spend units of work; True where the search has to end. O(1) but for the poll."""
    if work[1] == 0:
        return False
    state = ints_at(work[1])
    work[0] += units
    state[UNCHECKED] += units
    if state[UNCHECKED] > _EVERY:
        state[UNCHECKED] = 0
        if state[CLOCK] != 0 and call_float(state[CLOCK], 0, 0, 0) != 0.0:
            state[EXHAUSTED] = 1
    if state[EXHAUSTED] != 0 or work[0] > state[MAX_UNITS]:
        work[2] = 1
    return bool(work[2] != 0)
