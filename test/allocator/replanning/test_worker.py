# SPDX-License-Identifier: Apache-2.0
"""The thread of the worker, and the warm-up: callers never wait, exceptions do not end it."""
import threading
from queue import Queue

from allocation import greedy

from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.worker import Worker
from uav_task_alloc.allocator.warm_up import compile_kernels
from uav_task_alloc.model import Plan
from uav_task_alloc.params import AllocatorParams


def problem(trigger):
    return ReplanProblem(1, trigger, False, 0.1, (), (), (), {}, Plan({}), Plan({}))


def test_problems_are_answered_in_turn_after_the_preparation():
    got, prepared = Queue(), []
    worker = Worker(lambda: prepared.append(1),
                    lambda problem, stop: ReplanAnswer(problem, Plan({}), Plan({})),
                    got.put, got.put)
    worker.start()
    assert got.get(timeout=60) is None
    assert prepared == [1]
    for trigger in 'xy':
        worker.submit(problem(trigger))
        assert got.get(timeout=60).problem.trigger == trigger
    worker.close()


def test_a_running_solve_can_be_stopped_early():
    got, began = Queue(), Queue()

    def solve(problem, stop):
        began.put(1)
        while not stop():
            pass
        return ReplanAnswer(problem, Plan({}), Plan({}))

    worker = Worker(lambda: None, solve, got.put, got.put)
    worker.start()
    assert got.get(timeout=60) is None
    worker.submit(problem('x'))
    began.get(timeout=60)
    worker.stop_early()
    assert got.get(timeout=60).problem.trigger == 'x'
    worker.close()


def test_a_worker_that_was_closed_while_it_prepared_delivers_nothing():
    got, ready = Queue(), Queue()
    worker = Worker(lambda: ready.get(timeout=60), lambda problem, stop: None, got.put, got.put)
    before = {*threading.enumerate()}
    worker.start()
    thread, = {*threading.enumerate()} - before
    worker.close()
    ready.put(1)
    thread.join(60)
    assert got.empty()


def test_a_failed_solve_is_reported_and_the_next_problem_is_solved():
    got, failed = Queue(), Queue()

    def solve(problem, stop):
        if problem.trigger == 'bad':
            raise RuntimeError('out of bees')
        return ReplanAnswer(problem, Plan({}), Plan({}))

    worker = Worker(lambda: None, solve, got.put, failed.put)
    worker.start()
    assert got.get(timeout=60) is None
    worker.submit(problem('bad'))
    assert got.get(timeout=60) is None
    assert str(failed.get(timeout=60)) == 'out of bees'
    worker.submit(problem('good'))
    assert got.get(timeout=60).problem.trigger == 'good'
    worker.close()


def test_the_warm_up_ends_with_lists():
    assert compile_kernels(greedy, AllocatorParams()) > 0
