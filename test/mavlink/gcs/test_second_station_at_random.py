# SPDX-License-Identifier: Apache-2.0
"""A second station sets the current item at random: no false event, nothing flown twice.

The line loses up to a fifth, delays up to 5 s and reorders; lists change meanwhile.
"""
import random

import pytest
from findings_bench import BOTH, set_current, truthful
from flight_bench import FlightBench, places
from mission_bench import task_list

NAMES = 'ABCDEFGHIJ'


def fly(kind, seed, *, loss, delay, late, lists):
    """Fly ten tasks while a second station sets the current item ahead, and lists change.

    Of the messages a share of `late` takes up to 5 s.
    """
    rng = random.Random(seed)
    bench = FlightBench(kind, seed=seed, loss=loss, delay=(0.0, delay),
                        relaunch='automatic').discover()  # a too long replacement ends at home
    bench.line.tampers.append(lambda direction, m, now: [(rng.uniform(0.0, 5.0), m)] if (
        rng.random() < late) else None)
    given = list(NAMES)
    bench.assign(task_list(given, service=rng.choice([0.0, 0.0, 2.0])))
    assert truthful(bench, bench.started, 300.0), f'seed {seed}'
    for revision in range(2, 2 + lists):
        truthful(bench, lambda: False, rng.uniform(1.0, 15.0))
        ahead = len(bench.vehicles[1].mission.items) - bench.onboard().own
        now = bench.vehicles[1].flight.seq - bench.onboard().own
        if now + 1 < ahead:
            set_current(bench, rng.randint(now + 1, ahead - 1))
        truthful(bench, lambda: False, rng.uniform(1.0, 25.0))
        given = [name for name in given if name not in bench.completed()]
        rng.shuffle(given)
        bench.assign(task_list(given, revision))
    done = truthful(bench, lambda: len(bench.completed()) >= len(NAMES), 1500.0)
    bench.run(limit=20.0)
    flown = places(bench)
    print(seed, flown, bench.completed())
    assert done, f'seed {seed}: {bench.completed()} of {flown}'
    assert sorted(bench.completed()) == list(NAMES), f'seed {seed}'
    assert len(flown) == len(set(flown)), f'seed {seed}: flown twice: {flown}'


@BOTH
@pytest.mark.parametrize('seed', range(12))
def test_on_a_good_line_each_task_is_flown_once(kind, seed):
    fly(kind, seed, loss=0.0, delay=0.05, late=0.0, lists=3)


@BOTH
@pytest.mark.parametrize('seed', range(12))
def test_on_a_line_that_loses_and_reorders_nothing_is_false(kind, seed):
    rng = random.Random(500 + seed)
    fly(kind, seed, loss=rng.uniform(0.0, 0.2), delay=0.3, late=rng.choice([0.05, 0.15]), lists=2)
