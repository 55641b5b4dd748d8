# SPDX-License-Identifier: Apache-2.0
"""How long the search for ways may go on: kernels count their work and ask a clock now and then.

A unit of work is a look at one zone or one corner, a few nanoseconds. A search that was cut short
has found out nothing: its way is not known, which is not the same as that there is none.
"""
from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from uav_task_alloc.geometry.numba_pointers import call_float, ints_at
from uav_task_alloc.geometry.obstacles import Ints
from uav_task_alloc.kernel import allocating_kernel

UNCHECKED, EXHAUSTED, MAX_UNITS, CUT_SHORT, CLOCK = range(5)  # what the state holds
_EVERY = 50_000  # units between two looks at the clock
UNLIMITED = 1 << 62

_Callback = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class SearchBudget:
    """What searches may spend: all together until `over` says so, each at most `most` units."""

    def __init__(self, time_is_up: Callable[[], bool] | None = None) -> None:
        self.state = np.zeros(5, np.int64)
        self.state[MAX_UNITS] = UNLIMITED
        self._time_is_up = time_is_up
        self._error: BaseException | None = None
        self._callback = _Callback(self._poll) if time_is_up else None
        if self._callback:
            self.state[CLOCK] = ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _poll(self, *_: int) -> float:
        """Called by kernels; what is raised here would be lost there."""
        try:
            return 1.0 if self._time_is_up and self._time_is_up() else 0.0
        except BaseException as error:
            self._error = self._error or error
            return 1.0

    def start_stage(self, max_units: int = UNLIMITED) -> None:
        """A stage in which each search may take `most` units; nothing is cut yet."""
        self.state[[EXHAUSTED, MAX_UNITS, CUT_SHORT]] = 0, max_units, 0
        self.check()

    def check(self) -> bool:
        """Ask the clock now; whether the time is over. Raises what the question raised."""
        if self._poll() > 0.0:
            self.state[EXHAUSTED] = 1
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        return self.is_exhausted

    @property
    def is_exhausted(self) -> bool:
        """Whether the time was over when the clock was asked last."""
        return bool(self.state[EXHAUSTED])

    @property
    def interrupted(self) -> int:
        """Searches cut short in this stage."""
        return int(self.state[CUT_SHORT])


@allocating_kernel
def is_exhausted(address: int) -> bool:
    """Whether no search may go on."""
    return address != 0 and ints_at(address)[EXHAUSTED] != 0


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
    state[UNCHECKED] += units
    if state[UNCHECKED] > _EVERY:
        state[UNCHECKED] = 0
        if state[CLOCK] != 0 and call_float(state[CLOCK], 0, 0, 0) != 0.0:
            state[EXHAUSTED] = 1
    if state[EXHAUSTED] != 0 or work[0] > state[MAX_UNITS]:
        work[2] = 1
    return bool(work[2] != 0)
