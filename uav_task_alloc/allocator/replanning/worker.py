# SPDX-License-Identifier: Apache-2.0
"""A thread that solves one problem at a time, so that callbacks never wait for the solver."""
from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem

SolveFunction = Callable[[ReplanProblem, Callable[[], bool]], ReplanAnswer]


class Worker:
    """Runs `solve(problem, stop)` in a thread of its own.

    Args:
        prepare: called first, for instance to compile.
        solve: returns the answer; ends early when stop() is true.
        deliver: called in the thread with each answer, None after `prepare` or a failure.
        fail: called in the thread with the exception of `prepare` or `solve`; it continues.
    """

    def __init__(self, prepare: Callable[[], object], solve: SolveFunction,
                 deliver: Callable[[ReplanAnswer | None], None],
                 fail: Callable[[Exception], None]) -> None:
        self._solve, self._deliver, self._fail = solve, deliver, fail
        self._problems: SimpleQueue[ReplanProblem | None] = SimpleQueue()
        self._stop = threading.Event()
        self._prepared = threading.Event()
        self._delivers, self._closed = threading.Lock(), False
        self._thread = threading.Thread(target=self._run, args=(prepare,), daemon=True,
                                        name='solver')

    def start(self) -> None:
        """Prepare (compile), deliver None, then wait for problems."""
        self._thread.start()

    def submit(self, problem: ReplanProblem) -> None:
        """Solve a problem next.

        Args:
            problem: snapshot for the worker thread.
        """
        self._stop.clear()
        self._problems.put(problem)

    def stop_early(self) -> None:
        """End the running solve with the best plan found so far."""
        self._stop.set()

    def close(self) -> None:
        """End the thread; waits at most 5 s for it, and not for kernels that are compiled.

        Nothing is delivered after that.
        """
        with self._delivers:
            self._closed = True
        self._stop.set()
        self._problems.put(None)
        if self._prepared.is_set():
            self._thread.join(timeout=5.0)

    def _run(self, prepare: Callable[[], object]) -> None:
        self._guarded(prepare)
        self._prepared.set()
        self._deliver_open(None)
        while (problem := self._problems.get()) is not None:
            answer = self._guarded(partial(self._solve, problem, self._stop.is_set))
            self._deliver_open(answer if isinstance(answer, ReplanAnswer) else None)

    def _deliver_open(self, answer: ReplanAnswer | None) -> None:
        with self._delivers:
            if not self._closed:
                self._deliver(answer)

    def _guarded(self, work: Callable[[], object]) -> object:
        try:
            return work()
        except Exception as error:
            self._fail(error)
            return None
