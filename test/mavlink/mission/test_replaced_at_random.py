# SPDX-License-Identifier: Apache-2.0
"""Lists replaced ten times at random moments, tasks withdrawn, on a line that loses a tenth."""
import random

import pytest
from flight_bench import FlightBench, places
from mission_bench import task_list

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
@pytest.mark.parametrize('service', [0.0, 2.0])
@pytest.mark.parametrize('seed', range(12))
def test_each_task_is_reached_once_and_none_that_was_withdrawn(kind, service, seed):
    rng = random.Random(seed)
    bench = FlightBench(kind, seed=seed, loss=rng.choice([0.0, 0.1]), delay=(0.02, 0.1)).discover()
    fresh = list('ABCDEFGHIJKLMNOPQRSTUVWXY')
    rng.shuffle(fresh)
    given, withdrawn = [fresh.pop() for _ in range(5)], set()
    bench.assign(task_list(given, service=service))
    for revision in range(2, 12):
        bench.run(limit=rng.uniform(0.5, 15.0))
        given = [name for name in given if name not in bench.completed()]
        if len(given) > 3:
            withdrawn.add(given.pop())  # never the next, which may be under way
        given.append(fresh.pop())
        rng.shuffle(given)
        bench.assign(task_list(given, revision, service=service))
    assert bench.run(lambda: set(given) <= set(bench.completed()), 900.0), f'seed {seed}'
    bench.run(limit=5.0)
    assert places(bench) == bench.completed(), f'seed {seed}'
    assert len(set(places(bench))) == len(places(bench)), f'seed {seed}'
    assert not withdrawn & set(places(bench)), f'seed {seed}'
