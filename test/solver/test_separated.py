# SPDX-License-Identifier: Apache-2.0
"""`plan(separation=)`: plans whose UAVs are apart, and what they report of their conflicts."""
import math
import random
import statistics
from dataclasses import replace

import pytest

from uav_task_alloc import Separation, Task, ThreatZone, Uav, plan
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.flight_time import flight_time
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.objective import OBJECTIVES
from uav_task_alloc.separation.conflicts import find_conflicts
from uav_task_alloc.separation.volumes import flight_volumes
from uav_task_alloc.solver.separated import flights_of_plan

RULE = Separation(10.0, 5.0, 2.0)
SPEEDS = {'cruise_speed': 10.0, 'climb_speed': 2.5, 'descent_speed': 1.5}


def crossing(**more):
    """Two UAVs in the air whose only tasks are at the other's side."""
    uavs = [Uav('a', (0.0, 200.0, 30.0), home=(0.0, 0.0, 0.0), **SPEEDS),
            Uav('b', (200.0, 0.0, 30.0), home=(400.0, 0.0, 0.0), **SPEEDS)]
    tasks = [Task('ta', (400.0, 200.0, 30.0), allowed_uavs={'a'}, **more),
             Task('tb', (200.0, 400.0, 30.0), allowed_uavs={'b'})]
    return uavs, tasks


def conflicts_of(result, uavs, tasks, rule=RULE):
    flights = flights_of_plan(result, uavs, {task.id: task for task in tasks}, result.returns)
    return find_conflicts(flight_volumes(flights, rule), rule)


def test_routes_that_cross_get_other_heights():
    uavs, tasks = crossing()
    before = plan(uavs, tasks, budget=0.02)
    assert conflicts_of(before, uavs, tasks)
    result = plan(uavs, tasks, budget=0.02, separation=RULE)
    assert conflicts_of(result, uavs, tasks) == []
    assert result.routes == before.routes
    conflict, = result.conflicts
    assert conflict.uavs == ('a', 'b')
    assert conflict.resolution == 'height'
    assert conflict.detail == 'b flies at 35.5 m'
    assert conflict.position == pytest.approx((200.0, 200.0, 30.0), abs=RULE.horizontal)
    assert [point[2] for point in result.legs['b'][0].via] == [35.5, 35.5]
    assert result.distance > before.distance
    assert result.finish >= before.finish


def test_without_a_conflict_the_plan_is_the_same():
    uavs, tasks = crossing()
    tasks[1] = Task('tb', (900.0, 0.0, 30.0), allowed_uavs={'b'})
    result = plan(uavs, tasks, budget=0.02, separation=RULE)
    before = plan(uavs, tasks, budget=0.02)
    assert (result.legs, result.arrivals, result.conflicts) == (before.legs, before.arrivals, ())


def test_off_is_as_without():
    uavs, tasks = crossing()
    result = plan(uavs, tasks, budget=0.02, separation=Separation())
    assert conflicts_of(result, uavs, tasks)
    assert result.conflicts == ()


def test_what_is_no_rule_is_refused():
    with pytest.raises(InvalidValue, match=r'^separation = 10: expected a Separation or None'):
        plan([], [], separation=10)


def test_a_task_that_cannot_be_reached_apart_gets_another_uav():
    uavs, tasks = crossing()
    tasks[1] = Task('tb', (200.0, 400.0, 30.0), latest=45.0)
    uavs.append(Uav('c', (200.0, 700.0, 30.0), home=(200.0, 700.0, 0.0), **SPEEDS))
    tasks[0] = Task('ta', (400.0, 200.0, 30.0), allowed_uavs={'a'}, latest=45.0)
    tasks.append(Task('tc', (200.0, 190.0, 30.0), allowed_uavs={'b'}, latest=25.0))
    result = plan(uavs, tasks, budget=0.05, separation=RULE, altitude_max=30.0)
    assert conflicts_of(result, uavs, tasks) == []
    assert {each.resolution for each in result.conflicts} & {'other uav', 'left out'}
    assert not result.warm_started  # another solve continues the first one
    assert result.history[0][0] <= result.solve_time
    assert all(each.position for each in result.conflicts)
    for name, why in result.unassigned.items():
        assert 'cannot be kept apart from' in why, name


def test_heights_stay_out_of_zones():
    uavs, tasks = crossing()
    zones = [ThreatZone.cylinder('above', (200.0, 200.0), 60.0, 38.0, 300.0)]
    rule = Separation(10.0, 10.0, 2.0)
    result = plan(uavs, tasks, zones, budget=0.05, separation=rule)
    assert conflicts_of(result, uavs, tasks, rule) == []
    for uav in uavs:
        place = uav.position
        for name, leg in zip(result.routes[uav.id], result.legs[uav.id], strict=True):
            goal = next(task.position for task in tasks if task.id == name)
            assert path_is_clear((place, *leg.via, goal), zones)


def test_a_deadline_is_kept():
    uavs, tasks = crossing(latest=41.0)
    result = plan(uavs, tasks, budget=0.05, separation=RULE)
    assert result.timetable().late == {}
    assert result.arrivals['ta'] <= 41.0


def test_a_uav_in_the_air_that_waits_for_a_release_passes_others_when_it_does():
    uavs, tasks = crossing()
    free = replace(tasks[1], release=60.0)  # when the other has passed
    result = plan(uavs, [tasks[0], free], budget=0.02, separation=RULE)
    assert result.conflicts == ()
    uavs[0] = replace(uavs[0], position=(-400.0, 200.0, 30.0))
    result = plan(uavs, [tasks[0], free], budget=0.02, separation=RULE)
    assert result.arrivals['tb'] == pytest.approx(100.0, abs=0.5)
    assert [each.resolution for each in result.conflicts] == ['height']


def test_a_uav_in_the_air_is_in_the_way_also_before_it_is_available():
    uavs, tasks = crossing()
    uavs[1] = replace(uavs[1], position=(200.0, 200.0, 30.0), available_from=60.0)
    result = plan(uavs, tasks, budget=0.02, separation=RULE)
    assert [each.resolution for each in result.conflicts] == ['height']
    assert result.arrivals['tb'] == 80.0


@pytest.mark.parametrize(('start', 'meets'), [(-300.0, True), (-500.0, False)])
def test_the_stay_of_a_task_with_a_path_is_at_its_end_as_missions_hold_there(start, meets):
    uavs = [Uav('a', (start, 200.0, 30.0), home=(start, 0.0, 0.0), cruise_speed=10.0),
            Uav('b', (0.0, -100.0, 30.0), home=(0.0, -300.0, 0.0), cruise_speed=10.0)]
    tasks = [Task('ta', (600.0, 200.0, 30.0), allowed_uavs={'a'}),
             Task('tb', (0.0, -90.0, 30.0), path=((0.0, -90.0, 30.0), (0.0, 300.0, 30.0)),
                  service_time=20.0, allowed_uavs={'b'})]
    result = plan(uavs, tasks, budget=0.02, separation=Separation(10.0, 5.0, 0.0, 0.0))
    assert bool(result.conflicts) == meets


ONE_HEIGHT = {'altitude_min': 30.0, 'altitude_max': 30.0}


@pytest.mark.parametrize(('limit', 'heights', 'resolution'), [
    ({'available_until': 39.0}, ONE_HEIGHT, 'left out'),  # a wait would end after it
    ({'available_until': 44.0}, ONE_HEIGHT, 'hold'),
    ({'range': 386.0}, {}, 'hold'),  # another height is longer
    ({'range': 500.0}, {}, 'height')])
def test_heights_and_waits_keep_ranges_and_availability(limit, heights, resolution):
    uavs = [Uav('a', (-100.0, 0.0, 30.0), home=(-100.0, 0.0, 0.0), cruise_speed=10.0),
            Uav('b', (0.0, -100.0, 0.0), cruise_speed=10.0, **limit)]
    tasks = [Task('ta', (200.0, 0.0, 30.0), allowed_uavs={'a'}),
             Task('tb', (0.0, 90.0, 30.0), allowed_uavs={'b'})]
    result = plan(uavs, tasks, budget=0.02, route_end='home', objective='finish',
                  separation=Separation(10.0, 5.0, 2.0, 0.0), **heights)
    assert [each.resolution for each in result.conflicts] == [resolution]
    assert result.penalty == 0.0
    ends = result.timetable().ends
    assert ends.get('b', 0.0) <= limit.get('available_until', math.inf)


def locked_to_wait(x, **limits):
    """`b` flies from its first task to its second one across the way of `a`, at one height."""
    uavs = [Uav('a', (x, 0.0, 30.0), home=(-100.0, 0.0, 0.0), cruise_speed=10.0),
            Uav('b', (0.0, -100.0, 30.0), home=(-300.0, 90.0, 0.0), cruise_speed=10.0, **limits)]
    tasks = [Task('ta', (300.0, 0.0, 30.0), allowed_uavs={'a'}),
             Task('t0', (0.0, -90.0, 30.0), allowed_uavs={'b'}),
             Task('tb', (0.0, 90.0, 30.0), allowed_uavs={'b'})]
    return plan(uavs, tasks, budget=0.02, route_end='home', locked={'b': ('t0', 'tb')},
                separation=Separation(20.0, 5.0, 2.0), **ONE_HEIGHT)


def test_a_uav_in_the_air_does_not_wait_beyond_its_endurance():
    free, bound = locked_to_wait(-100.0), locked_to_wait(-100.0, endurance=50.0)
    assert [each.resolution for each in free.conflicts] == ['hold']
    assert free.finish > 50.0
    assert [each.resolution for each in bound.conflicts] == ['left out']
    assert bound.timetable().ends['b'] == pytest.approx(49.0)


def test_a_deadline_that_the_plan_keeps_is_kept_also_where_the_climb_is_a_column():
    uavs = [Uav('a', (-100.0, 50.0, 30.0), home=(-100.0, 0.0, 0.0), cruise_speed=10.0),
            Uav('b', (0.0, 0.0, 0.0), cruise_speed=10.0, climb_speed=2.5, descent_speed=2.5)]
    tasks = [Task('ta', (300.0, 50.0, 30.0), allowed_uavs={'a'}),
             Task('tb', (0.0, 100.0, 30.0), allowed_uavs={'b'}, latest=15.0)]
    result = plan(uavs, tasks, budget=0.02, separation=Separation(20.0, 5.0, 2.0), **ONE_HEIGHT)
    assert result.conflicts
    assert result.timetable().late == {}


def test_times_of_a_changed_plan_are_those_of_its_legs():
    uavs = [Uav('a', (150.0, -150.0, 30.0), home=(0.0, 0.0, 0.0), cruise_speed=10.0),
            Uav('b', (0.0, 0.0, 30.0), home=(300.0, 0.0, 0.0), cruise_speed=10.0,
                climb_speed=2.5, descent_speed=1.0)]
    tasks = [Task('ta', (150.0, 150.0, 30.0), allowed_uavs={'a'}),
             Task('tb', (0.0, 10.0, 30.0), allowed_uavs={'b'})]
    result = plan(uavs, tasks, budget=0.02, route_end='home', separation=Separation(20., 5., 2.))
    leg = result.legs['b'][-1]
    assert leg.via
    assert result.timetable().ends['b'] == pytest.approx(result.timetable().starts['tb'] + (
        flight_time(uavs[1], (tasks[1].position, *leg.via, uavs[1].base))))


def test_the_penalty_of_a_changed_plan_is_that_of_each_trip():
    uavs = [Uav('a', (0.0, 0.0, 0.0), range=500.0, turnaround=30.0, cruise_speed=10.0,
                climb_speed=5.0, descent_speed=5.0),
            Uav('b', (-100.0, 100.0, 30.0), home=(-100.0, 200.0, 0.0), cruise_speed=10.0)]
    tasks = [Task('t1', (0.0, 200.0, 30.0), allowed_uavs={'a'}),
             Task('t2', (0.0, -200.0, 30.0), allowed_uavs={'a'}),
             Task('t3', (200.0, 100.0, 30.0), allowed_uavs={'b'})]
    result = plan(uavs, tasks, budget=0.02, trips=2, route_end='home', objective='finish',
                  locked={'a': ('t1',)}, separation=Separation(20.0, 5.0, 2.0))
    assert len(result.trips['a']) == 2
    assert result.conflicts
    assert result.penalty == 0.0
    assert result.cost == pytest.approx(OBJECTIVES['finish'].cost(result.distance, result.finish))


def scene(seed, uavs, tasks, bases):
    rng = random.Random(seed)
    size = 100.0 * math.sqrt(tasks)
    pads = [(rng.uniform(0.0, size), rng.uniform(0.0, size)) for _ in range(bases)]
    fleet = [Uav(f'u{k}', (x + 12.0 * (k // bases), y, 0.0), **SPEEDS)
             for k, (x, y) in enumerate(pads[k % bases] for k in range(uavs))]
    work = [Task(f't{k}', (rng.uniform(0.0, size), rng.uniform(0.0, size), rng.choice(
        (30.0, 40.0))), service_time=5.0) for k in range(tasks)]
    return fleet, work


def test_scenes_are_apart_at_a_few_percent_more_flight_time():
    extra, seen = [], 0
    for seed in range(3):
        uavs, tasks = scene(seed, uavs=8, tasks=40, bases=1 + seed % 3)
        before, result = (
            plan(uavs, tasks, route_end='home', max_iterations=300, budget=60.0,
                 objective='balanced', separation=rule) for rule in (None, RULE))
        seen += bool(conflicts_of(before, uavs, tasks))
        assert all(each.resolution for each in result.conflicts)
        if not any(each.resolution == 'hold' or 'waits' in each.detail
                   for each in result.conflicts):  # waits are in the times only
            assert conflicts_of(result, uavs, tasks) == []
        assert result.unassigned == {}
        was, now = (sum(end - each.timetable().departures[uav][0]
                        for uav, end in each.timetable().ends.items())
                    for each in (before, result))
        extra.append(100.0 * (now - was) / was)
    assert seen
    assert statistics.median(extra) <= 3.0
    assert max(extra) <= 10.0
