# SPDX-License-Identifier: Apache-2.0
"""Warm starts from an earlier plan."""
import copy
import math
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from plan_checks import check, make

from uav_task_alloc import Plan, Task, ThreatZone, Uav, plan
from uav_task_alloc.study.instances import make_instance

UAVS, TASKS = make(4, 24)


def quick(uavs, tasks, zones=(), **options):
    return plan(uavs, tasks, zones, **{'budget': 5.0, 'max_iterations': 500, **options})


BEFORE = quick(UAVS, TASKS)


def test_without_iterations_the_plan_stays():
    result = quick(UAVS, TASKS, warm=BEFORE, max_iterations=0)
    assert result.routes == BEFORE.routes
    assert result.warm_started
    assert not BEFORE.warm_started


def test_a_warm_plan_is_never_worse():
    result = quick(UAVS, TASKS, warm=BEFORE)
    assert result.fit <= BEFORE.fit + 1e-9


def test_new_tasks_are_inserted_and_cancelled_ones_removed():
    tasks = [*TASKS[4:], Task('new', (500.0, 500.0, 0.0))]
    result = quick(UAVS, tasks, warm=BEFORE, max_iterations=0)
    check(result, UAVS, tasks)
    assert not result.unassigned
    kept = [row for row in result.routes.values() if 'new' not in row]
    cancelled = {task.id for task in TASKS[:4]}
    before = {tuple(t for t in row if t not in cancelled) for row in BEFORE.routes.values()}
    assert before >= set(kept)


def test_the_tasks_of_a_lost_uav_go_to_the_others():
    result = quick(UAVS[1:], TASKS, warm=BEFORE)
    check(result, UAVS[1:], TASKS)
    assert not result.unassigned


def test_a_route_beyond_a_shrunken_range_is_cut():
    uavs = [replace(uav, range=400.0) for uav in UAVS]
    check(quick(uavs, TASKS, warm=BEFORE), uavs, TASKS)


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_search_from_short_ranges_passes_through_plans_beyond_them(seed):
    instance = make_instance(8, 24, 10)
    uavs = [replace(uav, range=0.5 * uav.range) for uav in instance.uavs]
    before = quick(uavs, instance.tasks, max_iterations=0)
    result = quick(uavs, instance.tasks, warm=before, max_iterations=3000, seed=seed)
    check(result, uavs, instance.tasks)
    assert result.value == 12.0


def test_legs_avoid_a_new_zone_and_tasks_inside_it_are_left_out():
    inside = ThreatZone.cylinder('z', TASKS[0].position, 30.0)
    result = quick(UAVS, TASKS, [inside], warm=BEFORE)
    check(result, UAVS, TASKS)
    assert result.unassigned['t0'] == 'inside zone z'
    after = quick(UAVS, TASKS, warm=result)
    assert not after.unassigned


def test_a_plan_built_by_hand_is_a_warm_start():
    hand = Plan({'u0': ('t3', 'unknown'), 'nowhere': ('t1',)}, state='invalid')
    result = quick(UAVS, TASKS, warm=hand, max_iterations=0)
    check(result, UAVS, TASKS)
    assert 't3' in result.routes['u0']


def test_learnt_values_are_reused_by_id():
    moved = [*TASKS[:0:-1], Task('new', (1.0, 1.0, 0.0))]
    first = quick(UAVS, TASKS, max_iterations=60_000)
    assert first.state.learnt is not None  # scouts have flown
    result = quick(UAVS, moved, warm=first)
    check(result, UAVS, moved)


def test_locked_tasks_stay_over_many_events():
    known, tasks = BEFORE, list(TASKS)
    for event in range(10):
        locked = {uav: row[:1] for uav, row in known.routes.items() if row}
        tasks.append(Task(f'e{event}', (90.0 * event, 10.0, 0.0)))
        known = quick(UAVS, tasks, warm=known, locked=locked, max_iterations=50)
        check(known, UAVS, tasks)
        assert all(known.routes[uav][:1] == row for uav, row in locked.items())


def test_a_uav_that_joins_is_used():
    joined = [*UAVS, Uav('new', (500.0, 500.0, 0.0))]
    result = quick(joined, TASKS, warm=BEFORE)
    check(result, joined, TASKS)


@pytest.mark.parametrize('timed_last', [False, True])
def test_windows_may_come_and_go_between_plans(timed_last):
    windows = [replace(task, latest=1e6) for task in TASKS]
    first, then = (TASKS, windows) if timed_last else (windows, TASKS)
    before = quick(UAVS, first, max_iterations=200)
    alone = replace(before, state=None)  # the routes, without what was computed for them
    same = [quick(UAVS, then, warm=warm, max_iterations=200) for warm in (before, alone)]
    for each in same:
        check(each, UAVS, then)
    assert same[0].routes == same[1].routes


PICKLED = {
    'distance': (UAVS, TASKS, {}),
    'zone': (UAVS, TASKS, {'zones': [ThreatZone.cylinder('z', (500.0, 500.0), 120.0)]}),
    'trips': ([Uav('u', (0.0, 0.0, 0.0), 3000.0, turnaround=60.0, full_range=3000.0)],
              [Task(f't{k}', (400.0 * math.cos(k), 1200.0 * math.sin(k), 0.0)) for k in range(6)],
              {'trips': 3, 'route_end': 'home', 'objective': 'finish'}),
}


@pytest.mark.parametrize('kind', PICKLED)
def test_a_pickled_plan_has_its_times_and_is_a_warm_start(kind):
    uavs, tasks, options = PICKLED[kind]
    before = quick(uavs, tasks, **options)
    after = pickle.loads(pickle.dumps(before))
    assert {each.name: getattr(after, each.name) for each in fields(Plan)
            if each.name not in ('state', 'timetable')} == {
                each.name: getattr(before, each.name) for each in fields(Plan)
                if each.name not in ('state', 'timetable')}
    assert after.timetable() == before.timetable()
    assert after.timetable().arrivals
    again = quick(uavs, tasks, warm=after, max_iterations=0, **options)
    assert (again.routes, again.trips) == (before.routes, before.trips)
    assert kind != 'trips' or len(before.trips_of('u')) > 1
    assert copy.deepcopy(before).timetable() == before.timetable()


def test_what_was_learnt_is_pickled():
    before = quick(UAVS, TASKS, max_iterations=60_000)
    after = pickle.loads(pickle.dumps(before))
    known, learnt = before.state.learnt, after.state.learnt
    assert (learnt.uavs, learnt.tasks) == (known.uavs, known.tasks)
    for one, other in zip(learnt.tables, known.tables, strict=True):
        assert np.array_equal(one, other)
    assert quick(UAVS, TASKS, warm=after).fit <= before.fit + 1e-9
