# SPDX-License-Identifier: Apache-2.0
"""The solver of an allocator in a thread of its own, and its results in that of the node."""
from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from rclpy.node import Node

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.worker import Worker
from uav_task_alloc.params import AllocatorParams


class SolverThread:
    """Loads the solver, then solves one problem at a time.

    Args:
        node: has its log.
        params: returns the parameters in force.
        on_results: called in the thread of the node when there are results.

    Attributes:
        background: the last problem was one without an event.
        error: of the last solve; '' for none.
    """

    def __init__(self, node: Node, params: Callable[[], AllocatorParams],
                 on_results: Callable[[], None]) -> None:
        self._params, self._logger = params, node.get_logger()
        self.background, self.error = False, ''
        self._results: deque[ReplanAnswer | None] = deque()
        self._result_ready = node.create_guard_condition(on_results)
        self._worker = Worker(self._load, self._solve, self._deliver, self._on_error)

    def start(self) -> None:
        """Load the solver; its first result follows."""
        self._worker.start()

    def submit(self, problem: ReplanProblem) -> None:
        """Solve a problem next.

        Args:
            problem: snapshot for the thread.
        """
        self.background = problem.background
        self._worker.submit(problem)

    def stop_early(self) -> None:
        """End the running solve with the best plan found so far."""
        self._worker.stop_early()

    def results(self) -> Iterator[ReplanAnswer | None]:
        """Take the results that have come.

        Yields:
            None first, when the solver is loaded; later an answer, or None where a solve failed.
        """
        while self._results:
            result = self._results.popleft()
            if result is not None:
                self.error = ''
            yield result

    def close(self) -> None:
        """End the thread; no result follows."""
        self._worker.close()

    # in the thread

    def _load(self) -> None:
        """Import the compiler and load all compiled kernels."""
        from uav_task_alloc.allocator.warm_up import compile_kernels
        from uav_task_alloc.solver.solve import plan
        compile_kernels(plan, self._params())

    def _solve(self, problem: ReplanProblem, stop: Callable[[], bool]) -> ReplanAnswer:
        from uav_task_alloc.solver.solve import plan
        return planning.solve_problem(plan, problem, self._params(), stop)

    def _deliver(self, result: ReplanAnswer | None) -> None:
        self._results.append(result)
        self._result_ready.trigger()

    def _on_error(self, error: Exception) -> None:
        self.error = f'{type(error).__name__}: {error}'[:500]
        self._logger.error(f'solver: {self.error}', throttle_duration_sec=10.0)
