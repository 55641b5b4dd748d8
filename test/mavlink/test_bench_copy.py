# SPDX-License-Identifier: Apache-2.0
import authority_bench
import findings_bench
import flight_bench
import pytest
from authority_bench import BOTH
from mission_bench import task_list

MAKERS = [authority_bench.flying, authority_bench.lost, authority_bench.flown_up_by_pilot,
          findings_bench.flying, flight_bench.flying]


def flown_on(bench):
    """All that a bench shows after a new list and some time."""
    bench.assign(task_list('DEF', revision=2))
    bench.run(limit=60.0)
    return ([(now, direction, m.to_json()) for now, direction, m in bench.line.log], bench.now,
            repr((bench.truth, bench.events, bench.notes, bench.state(), bench.store.records)))


@BOTH
@pytest.mark.parametrize('make', MAKERS, ids=lambda make: f'{make.__module__}.{make.__name__}')
def test_a_copy_flies_on_as_a_bench_that_was_made_for_it(make, kind):
    made, first, second = make.__wrapped__(kind), make(kind), make(kind)
    shown = flown_on(made)
    assert flown_on(first) == shown
    assert flown_on(second) == shown  # the first one has changed nothing of it


@BOTH
def test_a_copy_shares_no_policy_and_no_vehicle(kind):
    first, second = authority_bench.flying(kind), authority_bench.flying(kind)
    first.set_policy(takeoff=False)
    first.vehicles[1].failsafe('battery', None)
    first.run(limit=3.0)
    assert second.executor().policy.takeoff
    assert second.executor().watch._policy().takeoff
    assert second.authority() is authority_bench.H
