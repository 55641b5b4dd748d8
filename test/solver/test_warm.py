# SPDX-License-Identifier: Apache-2.0
"""Going on from an earlier plan."""
from dataclasses import replace

from plan_checks import check, make

from uav_task_alloc import Plan, Task, ThreatZone, Uav, plan

UAVS, TASKS = make(4, 24)


def quick(uavs, tasks, zones=(), **options):
    return plan(uavs, tasks, zones, **{'budget': 5.0, 'max_iterations': 500, **options})


BEFORE = quick(UAVS, TASKS)


def test_without_iterations_the_plan_stays():
    again = quick(UAVS, TASKS, warm=BEFORE, max_iterations=0)
    assert again.routes == BEFORE.routes
    assert again.warm_started
    assert not BEFORE.warm_started


def test_a_warm_plan_is_never_worse():
    again = quick(UAVS, TASKS, warm=BEFORE)
    assert again.fit <= BEFORE.fit + 1e-9


def test_new_tasks_go_in_and_cancelled_ones_are_gone():
    tasks = [*TASKS[4:], Task('new', (500.0, 500.0, 0.0))]
    again = quick(UAVS, tasks, warm=BEFORE, max_iterations=0)
    check(again, UAVS, tasks)
    assert not again.unassigned
    kept = [row for row in again.routes.values() if 'new' not in row]
    gone = {task.id for task in TASKS[:4]}
    assert {tuple(t for t in row if t not in gone) for row in BEFORE.routes.values()} >= set(kept)


def test_the_tasks_of_a_lost_uav_go_to_the_others():
    again = quick(UAVS[1:], TASKS, warm=BEFORE)
    check(again, UAVS[1:], TASKS)
    assert not again.unassigned


def test_a_route_beyond_a_shrunken_range_is_cut():
    uavs = [replace(uav, range=400.0) for uav in UAVS]
    check(quick(uavs, TASKS, warm=BEFORE), uavs, TASKS)


def test_a_new_zone_is_flown_around_and_swallows_what_is_inside():
    inside = ThreatZone.cylinder('z', TASKS[0].position, 30.0)
    again = quick(UAVS, TASKS, [inside], warm=BEFORE)
    check(again, UAVS, TASKS)
    assert again.unassigned['t0'] == 'inside zone z'
    back = quick(UAVS, TASKS, warm=again)
    assert not back.unassigned


def test_a_plan_made_by_hand_is_a_start_too():
    hand = Plan({'u0': ('t3', 'nobody'), 'nowhere': ('t1',)}, state='what is this')
    again = quick(UAVS, TASKS, warm=hand, max_iterations=0)
    check(again, UAVS, TASKS)
    assert 't3' in again.routes['u0']


def test_what_is_learnt_is_found_again_by_id():
    moved = [*TASKS[:0:-1], Task('new', (1.0, 1.0, 0.0))]
    first = quick(UAVS, TASKS, max_iterations=20_000)
    again = quick(UAVS, moved, warm=first)
    check(again, UAVS, moved)


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
    again = quick(joined, TASKS, warm=BEFORE)
    check(again, joined, TASKS)
