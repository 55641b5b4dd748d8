# SPDX-License-Identifier: Apache-2.0
"""The solver in its thread: what the node receives of it, and the error of the last solve."""
import threading
import time
from types import SimpleNamespace

import pytest

from uav_task_alloc.allocator import warm_up
from uav_task_alloc.allocator.replan_records import ReplanAnswer
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.nodes.ros.solver_thread import SolverThread
from uav_task_alloc.params import AllocatorParams

pytestmark = pytest.mark.ros
ANSWER = ReplanAnswer(None, None, None)


class NodeStandIn:
    """Collects errors, and counts the triggers of its guard condition."""

    def __init__(self):
        self.errors, self.triggers, self.callback = [], 0, None
        self.has_result = threading.Semaphore(0)

    def get_logger(self):
        return SimpleNamespace(error=lambda text, throttle_duration_sec: self.errors.append(text))

    def create_guard_condition(self, callback):
        self.callback = callback
        return SimpleNamespace(trigger=self._trigger)

    def _trigger(self):
        self.triggers += 1
        self.has_result.release()


@pytest.fixture
def thread(monkeypatch):
    """A function that starts one with outcomes of solves: answers, or errors to be raised."""
    started = []

    def start(*outcomes):
        left = list(outcomes)

        def solve(plan, problem, params, stop):
            outcome = left.pop(0)
            if isinstance(outcome, Exception):
                raise outcome
            while outcome == 'until stopped' and not stop():
                time.sleep(0.001)  # as iterations take, between which it is polled
            return ANSWER

        monkeypatch.setattr(warm_up, 'compile_kernels', lambda plan, params: None)
        monkeypatch.setattr(planning, 'solve_problem', solve)
        node = NodeStandIn()
        solver = SolverThread(node, AllocatorParams, lambda: None)
        started.append(solver)
        solver.start()
        assert next_of(solver, node) is None  # it is loaded
        return solver, node

    yield start
    for solver in started:
        solver.close()


def next_of(solver, node):
    """The next result, once the node is called for it."""
    assert node.has_result.acquire(timeout=60.0)  # the import of the solver
    return next(solver.results())


def problem(background=False):
    return SimpleNamespace(background=background)


def test_the_node_is_called_for_each_result(thread):
    solver, node = thread(ANSWER)
    assert node.triggers == 1
    solver.submit(problem())
    assert next_of(solver, node) is ANSWER
    assert node.triggers == 2
    assert list(solver.results()) == []


def test_the_error_of_a_solve_stays_until_one_succeeds(thread):
    solver, node = thread(ValueError('no'), ANSWER)
    solver.submit(problem())
    assert next_of(solver, node) is None
    assert solver.error == 'ValueError: no'
    assert node.errors == ['solver: ValueError: no']
    solver.submit(problem())
    assert next_of(solver, node) is ANSWER
    assert solver.error == ''


def test_a_long_error_is_cut(thread):
    solver, node = thread(ValueError('x' * 1000))
    solver.submit(problem())
    assert next_of(solver, node) is None
    assert len(solver.error) == 500


@pytest.mark.parametrize('background', [True, False])
def test_it_knows_whether_its_problem_is_one_of_the_background(thread, background):
    solver, _ = thread(ANSWER)
    solver.submit(problem(background))
    assert solver.background == background


def test_a_solve_that_is_stopped_early_has_a_result(thread):
    solver, node = thread('until stopped')
    solver.submit(problem())
    solver.stop_early()
    assert next_of(solver, node) is ANSWER


def test_nothing_follows_after_the_end(thread):
    solver, node = thread('until stopped')
    solver.submit(problem())
    solver.close()
    assert list(solver.results()) == []
    assert node.triggers == 1
