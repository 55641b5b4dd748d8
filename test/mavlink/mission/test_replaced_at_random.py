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
    listed, withdrawn = [fresh.pop() for _ in range(5)], set()
    bench.assign(task_list(listed, service=service))
    for revision in range(2, 12):
        bench.run(limit=rng.uniform(0.5, 15.0))
        listed = [name for name in listed if name not in bench.completed()]
        if len(listed) > 3:
            withdrawn.add(listed.pop())  # never the next task, which may be flown already
        listed.append(fresh.pop())
        rng.shuffle(listed)
        bench.assign(task_list(listed, revision, service=service))
    assert bench.run(lambda: set(listed) <= set(bench.completed()), 900.0), f'seed {seed}'
    bench.run(limit=5.0)
    assert places(bench) == bench.completed(), f'seed {seed}'
    assert len(set(places(bench))) == len(places(bench)), f'seed {seed}'
    assert not withdrawn & set(places(bench)), f'seed {seed}'
