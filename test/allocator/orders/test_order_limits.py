# SPDX-License-Identifier: Apache-2.0
"""Orders at limits: capacity, payloads and waits in the air, no UAV that may fly."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.model import Task
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind

LIMITS = {'range': 8000.0, 'full_range': 8000.0, 'endurance': 600.0, 'battery': 0.9}


def driver(standby=False):
    """UAV `a` with 1 kg, above its base or on it, and `b` with 5 kg on the ground."""
    made = AllocatorDriver(None, plan, uav_timeout=3600.0, objective='balanced',
                           route_end='home', solve_budget=0.02)
    made.uav('a', 0.0, 0.0, 0.0 if standby else 50.0, home=(0.0, 0.0, 0.0), payload_capacity=1.0,
             standby=standby, mode='STANDBY' if standby else 'ON_MISSION', **LIMITS)
    made.uav('b', 900.0, 0.0, 0.0, home=(900.0, 0.0, 0.0), payload_capacity=5.0, standby=True,
             mode='STANDBY', **LIMITS)
    made.settle()
    return made


def at(name, x, **more):
    return Task(name, (float(x), 0.0, 50.0), **more)


@pytest.mark.parametrize('action', ['PIN', 'ORDER'])
@pytest.mark.parametrize('standby', [False, True])
def test_a_payload_above_the_capacity_is_refused(action, standby):
    made = driver(standby)
    made.add(at('heavy', 200, payload=4.0))
    made.settle()
    answer = made.order(action, 'a', 'heavy')
    assert (answer.success, answer.message) == (
        False, 'refused: heavy: payload 4 kg; a takes 1 kg')
    assert made.order(action, 'b', 'heavy').success


def test_payloads_that_are_too_much_together_are_refused():
    made = driver()
    made.add(at('p', 850, payload=3.0), at('q', 800, payload=3.0))
    made.settle()
    assert made.order('ORDER', 'b', 'p', 'q').message == (
        'refused: q in this order is beyond the capacity of b: payloads of 6 kg, 5 kg at most')
    assert made.order('ORDER', 'b', 'q').success


def test_a_uav_in_the_air_is_ordered_to_no_task_whose_payload_it_has_not_on_board():
    made = driver()
    made.add(at('parcel', 200, payload=0.5))
    made.settle()
    answer = made.order('ORDER', 'a', 'parcel')
    assert answer.message == 'refused: a is in the air without the payload of parcel'


def test_a_payload_that_was_taken_on_at_the_base_may_be_ordered_in_the_air():
    made = driver(standby=True)
    made.add(at('parcel', 200, payload=0.5), at('t1', 220))
    made.settle()
    assert set(made.route('a')) == {'parcel', 't1'}
    made.uav('a', 10.0, 0.0, 50.0, home=(0.0, 0.0, 0.0), payload_capacity=1.0, **LIMITS)
    assert made.order('ORDER', 'a', 't1', 'parcel').success
    made.settle()
    assert made.route('a') == ('t1', 'parcel')


@pytest.mark.parametrize('window', ['earliest', 'release'])
def test_a_wait_in_the_air_counts_and_one_on_the_ground_does_not(window):
    for standby in (False, True):
        made = driver(standby)
        made.add(at('later', 200, **{window: made.now + 3000.0}))
        made.settle()
        answer = made.order('ORDER', 'a', 'later')
        assert answer.success == standby
        assert standby or answer.message.startswith(
            'refused: later in this order is beyond the endurance of a: it needs 30')


def test_a_dry_run_of_the_resumption_of_the_only_uav_has_a_price_where_a_way_is_open():
    made = driver()
    made.world.forget_uav('b')
    way = ((100.0, 0.0, 50.0), (300.0, 0.0, 50.0))
    made.add(Work(Task('line', way[0]), Kind.LINE, way))
    made.settle()
    assert made.order('PAUSE', 'a').success
    made.settle()
    answer = made.order('RESUME', 'a', dry_run=True)
    assert answer.success
    assert answer.distance > 0.0
