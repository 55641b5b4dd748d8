# SPDX-License-Identifier: Apache-2.0
"""Path searches around many zones keep the budget; legs without a known path are not flown."""
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.geometry.distances import Distances
from uav_task_alloc.geometry.search_budget import SearchBudget
from uav_task_alloc.geometry.zones import inside, path_is_clear
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.reasons import reasons
from uav_task_alloc.solver.routes import empty_routes, insert, remove

IN_TIME = 'found in the time'
WALL = ThreatZone.cylinder('wall', (500.0, 0.0), 200.0)
PLUG = ThreatZone.cylinder('plug', (500.0, 300.0), 200.0)


def overlapping(count, seed, side=1500.0, tasks=12):
    """UAVs, tasks and cylinders that lie over each other, of many heights."""
    rng = np.random.default_rng(seed)
    zones = [ThreatZone.cylinder(f'z{k}', rng.uniform(0.0, side, 2), rng.uniform(80.0, 220.0),
                                 z_max=rng.uniform(60.0, 300.0)) for k in range(count)]
    places = (tuple(rng.uniform((0.0, 0.0, 20.0), (side, side, 60.0)))
              for _ in itertools.count())
    free = (place for place in places if not any(inside(place, zone) for zone in zones))
    uavs = [Uav(f'u{k}', next(free)) for k in range(2)]
    return uavs, [Task(f't{k}', next(free)) for k in range(tasks)], zones


class Ticking:
    """A clock that advances by a millisecond at each call."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return 0.001 * self.calls


def check(result, uavs, tasks, zones):
    """Every task is served on clear legs or left out with a reason."""
    place = {task.id: task.position for task in tasks}
    served = [name for row in result.routes.values() for name in row]
    assert sorted([*served, *result.unassigned]) == sorted(place)
    assert all(result.unassigned.values())
    for uav in uavs:
        here = uav.position
        row = result.routes[uav.id]
        for name, leg in zip(row, result.legs[uav.id][:len(row)], strict=True):
            assert math.isfinite(leg.length)
            assert path_is_clear([here, *leg.via, place[name]], zones)
            here = place[name]


@pytest.mark.parametrize('options', [{}, {'objective': 'response'}])
def test_many_tasks_are_served_though_no_time_is_left_for_paths(options):
    rng = np.random.default_rng(4)
    side = 20_000.0
    uavs = [Uav(f'u{k}', (*rng.uniform(0.0, side, 2), 50.0)) for k in range(8)]
    tasks = [Task(f't{k}', (*rng.uniform(0.0, side, 2), 50.0)) for k in range(2100)]
    zones = [ThreatZone.cylinder(f'z{k}', rng.uniform(0.0, side, 2), 500.0) for k in range(6)]
    within = [task.id for task in tasks if any(inside(task.position, zone) for zone in zones)]
    result = plan(uavs, tasks, zones, budget=0.0, route_end='home', clock=Ticking(), **options)
    check(result, uavs, tasks, zones)
    assert len(result.unassigned) <= 1.2 * len(within)
    again = plan(uavs, tasks, zones, budget=0.0, route_end='home', clock=Ticking(), warm=result,
                 **options)
    assert not (set(again.unassigned) - set(result.unassigned))


def test_finding_20_the_clock_is_read_during_path_searches():
    uavs, tasks, zones = overlapping(40, 1)
    clock = Ticking()
    result = plan(uavs, tasks, zones, budget=0.05, max_iterations=0, clock=clock)
    assert 20 <= clock.calls <= 100  # half the budget for paths; at most twice the budget
    check(result, uavs, tasks, zones)


def test_finding_20_a_stop_from_the_start_returns_a_plan_of_known_legs():
    uavs, tasks, zones = overlapping(40, 1)
    polls = itertools.count()
    result = plan(uavs, tasks, zones, budget=1000.0, stop=lambda: next(polls) >= 0)
    assert next(polls) < 100
    check(result, uavs, tasks, zones)
    assert any(IN_TIME in reason for reason in result.unassigned.values())
    assert any(result.routes.values())


@pytest.mark.parametrize('seed', range(8))
def test_finding_20_legs_not_found_in_time_are_not_flown(seed):
    uavs, tasks, zones = overlapping(60, seed, tasks=20)
    result = plan(uavs, tasks, zones, budget=0.02, clock=Ticking(), seed=seed)
    check(result, uavs, tasks, zones)
    again = plan(uavs, tasks, zones, budget=0.02, clock=Ticking(), seed=seed, warm=result)
    check(again, uavs, tasks, zones)
    assert len(again.unassigned) <= len(result.unassigned)


def test_finding_20_legs_not_found_in_time_are_found_later():
    uavs, tasks, zones = overlapping(40, 1)
    whole = plan(uavs, tasks, zones, budget=1000.0, max_iterations=0)
    result = plan(uavs, tasks, zones, budget=0.02, max_iterations=0, clock=Ticking())
    assert len(result.unassigned) > len(whole.unassigned)
    for _ in range(1000):
        if len(result.unassigned) == len(whole.unassigned):
            break
        result = plan(uavs, tasks, zones, budget=0.05, max_iterations=0, clock=Ticking(),
                      warm=result)
    assert result.unassigned.keys() == whole.unassigned.keys()


def test_finding_20_a_stop_removes_no_task_from_the_earlier_plan():
    uavs, tasks, zones = overlapping(40, 1)
    result = plan(uavs, tasks, zones, budget=1000.0, max_iterations=0)
    moved = [Uav(uav.id, tuple(np.add(uav.position, (0.0, 0.0, 0.5)))) for uav in uavs]
    after = plan(moved, tasks, zones, budget=1000.0, stop=lambda: True, warm=result)
    assert after.unassigned.keys() == result.unassigned.keys()


@pytest.mark.parametrize('objective', ['distance', 'finish'])
@pytest.mark.parametrize('route_end', ['hold', 'home'])
def test_a_plan_keeps_its_tasks_where_the_budget_is_used_up_before_the_search(
        objective, route_end):
    """A large problem takes longer than the budget to build: then nothing was found."""
    uavs = [Uav('u0', (0.0, 0.0, 50.0)), Uav('u1', (0.0, 900.0, 50.0))]
    tasks = [Task(f't{k}', (200.0 * k, 250.0 * (k % 4), 50.0)) for k in range(12)]
    options = {'objective': objective, 'route_end': route_end}
    before = plan(uavs, tasks, budget=1e3, max_iterations=50, **options)
    assert not before.unassigned
    late = itertools.chain([0.0], itertools.repeat(10.0))
    zone = ThreatZone.cylinder('zone', (-500.0, -500.0), 50.0)
    after = plan(uavs, tasks, [zone], budget=0.1, warm=before, max_iterations=0,
                 clock=lambda: next(late), **options)
    assert after.unassigned == {}


@pytest.mark.parametrize('objective', ['distance', 'finish'])
@pytest.mark.parametrize('gone', [(), (0,), (3,), (7,), (2, 5)], ids=str)
def test_ways_home_around_zones_are_kept_where_no_path_is_found_in_time(objective, gone):
    """Lengths known from before are none here, as in a problem with thousands of tasks."""
    wall = ThreatZone.polygon('wall', ((-50.0, -300.0), (-40.0, -300.0), (-40.0, 300.0),
                                       (-50.0, 300.0)))
    zones = [wall, *(ThreatZone.cylinder(f'post {y}', (-45.0, y), 30.0) for y in (-300.0, 300.0)),
             ThreatZone.cylinder('post', (330.0, 0.0), 25.0)]
    uav = Uav('u', (20.0, 0.0, 50.0), home=(-200.0, 0.0, 50.0))
    tasks = [Task(f't{k}', (80.0 * k, 40.0 * (-1) ** k, 50.0)) for k in range(8)]
    options = {'objective': objective, 'route_end': 'home'}
    before = plan([uav], tasks, zones, budget=1e3, max_iterations=200, **options)
    assert not before.unassigned
    assert before.legs['u'][-1].via
    left = [task for task in tasks if before.routes['u'].index(task.id) not in gone]
    late = (5.0 * max(0, k - 1) for k in itertools.count())
    after = plan([uav], left, zones, budget=0.1, warm=replace(before, state=None),
                 max_iterations=0, clock=lambda: next(late), **options)
    assert after.unassigned == {}
    places = {task.id: task.position for task in tasks}
    line = [uav.position]
    stops = [*(places[name] for name in after.routes['u']), uav.home]
    for leg, stop in zip(after.legs['u'], stops, strict=True):
        line += [*leg.via, stop]
    assert path_is_clear(line, zones)


@pytest.mark.parametrize(('reach', 'text'), [
    (math.inf, 'no safe path past the zones found in the time; searched for again with the next '
               'plan'),
    (9e4, 'left out: the ranges do not suffice for all tasks')])
def test_a_task_that_is_left_out_without_a_limit_of_range_is_not_out_of_range(reach, text):
    """It can be reached: no path to it from a task, or from it to one, was found."""
    tasks = [Task('west', (300.0, 0.0, 50.0)), Task('east', (700.0, 0.0, 50.0))]
    problem = make_problem([Uav('u', (500.0, 900.0, 50.0), reach)], tasks, {}, Limits((WALL,)),
                           Rules())
    assert reasons(problem, np.array([1])) == {'east': text}


def test_finding_20_an_exception_of_stop_is_raised_by_plan():
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(*overlapping(40, 1), budget=1000.0, stop=stop)


def test_finding_20_a_leg_that_is_flown_is_kept_where_no_path_is_found_in_time():
    ends = [(0.0, 0.0, 50.0), (1000.0, 100.0, 50.0)]
    via = Distances(ends, [WALL, PLUG]).leg(0, 1).via
    budget = SearchBudget()
    distances = Distances(ends, [WALL, PLUG], budget=budget)
    budget.start_stage(0)
    assert distances.length(0, 1) == math.inf
    assert distances.given_up(0, 1)
    assert not distances.offer_path(0, 1, [(500.0, 0.0, 50.0)])  # inside
    assert distances.offer_path(0, 1, [(-50.0, 0.0, 50.0), *via])
    assert math.isfinite(distances.length(0, 1))
    assert distances.leg(0, 1).length == distances.length(0, 1)
    assert path_is_clear([ends[0], *distances.leg(0, 1).via, ends[1]], [WALL, PLUG])


@pytest.mark.parametrize('start', [(0.0, 0.0, 50.0), (310.0, 0.0, 50.0)])
def test_finding_20_the_path_over_a_removed_task_stays_usable(start):
    tasks = [Task('between', (500.0, 520.0, 50.0)), Task('last', (1000.0, 20.0, 50.0))]
    problem = make_problem([Uav('u', start)], tasks, {}, Limits((WALL, PLUG)), Rules())
    a, routes = problem.arrays, empty_routes(problem.arrays)
    insert(a, routes, 1, 0)
    insert(a, routes, 2, 1)
    whole = routes.length[0]
    distances = Distances(problem.distances.points, (WALL, PLUG))  # knows only these two
    over = distances.length(0, 1) + distances.length(1, 2)
    distances.budget.start_stage(0)
    arrays = a._replace(pairs=distances.pairs)
    remove(arrays, routes, 1)
    assert routes.length[0] == pytest.approx(whole) == pytest.approx(over)
    assert distances.length(0, 2) == pytest.approx(over)
    leg = distances.leg(0, 2)
    assert tasks[0].position in leg.via
    first = leg.via[0] if inside(start, WALL) else start
    assert path_is_clear([first, *leg.via, tasks[1].position], [WALL, PLUG])
