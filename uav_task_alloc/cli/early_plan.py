# SPDX-License-Identifier: Apache-2.0
"""A first plan by insertion while a thread compiles the kernels of the search."""
from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

from uav_task_alloc.cli.interrupt import end_process
from uav_task_alloc.cli.progress import WIPE, SolveProgress, log_line
from uav_task_alloc.errors import counted
from uav_task_alloc.model import Plan

INSERTION = 'insertion'  # Plan.solver of the first plan
_POLL = 0.05  # [s]


class EarlyPlan:
    """Loads the kernels of the search on a thread.

    Args:
        load: loads them; compiles those that are not on disk.
        solve: makes a plan of no iterations, with kernels that are loaded.
        progress: whether Ctrl-C was pressed.
    """

    def __init__(self, load: Callable[[], None], solve: Callable[[Callable[[], bool]], Plan],
                 progress: SolveProgress) -> None:
        self._load, self._solve, self._progress = load, solve, progress
        self._thread = threading.Thread(target=self._run, daemon=True)

    def wait(self) -> Plan | None:
        """Wait until the kernels are loaded; meanwhile, if any is compiled, make the first plan.

        Returns:
            The first plan where Ctrl-C ended the waiting; None: the kernels are loaded.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed before there was a plan.
        """
        from uav_task_alloc.kernel_cache import NOTICE  # imports numba
        before, plan = NOTICE.compiled, None
        self._thread.start()
        while self._thread.is_alive() and not self._progress.interrupted:
            if plan is None and NOTICE.compiled > before:
                plan = replace(self._solve(lambda: self._progress.interrupted), solver=INSERTION)
                _say(f'first plan, by {INSERTION}: {_summary(plan)}; Ctrl-C stops and keeps it')
            self._thread.join(_POLL)
        if not self._thread.is_alive():
            return None
        if plan is None:
            raise KeyboardInterrupt
        return plan

    def _run(self) -> None:
        with suppress(Exception):  # raised again where the search loads them
            self._load()

    @contextmanager
    def ending(self, status: int) -> Iterator[None]:
        """After it, the process ends with a status if the thread is still compiling.

        The compiler would have to be waited for, or crash while the process ends.
        """
        try:
            yield
        finally:
            if self._thread.is_alive() and sys.exc_info()[0] is None:
                end_process(status)


@contextmanager
def counted_kernels() -> Iterator[None]:
    """Within it, a terminal shows which kernel is compiled."""
    from uav_task_alloc.kernel_cache import NOTICE  # imports numba
    with NOTICE.shown_on(sys.stderr):
        yield


def _summary(plan: Plan) -> str:
    planned = sum(len(tasks) for tasks in plan.routes.values())
    return f'{counted(planned, "task")}, {len(plan.unassigned)} unassigned, {plan.distance:.0f} m'


def _say(text: str) -> None:
    """Print a line in the place of the one that counts kernels."""
    log_line((WIPE if sys.stderr.isatty() else '') + text)
