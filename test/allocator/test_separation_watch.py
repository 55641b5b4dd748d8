# SPDX-License-Identifier: Apache-2.0
"""The allocator predicts from reports and lists who comes near whom, and lets one of them hold."""
import math
from dataclasses import replace

import pytest
from allocation import AllocatorDriver, task as point_task

from uav_task_alloc.model import Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.monitor import AlertAction

RULE = {'separation__horizontal': 10.0, 'separation__vertical': 5.0}
WEST, SOUTH = (-100.0, 0.0, 50.0), (0.0, -102.0, 50.0)
EAST = {'velocity': (15.0, 0.0, 0.0)}
NORTH = {'velocity': (0.0, 15.0, 0.0)}


class Sky(AllocatorDriver):
    """Two UAVs whose ways cross in 7 s, u1 from the west and u2 from the south.

    Their lists are of a time without separation, so that only the monitor keeps them apart.
    """

    def __init__(self, first=None, second=None, **params):
        super().__init__()
        self.more = [{'mode': 'ON_MISSION', 'authority': 'HELD', **EAST, **(first or {})},
                     {'mode': 'ON_MISSION', 'authority': 'HELD', **NORTH, **(second or {})}]
        self.report()
        self.add(Task('t1', (200.0, 0.0, 50.0), allowed_uavs=frozenset({'u1'})),
                 Task('t2', (0.0, 150.0, 50.0), allowed_uavs=frozenset({'u2'})))
        self.settle(report=False)
        self.world.params = AllocatorParams(**{
            'background_budget': 0.0, 'route_end': 'hold', **RULE, **params})
        self.steps = []

    def report(self, west=WEST, south=SOUTH):
        self.uav('u1', *west, **self.more[0])
        self.uav('u2', *south, **self.more[1])

    def step(self, wait=0.5):
        self.now += wait
        step = self.core.separate(self.now, self.now)
        self.steps.append(step)
        return [(hold.uav, hold.hold) for hold in step.holds]


def test_the_one_that_is_later_at_its_next_stop_holds_and_goes_on_when_the_other_has_passed():
    sky = Sky()
    assert sky.step() == [('u1', True)]
    alert, = sky.steps[-1].alerts
    assert (alert.action, alert.holder, alert.uavs) == (AlertAction.HOLD, 'u1', ('u1', 'u2'))
    assert alert.horizontal < 11.0
    assert 'u1 holds for u2' in sky.core.separation.texts()['u2']
    assert sky.step() == []
    sky.report((-60.0, 0.0, 50.0), (0.0, 40.0, 50.0))
    assert sky.step() == [('u1', False)]
    assert sky.steps[-1].alerts[0].action is AlertAction.RELEASE
    assert sky.core.separation.texts() == {}


def test_one_that_holds_for_an_idle_one_says_what_ends_that():
    sky = Sky(second={'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)})
    sky.world.cancel(['t2'], sky.now, sky.now)
    sky.settle(report=False)
    sky.report(south=(0.0, 0.0, 50.0))
    assert sky.step() == [('u1', True)]
    assert sky.core.separation.texts()['u1'].endswith(
        'u1 holds for u2, which has no tasks: it gives way where that is safe, else a task or '
        'its return ends that')


def test_without_a_rule_nothing_is_predicted():
    sky = Sky(separation__horizontal=0.0)
    assert sky.step() == []
    assert not sky.steps[-1].alerts


@pytest.mark.parametrize(('first', 'second', 'holder'), [
    ({'authority': 'LOST'}, {}, 'u2'), ({}, {'authority': 'SUSPENDED'}, 'u1'),
    ({'foreign': True}, {}, 'u2'), ({'mode': 'FAULT'}, {}, 'u2')])
def test_a_uav_of_unknown_plan_keeps_its_way_by_its_velocity(first, second, holder):
    assert Sky(first, second).step() == [(holder, True)]


def test_a_uav_of_a_pilot_is_released_once_and_never_held():
    sky = Sky()
    assert sky.step() == [('u1', True)]
    sky.more[0]['authority'] = 'LOST'
    sky.report()
    assert sky.step()[:1] == [('u1', False)]
    assert not any(hold == ('u1', True) for _ in range(20) for hold in sky.step())


def test_a_uav_that_an_operator_holds_stays_and_is_never_let_go():
    sky = Sky()
    assert sky.order('PAUSE', 'u1', keep_tasks=True).success
    sky.more[0] |= {'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)}
    sky.report((-20.0, 0.0, 50.0))
    assert sky.step() == []
    sky.report((0.0, 0.0, 50.0))  # in the way of u2
    assert sky.step() == [('u2', True)]
    assert all(uav == 'u2' for step in sky.steps for uav, _ in
               [(hold.uav, hold.hold) for hold in step.holds])


def test_one_that_is_low_on_battery_or_lands_keeps_its_way():
    sky = Sky(second={'battery': 0.1, 'home': (0.0, 200.0, 0.0)})
    assert sky.step() == [('u1', True)]
    sky = Sky(first={'battery': 0.1, 'home': (200.0, 0.0, 0.0)})
    assert sky.step() == [('u2', True)]
    sky = Sky(first={'mode': 'LANDING', 'velocity': (0.0, 0.0, -1.5), 'home': (0.0, 0.0, 0.0)})
    sky.report((0.0, 0.0, 61.0))
    assert sky.step() == [('u2', True)]


@pytest.mark.parametrize(('first', 'second', 'holder'), [
    (0.17, 0.15, 'u1'), (0.15, 0.17, 'u2'), (0.15, 0.03, 'u1'), (0.03, 0.15, 'u2')])
def test_of_two_that_are_low_on_battery_the_one_with_more_left_holds(first, second, holder):
    """40 km with a full battery and a reserve of 20 %: 3 % are 1.2 km, too little to hold."""
    def low(battery):
        return {'battery': battery, 'range': 40_000.0 * battery, 'full_range': 40_000.0}

    sky = Sky({'home': (200.0, 0.0, 0.0), **low(first)},
              {'home': (0.0, 200.0, 0.0), **low(second)}, battery_reserve=0.2)
    assert sky.step() == [(holder, True)]
    sky.report((-60.0, 0.0, 50.0), (0.0, 40.0, 50.0))
    assert sky.step() == [(holder, False)]


def test_two_that_are_low_on_battery_and_cannot_hold_any_more_fly_on():
    low = {'battery': 0.03, 'range': 1200.0, 'full_range': 40_000.0}
    sky = Sky({'home': (200.0, 0.0, 0.0), **low}, {'home': (0.0, 200.0, 0.0), **low},
              battery_reserve=0.2)
    assert sky.step() == []
    assert 'nobody can be stopped (u1 is low on battery, u2 is low' in (
        sky.core.separation.texts()['u1'])


def test_one_on_the_ground_waits_for_one_that_lands_beside_it():
    sky = Sky({'mode': 'STANDBY', 'standby': True, 'velocity': (0.0, 0.0, 0.0)},
              {'mode': 'LANDING', 'velocity': (0.0, 0.0, -1.5), 'home': (5.0, 0.0, 0.0)})
    sky.report((0.0, 0.0, 0.0), (5.0, 0.0, 20.0))
    assert sky.step() == [('u1', True)]
    sky.more[1] |= {'mode': 'STANDBY', 'standby': True}
    sky.more[1]['available'] = False
    sky.report((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    assert sky.step() == [('u1', False)]


@pytest.mark.parametrize('rate', [1.0, 8.0])  # of the published clock
def test_a_silent_uav_is_in_the_way_for_half_a_minute_of_the_published_clock(rate):
    sky = Sky({}, {'velocity': (0.0, 0.0, 0.0)})
    begin, ended = sky.now, None
    while ended is None:
        sky.now += 0.5 / rate
        stamp = begin + rate * (sky.now - begin)
        sky.uav('u1', -60.0, 0.0, 50.0, **sky.more[0])
        if stamp - begin < 5.0:
            sky.uav('u2', 0.0, 0.0, 50.0, **sky.more[1])
        sky.world.fleet.mark_silent(sky.now, 2.0 / rate)
        ended = next((stamp - begin for hold in sky.core.separate(sky.now, stamp).holds
                      if (hold.uav, hold.hold) == ('u1', False)), None)
    assert 36.0 <= ended <= 38.5


def test_a_silent_uav_is_where_its_velocity_has_taken_it():
    sky = Sky({}, {'velocity': (15.0, 0.0, 0.0)})  # ahead of u1 on its way
    sky.report((-60.0, 0.0, 50.0), (-30.0, 0.0, 50.0))
    sky.world.fleet.mark_silent(sky.now + 3.0, 2.0)
    sky.report((-60.0, 0.0, 50.0))
    sky.world.fleet.mark_silent(sky.now + 3.0, 2.0)
    for k in range(40):
        sky.uav('u1', -60.0 + 7.5 * k, 0.0, 50.0, **sky.more[0])
        assert sky.step() == []


def test_a_silent_uav_has_flown_on_since_its_last_report():
    sky = Sky({}, {'home': (300.0, -300.0, 0.0)})
    sky.report((-400.0, 0.0, 50.0), (0.0, -165.0, 50.0))
    sky.step()
    sky.now += 5.0
    sky.uav('u1', -75.0, 0.0, 50.0, **sky.more[0])
    sky.world.fleet.mark_silent(sky.now, 5.0)
    assert sky.step() == [('u1', True)]  # 75 m from where both are in 5 s


def test_a_silent_uav_may_fly_its_list_on_and_not_only_straight_ahead():
    sky = Sky({}, {'velocity': (0.0, 0.0, 0.0)})  # it sets out
    sky.more[1]['list_revision'] = sky.world.list_of('u2').revision
    sky.report((-400.0, 0.0, 50.0), (0.0, -90.0, 50.0))
    sky.step()
    sky.now += 5.0
    sky.uav('u1', -20.0, 0.0, 50.0, **sky.more[0])
    sky.world.fleet.mark_silent(sky.now, 5.0)
    assert sky.step() == [('u1', True)]


def test_a_uav_whose_bridge_repeats_a_position_on_a_stale_link_has_flown_on():
    sky = Sky({}, {'home': (300.0, -300.0, 0.0)})
    sky.report((-400.0, 0.0, 50.0), (0.0, -135.0, 50.0))
    sky.world.params = replace(sky.world.params, uav_timeout=2.0)  # repeated, it is not silent
    sky.step()
    sky.now += 3.5
    sky.more[1] |= {'authority': 'SUSPENDED', 'available': False}
    sky.report((-75.0, 0.0, 50.0), (0.0, -135.0, 50.0))
    assert sky.step() == [('u1', True)]


def test_holds_are_renewed_and_expire_within_a_minute():
    sky = Sky({}, {'authority': 'LOST', 'velocity': (0.0, 0.0, 0.0)})
    for _ in range(120):
        sky.report((-60.0, 0.0, 50.0), (0.0, 0.0, 50.0))
        sky.step()
    holds = [hold for step in sky.steps for hold in step.holds]
    assert all(hold.uav == 'u1' and hold.hold for hold in holds)
    assert len(holds) == 3
    assert all(math.isclose(hold.expires, hold.stamp + 60.0) for hold in holds)


def test_lists_that_are_about_to_be_published_are_predicted_first():
    sky = Sky()
    sky.core.separate(sky.now, sky.now)
    sky.add(point_task(('t3', 300.0, 0.0)))
    sky.report()
    problem = None
    while problem is None:
        sky.now += 0.1
        sky.core.tick(sky.now, sky.now)
        problem = sky.core.due(sky.now, sky.now)
    take, sky.take = sky.take, lambda: None
    sky.finish(problem)
    assert sky.world.outbox.lists
    before = sky.core.separation._stepped
    sky.core.separate(sky.now, sky.now)
    assert sky.core.separation._stepped > before
    sky.take = take


def test_where_no_hold_helps_a_plan_is_asked_for():
    sky = Sky({'mode': 'TAKEOFF', 'home': (-100.0, 0.0, 0.0)}, {'authority': 'LOST'})
    sky.report((0.0, 5.0, 50.0))
    sky.step()
    assert sky.steps[-1].alerts[0].action is AlertAction.UNRESOLVED
    assert 'u1 takes off' in sky.steps[-1].alerts[0].reason
    assert 'u1 and u2 lose separation' in str(sky.begin().trigger)


@pytest.mark.parametrize('battery', [None, 0.1])
def test_one_whose_tasks_are_gone_in_its_take_off_is_predicted_to_end_it_first(battery):
    climbs = {'mode': 'TAKEOFF', 'velocity': (0.0, 0.0, 2.5), 'home': (0.0, 0.0, 0.0),
              'takeoff_height': 50.0, 'battery': battery}
    sky = Sky({}, climbs)
    sky.world.lists.lists['u2'] = replace(sky.world.list_of('u2'), stops=(), returns=True)
    sky.report((-100.0, 0.0, 45.0), (0.0, 0.0, 30.0))
    assert sky.step() == [('u1', True)]
    assert 'u2' in sky.steps[-1].alerts[0].uavs
    sky.report((-100.0, 0.0, 70.0), (0.0, 0.0, 30.0))  # above all of it
    sky.world.lists.lists['u1'] = replace(sky.world.list_of('u1'), stops=())
    assert sky.step() == [('u1', False)]


def test_a_wait_of_the_plan_is_spent_before_the_leg_and_on_the_ground():
    sky = Sky({'mode': 'STANDBY', 'standby': True, 'velocity': (0.0, 0.0, 0.0)},
              {'mode': 'STANDBY', 'standby': True, 'velocity': (0.0, 0.0, 0.0)})
    for k, x in enumerate((0.0, 5.0)):
        sky.more[k]['home'] = (x, 0.0, 0.0)
    sky.report((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    stops = sky.world.lists.lists['u1'].stops
    later = replace(stops[0], begin_after=sky.now + 300.0)
    sky.world.lists.lists['u1'] = replace(sky.world.lists.lists['u1'], stops=(later,))
    assert sky.step() == []  # u2 is away when u1 takes off


@pytest.mark.parametrize(('height', 'held'), [(50.0, [('u2', True)]), (90.0, [])])
@pytest.mark.parametrize('state', [{'mode': 'FAULT'}, {'mode': 'RETURNING', 'authority': 'LOST'}])
def test_a_failsafe_is_predicted_to_return_home_at_the_height_of_the_vehicle(state, height, held):
    sky = Sky({'velocity': (0.0, 0.0, 2.5), 'home': (0.0, 300.0, 0.0), 'return_height': height,
               **state}, {'velocity': (15.0, 0.0, 0.0)})
    sky.report((0.0, 20.0, 44.0), (-150.0, 150.0, 50.0))
    assert sky.step() == held


def test_a_failsafe_that_flies_level_has_climbed():
    sky = Sky({'velocity': (0.0, 15.0, 0.0), 'home': (0.0, 300.0, 0.0), 'return_height': 90.0,
               'mode': 'FAULT'}, {'velocity': (15.0, 0.0, 0.0)})
    sky.report((0.0, 20.0, 50.0), (-150.0, 150.0, 50.0))
    assert sky.step() == [('u2', True)]


def test_a_pilot_who_flies_past_his_home_is_predicted_by_the_velocity():
    sky = Sky({'velocity': (0.0, 15.0, 0.0), 'home': (150.0, 150.0, 0.0), 'return_height': 90.0,
               'authority': 'LOST', 'mode': 'HOLD'}, {'velocity': (15.0, 0.0, 0.0)})
    sky.report((0.0, 20.0, 50.0), (-150.0, 150.0, 50.0))
    assert sky.step() == [('u2', True)]


def test_a_wait_of_the_plan_in_the_air_is_spent_at_the_stop_before():
    sky = Sky(first={'velocity': (0.0, 0.0, 0.0)})
    sky.world.params = AllocatorParams(background_budget=0.0, route_end='hold')
    sky.report((-100.0, 0.0, 50.0), (0.0, -300.0, 50.0))
    sky.add(Task('t0', (-100.0, 0.0, 50.0), allowed_uavs=frozenset({'u1'})))
    sky.settle(wait=2.0, report=False)
    lists = sky.world.lists.lists
    later, first = lists['u1'].stops
    lists['u1'] = replace(lists['u1'], stops=(first, replace(
        later, begin_after=sky.now + 120.0)))
    sky.event('COMPLETED', 't0', 'u1')
    sky.core.tick(sky.now, sky.now)
    sky.world.params = AllocatorParams(background_budget=0.0, route_end='hold', **RULE)
    sky.report((-100.0, 0.0, 50.0), (0.0, -102.0, 50.0))  # it would meet u1 if that set out now
    assert sky.step() == []


def test_one_on_its_way_home_from_rest_arrives_when_it_has_sped_up_and_braked():
    # 55 m and 15 m/s: at home after 9 s, not 4 s, where u1 has come down to its height
    sky = Sky({'mode': 'LANDING', 'velocity': (0.0, 0.0, -1.5), 'home': (0.0, 0.0, 0.0)},
              {'mode': 'RETURNING', 'velocity': (0.0, 0.0, 0.0), 'home': (18.0, 0.0, 0.0)},
              separation__horizontal=30.0, separation__vertical=10.0)
    sky.world.lists.lists['u2'] = replace(sky.world.list_of('u2'), stops=(), returns=True,
                                          end_via=((18.0, 0.0, 34.0),))
    sky.report((0.0, 0.0, 54.0), (73.0, 0.0, 34.0))
    assert sky.step() == [('u2', True)]


def test_one_on_its_way_home_that_got_a_task_is_predicted_on_its_way_there():
    sky = Sky({}, {'mode': 'RETURNING', 'home': (0.0, -200.0, 0.0)})
    assert sky.step() == [('u1', True)]


class SkyWithNewList(Sky):
    """The list on board of u2 is the one before that in force, which leads it to `place`."""

    def __init__(self, place):
        super().__init__()
        lists = self.world.lists.lists
        self.revision = lists['u2'].revision
        for each in self.more:
            each['list_revision'] = self.revision
        self.report((-300.0, 0.0, 50.0))
        assert self.step() == []
        away = Task('t9', place, allowed_uavs=frozenset({'u2'}))
        self.add(away)
        lists['u2'] = replace(lists['u2'], revision=self.revision + 1, stops=(
            replace(lists['u2'].stops[0], task=away, begin_after=0.0),))


def test_the_list_on_board_is_predicted_until_the_one_in_force_is():
    sky = SkyWithNewList((0.0, -300.0, 50.0))
    sky.report()
    assert sky.step() == [('u1', True)]
    sky.more[1] |= {'list_revision': sky.revision + 1, 'velocity': (0.0, -15.0, 0.0)}
    sky.report()
    assert sky.step() == [('u1', False)]


def test_a_list_on_board_is_not_flown_while_a_uav_stands_for_an_upload():
    sky = SkyWithNewList((0.0, -300.0, 50.0))
    sky.more[1] |= {'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)}
    sky.report()
    assert sky.step() == []


def test_one_that_stands_for_an_upload_is_in_the_way_until_its_list_is_on_board():
    sky = SkyWithNewList((0.0, 300.0, 50.0))
    sky.more[1] |= {'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)}
    sky.report((-140.0, 0.0, 50.0), (0.0, 0.0, 50.0))
    assert sky.step() == [('u1', True)]
    sky.more[1] |= {'mode': 'ON_MISSION', 'list_revision': sky.revision + 1}
    sky.report((-140.0, 0.0, 50.0), (0.0, 0.0, 50.0))
    assert sky.step() == [('u1', False)]


def test_of_two_that_stopped_a_little_too_near_the_one_with_a_way_out_goes_on():
    still = {'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)}
    sky = Sky(still, still)
    places = (0.0, 0.0, 50.0), (29.99, 0.0, 50.0)
    sky.world.params = AllocatorParams(background_budget=0.0, route_end='hold')
    sky.cancel('t1', 't2')
    # u1 would fly to below u2, and straight ahead u2 would pass u1
    sky.add(Task('t3', (27.0, -15.0, 43.0), allowed_uavs=frozenset({'u1'})),
            Task('t4', (-25.0, -53.0, 31.0), allowed_uavs=frozenset({'u2'})))
    sky.report(*places)
    sky.settle(report=False)
    sky.world.params = AllocatorParams(background_budget=0.0, route_end='hold',
                                       separation__horizontal=30.0, separation__vertical=10.0)
    found = []
    for _ in range(30):
        sky.report(*places)
        found += sky.step(1.0)
        sky.settle(report=False)
    assert sorted(found[:2]) == [('u1', True), ('u2', True)]
    assert [each for each in found if not each[1]] == [('u2', False)]
    assert sky.world.list_of('u1').stops[0].leg.via == ()
    assert all(abs(z - 50.0) >= 10.0 for _, _, z in sky.world.list_of('u2').stops[0].leg.via)
