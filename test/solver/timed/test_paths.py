# SPDX-License-Identifier: Apache-2.0
"""Tasks with a path: direction, length, times, ranges, zones, warm starts, locks, separation."""
import math
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc import Separation, Task, ThreatZone, Uav, plan
from uav_task_alloc.actions import Action
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.model import turned_tasks
from uav_task_alloc.separation.conflicts import find_conflicts
from uav_task_alloc.separation.volumes import flight_volumes
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.separated import flights_of_plan
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.solver.timed.schedule import Held
from uav_task_alloc.study.lines import left_after_loss, random_lines
from uav_task_alloc.study.small_problems import compare_small, small_problem

UAV = Uav('u', (0.0, 0.0, 0.0), cruise_speed=10.0)


def line(name, *points, **options):
    path = tuple((float(x), float(y), 0.0) for x, y in points)
    return Task(name, path[0], path=path, **{'reversible': True, **options})


def strips(count, length, width, **options):
    """Parallel lines at x = 0, all from the south to the north."""
    return [line(f'field#{k + 1}', (k * width, 0), (k * width, length), **options)
            for k in range(count)]


def evaluated(uavs, tasks, result, **rules):
    return evaluate_routes(uavs, tasks, Rules(**rules), result.trips, reversed=result.reversed)


def quick(uavs, tasks, *zones, **options):
    return plan(uavs, tasks, zones, **{'budget': 20.0, 'max_iterations': 300, **options})


def test_a_line_is_flown_from_its_nearer_end():
    found = quick([UAV], [line('far', (300, 0), (100, 0)), line('near', (400, 0), (500, 0))])
    assert found.routes == {'u': ('far', 'near')}
    assert found.reversed == {'far'}
    assert [leg.length for leg in found.legs['u']] == [100.0, 100.0]
    assert found.distance == 500.0
    assert found.arrivals == {'far': 10.0, 'near': 40.0}
    assert found.finish == 50.0


def test_a_line_that_is_not_reversible_is_flown_from_its_first_point():
    found = quick([UAV], [line('far', (300, 0), (100, 0), reversible=False)])
    assert (found.reversed, found.distance) == (frozenset(), 500.0)


def test_strips_are_flown_to_and_fro():
    tasks = strips(8, 400.0, 30.0)
    found = quick([UAV], tasks, route_end='home')
    assert len(found.reversed) == 4
    assert found.distance == pytest.approx(8 * 400.0 + 7 * 30.0 + 210.0)
    assert found.distance == evaluated([UAV], tasks, found, returns=True).distance


def test_a_window_is_that_of_the_begin_of_a_line_and_its_way_delays_what_follows():
    tasks = [line('line', (100, 0), (300, 0), earliest=20.0, latest=20.0, service_time=5.0),
             Task('after', (400.0, 0.0, 0.0), latest=55.0)]
    found = quick([UAV], tasks)
    assert found.arrivals == {'line': 20.0, 'after': 55.0}  # it waits on the ground
    late = quick([UAV], [tasks[0], replace(tasks[1], latest=54.0)])
    assert late.unassigned.keys() & {'line', 'after'}


def test_the_speed_along_a_line_may_be_another():
    slow = line('line', (100, 0), (300, 0), actions=(Action('speed', (('speed', 5.0),)),))
    assert quick([UAV], [slow]).finish == 50.0


@pytest.mark.parametrize(('uav', 'reason'), [
    (replace(UAV, range=299.0), 'no UAV can serve it: u needs 300 m and has 299 m left'),
    (replace(UAV, endurance=29.0), 'no UAV can serve it: u needs 30 s in the air and has 29 s'),
    (replace(UAV, available_until=29.0),
     'no UAV can serve it: u would end at 30 s and is available until 29 s')])
def test_ranges_endurances_and_availabilities_count_the_way_of_a_line(uav, reason):
    task = line('line', (300, 0), (100, 0))
    assert quick([uav], [task]).unassigned == {'line': reason}
    more = replace(uav, range=300.0, endurance=30.0, available_until=30.0)
    assert quick([more], [task]).routes == {'u': ('line',)}


def test_a_line_across_a_zone_is_unassigned_and_others_are_reached_around_it():
    zone = ThreatZone.cylinder('z', (200.0, 0.0), 50.0)
    tasks = [line('across', (100, 0), (300, 0)), line('beyond', (400, 100), (400, -100))]
    found = quick([UAV], tasks, zone)
    assert found.unassigned == {'across': 'its way crosses zone z'}
    assert found.routes == {'u': ('beyond',)}
    leg, = found.legs['u']
    assert leg.via
    first = turned_tasks(tasks, found.reversed)[1].position
    assert path_is_clear([UAV.position, *leg.via, first], [zone])
    assert found.distance == pytest.approx(leg.length + 200.0)
    held = quick([UAV], tasks, zone, locked={'u': ['across']})
    assert held.unassigned == {'across': 'its way crosses zone z'}


def test_legs_around_zones_go_from_end_to_end():
    rng = np.random.default_rng(5)
    zones = [ThreatZone.cylinder(f'z{k}', rng.uniform(0.0, 1000.0, 2), 60.0) for k in range(6)]
    tasks = []
    while len(tasks) < 12:
        a, b = rng.uniform(0.0, 1000.0, (2, 2)).round(1)
        if path_is_clear([(*a, 0.0), (*b, 0.0)], zones) and math.dist(a, b) < 400.0:
            tasks.append(line(f't{len(tasks)}', a, b))
    uavs = [UAV, replace(UAV, id='v', position=(1000.0, 1000.0, 0.0))]
    found = quick(uavs, tasks, *zones, route_end='home')
    assert not found.unassigned
    flown, lengths = {task.id: task for task in turned_tasks(tasks, found.reversed)}, []
    for uav in uavs:
        place = uav.position
        if not found.routes[uav.id]:
            continue
        stops = [(flown[name].position, flown[name].end) for name in found.routes[uav.id]]
        for leg, (first, last) in zip(found.legs[uav.id], [*stops, (uav.base,) * 2], strict=True):
            assert path_is_clear([place, *leg.via, first], zones)
            lengths.append(leg.length)
            place = last
    assert found.distance == pytest.approx(
        math.fsum([*lengths, *(task.path_length for task in tasks)]))


def test_an_earlier_plan_around_zones_is_kept_where_there_is_no_time_for_others():
    zones = [ThreatZone.cylinder(f'z{k}{y:+.0f}', (k * 200.0 + 100.0, y), 40.0)
             for k in range(4) for y in (-50.0, 150.0)]
    tasks = [line(f't{k}', (k * 200.0, 200), (k * 200.0, -100)) for k in range(5)]
    before = quick([UAV], tasks, *zones)
    assert before.reversed
    fresh = replace(before, state=None)  # no lengths are known
    after = plan([UAV], tasks, zones, warm=fresh, stop=lambda: True, clock=lambda: 0.0)
    assert (after.routes, after.reversed) == (before.routes, before.reversed)
    assert after.distance == pytest.approx(before.distance)


def test_an_earlier_plan_keeps_its_directions():
    tasks = [*strips(6, 200.0, 40.0), Task('p', (90.0, 300.0, 0.0))]
    before = quick([UAV], tasks)
    after = plan([UAV], tasks, budget=0.0, warm=before)
    assert before.reversed
    assert (after.routes, after.reversed, after.cost) == (
        before.routes, before.reversed, before.cost)


def test_a_locked_line_keeps_its_direction():
    tasks = [line('held', (100, 0), (300, 0)), line('other', (90, 50), (300, 50))]
    free = quick([UAV], tasks, locked={'u': ['held']})
    assert free.reversed == {'other'}
    turned = quick([UAV], tasks, locked={'u': ['held']}, reversed=['held'])
    assert turned.routes == {'u': ('held', 'other')}
    assert turned.reversed == {'held'}
    assert turned.distance == pytest.approx(300.0 + 200.0 + math.hypot(10.0, 50.0) + 210.0)
    again = quick([UAV], tasks, locked={'u': ['held']}, warm=turned)
    assert again.reversed == {'held'}
    found = evaluate_routes([UAV], tasks, Rules(), again.trips, reversed=again.reversed,
                            held=Held({'u': ['held']}))
    assert (found.distance, found.violations) == (again.distance, ())


def test_a_locked_line_that_is_not_reversible_is_not_turned():
    with pytest.raises(InvalidValue, match="'held': expected a task that is reversible"):
        quick([UAV], [line('held', (1, 0), (3, 0), reversible=False)], locked={'u': ['held']},
              reversed=['held'])


def test_the_evaluator_refuses_a_line_turned_that_may_not_be():
    found = evaluate_routes([UAV], [line('a', (1, 0), (3, 0), reversible=False)], Rules(),
                            {'u': [['a']]}, reversed=['a'])
    assert found.violations == ('a is flown from its last point',)


def test_ways_of_lines_are_kept_apart():
    speeds = {'cruise_speed': 10.0, 'climb_speed': 2.5, 'descent_speed': 1.5}
    uavs = [Uav('a', (0.0, 200.0, 30.0), home=(0.0, 0.0, 0.0), **speeds),
            Uav('b', (200.0, 0.0, 30.0), home=(400.0, 0.0, 0.0), **speeds)]
    path = ((20.0, 200.0, 30.0), (400.0, 200.0, 30.0))
    tasks = [Task('ta', path[0], path=path, allowed_uavs={'a'}),
             Task('tb', (200.0, 400.0, 30.0), allowed_uavs={'b'})]
    rule = Separation(10.0, 5.0, 2.0)

    def conflicts(found):
        flights = flights_of_plan(found, uavs, {task.id: task for task in tasks}, False)
        return find_conflicts(flight_volumes(flights, rule), rule)

    before = quick(uavs, tasks)
    assert conflicts(before)
    after = quick(uavs, tasks, separation=rule)
    assert conflicts(after) == []
    assert after.routes == before.routes
    assert after.conflicts
    assert after.legs['a'] == before.legs['a']
    assert after.distance == pytest.approx(380.0 + sum(
        leg.length for legs in after.legs.values() for leg in legs))


@pytest.mark.parametrize('seed', range(23001, 23013))
def test_plans_with_lines_are_valid_and_as_good_as_the_optimum(seed):
    result = compare_small(small_problem(seed, most_tasks=4, paths=0.7), rounds=400)
    assert result is None or (result.faults, result.warm_faults) == ((), ())
    assert result is None or result.gap < 1e-6


@pytest.mark.parametrize('seed', [1, 2])
def test_after_a_loss_only_unflown_lines_are_planned_and_as_well_as_from_nothing(seed):
    uavs, tasks = random_lines('fields', 4, 50, seed)
    goal = {'objective': 'finish', 'budget': 60.0, 'seed': seed}
    before = plan(uavs, tasks, max_iterations=2000, **goal)
    left = left_after_loss(before, uavs, tasks, uavs[0].id, 0.5 * before.finish)
    assert 0 < len(left.tasks) < len(tasks)
    assert left.locked
    rest = {'locked': left.locked, **goal}
    warm = plan(left.uavs, left.tasks, warm=before, max_iterations=2000, **rest)
    fresh = plan(left.uavs, left.tasks, max_iterations=10_000, **rest)
    flown = evaluate_routes(left.uavs, left.tasks, Rules(), warm.trips, held=Held(left.locked),
                            reversed=warm.reversed)
    assert flown.violations == ()
    assert flown.finish == pytest.approx(warm.finish)
    assert sorted(name for row in warm.routes.values() for name in row) == sorted(
        task.id for task in left.tasks)
    for uav_id, held in left.locked.items():
        assert warm.routes[uav_id][:1] == held
    assert warm.finish <= 1.05 * fresh.finish


@pytest.mark.parametrize('seed', [90054, 90063, 90088, 90104])
def test_plans_of_few_lines_are_optimal_in_both_directions(seed):
    result = compare_small(small_problem(seed, 7, paths=0.8, plain=True), 800)
    assert (result.faults, result.warm_faults) == ((), ())
    assert result.gap < 1e-6
