# SPDX-License-Identifier: Apache-2.0
"""One thread that solves one problem at a time, so that whoever asks never waits."""
from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue

from uav_task_alloc.allocator.records import ReplanAnswer, ReplanProblem

SolveFunction = Callable[[ReplanProblem, Callable[[], bool]], ReplanAnswer]


class Worker:
    """`solve(problem, stop)` in a thread of its own; `deliver(answer)` is called in it, too.

    `fail(error)` is called with what `prepare` or `solve` raised: the thread goes on.
    """

    def __init__(self, prepare: Callable[[], object], solve: SolveFunction,
                 deliver: Callable[[ReplanAnswer | None], None],
                 fail: Callable[[Exception], None]) -> None:
        self._solve, self._deliver, self._fail = solve, deliver, fail
        self._asked: SimpleQueue[ReplanProblem | None] = SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(prepare,), daemon=True,
                                        name='solver')

    def start(self) -> None:
        """Prepare (compile), deliver None, then wait for problems."""
        self._thread.start()

    def ask(self, problem: ReplanProblem) -> None:
        """Solve this next."""
        self._stop.clear()
        self._asked.put(problem)

    def hurry(self) -> None:
        """Answer now with what is found so far."""
        self._stop.set()

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        self._asked.put(None)
        self._thread.join(timeout=5.0)

    def _run(self, prepare: Callable[[], object]) -> None:
        self._guarded(prepare)
        self._deliver(None)
        while (problem := self._asked.get()) is not None:
            answer = self._guarded(partial(self._solve, problem, self._stop.is_set))
            self._deliver(answer if isinstance(answer, ReplanAnswer) else None)

    def _guarded(self, work: Callable[[], object]) -> object:
        try:
            return work()
        except Exception as error:
            self._fail(error)
            return None
