# SPDX-License-Identifier: Apache-2.0
"""`plan`: routes, reasons, options, errors."""
import math
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from plan_checks import check, make

from uav_task_alloc import SOLVERS, Task, ThreatZone, Uav, plan
from uav_task_alloc.errors import InvalidValue, UnknownName

ONE = Uav('u1', (0.0, 0.0, 0.0))


def quick(uavs, tasks, zones=(), **options):
    return plan(uavs, tasks, zones, **{'budget': 5.0, 'max_iterations': 300, **options})


@pytest.mark.parametrize('solver', SOLVERS)
@pytest.mark.parametrize('route_end', ['hold', 'home'])
@pytest.mark.parametrize('hard', [True, False])
def test_every_solver_gives_a_valid_plan(solver, route_end, hard):
    uavs, tasks = make(3, 15, reach=1500.0)
    result = quick(uavs, tasks, solver=solver, route_end=route_end, hard_range=hard,
                 max_iterations=20)
    check(result, uavs, tasks, hard)
    assert result.solver == solver
    assert hard or not result.unassigned


def test_four_corners_are_flown_in_order():
    tasks = [Task(name, place) for name, place in (
        ('c', (100.0, 100.0, 0.0)), ('a', (100.0, 0.0, 0.0)), ('d', (0.0, 110.0, 0.0)))]
    result = quick([ONE], tasks)
    assert result.routes == {'u1': ('a', 'c', 'd')}
    assert result.distance == pytest.approx(200.0 + math.hypot(100.0, 10.0))
    assert [leg.via for leg in result.legs['u1']] == [(), (), ()]


def test_the_leg_to_a_separate_home_counts():
    uav = Uav('u1', (0.0, 0.0, 0.0), home=(0.0, 50.0, 0.0))
    result = quick([uav], [Task('t', (100.0, 50.0, 0.0))], route_end='home')
    assert result.distance == pytest.approx(math.hypot(100.0, 50.0) + 100.0)
    assert result.returns


def test_a_uav_without_tasks_flies_nowhere():
    uavs = [ONE, Uav('far', (9e3, 0.0, 0.0), home=(0.0, 9e3, 0.0))]
    result = quick(uavs, [Task('t', (1.0, 0.0, 0.0))], route_end='home')
    assert result.routes['far'] == ()
    assert result.legs['far'] == ()


def test_without_tasks_or_uavs_the_plan_is_empty():
    assert quick([], []).routes == {}
    assert quick([ONE], []).routes == {'u1': ()}
    assert quick([ONE], []).fit == math.inf
    assert quick([], [Task('t', (0.0, 0.0, 0.0))]).unassigned == {'t': 'there are no UAVs'}


@pytest.mark.parametrize('objective', ['distance', 'finish', 'response', 'balanced'])
def test_without_uavs_ways_loads_and_windows_are_left_out(objective):
    start, end = (100.0, 0.0, 50.0), (300.0, 0.0, 50.0)
    tasks = [Task('line', start, path=(start, end), reversible=True),
             Task('load', end, payload=2.0, latest=50.0), Task('t', start)]
    for trips in (1, 2):
        assert quick([], tasks, objective=objective, trips=trips).unassigned == dict.fromkeys(
            ('line', 'load', 't'), 'there are no UAVs')


def test_coincident_points_and_range_0_are_served():
    tasks = [Task(f't{i}', (0.0, 0.0, 0.0)) for i in range(4)]
    result = quick([Uav('u1', (0.0, 0.0, 0.0), range=0.0)], tasks)
    assert not result.unassigned
    assert result.distance == 0.0


def test_a_range_that_just_suffices_suffices():
    result = quick([Uav('u1', (0.0, 0.0, 0.0), range=100.0)], [Task('t', (100.0, 0.0, 0.0))])
    assert result.routes == {'u1': ('t',)}
    assert result.penalty == 0.0


@pytest.mark.parametrize(('task', 'reason'), [
    (Task('t', (500.0, 0.0, 0.0)),
     'beyond the range of every UAV: u1 needs 500 m and has 300 m left'),
    (Task('t', (1.0, 0.0, 0.0), required_capabilities=frozenset({'lidar', 'camera'})),
     'no UAV has the capabilities lidar'),
    (Task('t', (1.0, 0.0, 0.0), allowed_uavs=frozenset({'u9'})),
     'not allowed: only u9 may serve it'),
    (Task('t', (100.0, 100.0, 10.0)), 'inside zone z'),
])
def test_a_task_that_no_uav_can_serve_is_unassigned_with_a_reason(task, reason):
    uav = Uav('u1', (0.0, 0.0, 0.0), 300.0, capabilities=frozenset({'camera'}))
    zone = ThreatZone.hemisphere('z', (100.0, 100.0, 0.0), 50.0)
    result = quick([uav], [task, Task('near', (2.0, 0.0, 0.0))], [zone])
    assert result.unassigned == {'t': reason}
    assert result.routes == {'u1': ('near',)}


def test_where_ranges_do_not_suffice_the_most_value_is_served():
    tasks = [Task('poor', (-90.0, 0.0, 0.0)), Task('rich', (90.0, 0.0, 0.0), value=5.0),
             Task('on the way', (50.0, 0.0, 0.0))]
    result = quick([Uav('u1', (0.0, 0.0, 0.0), range=100.0)], tasks)
    assert result.routes == {'u1': ('on the way', 'rich')}
    assert result.unassigned == {'poor': 'left out: the ranges do not suffice for all tasks'}


def test_with_soft_range_every_task_is_served_at_a_penalty():
    result = quick([Uav('u1', (0.0, 0.0, 0.0), 30.0)], [Task('t', (100.0, 0.0, 0.0))],
                 hard_range=False)
    assert result.routes == {'u1': ('t',)}
    assert result.penalty == 70.0


def test_a_restricted_task_is_served_wherever_its_uav_is():
    uavs, tasks = make(4, 40)
    tasks += [Task(f'only{i}', (10.0, 10.0, 0.0), allowed_uavs=frozenset({f'u{i}'}))
              for i in range(4)]
    result = quick(uavs, tasks)
    check(result, uavs, tasks)
    assert not result.unassigned


def test_legs_lead_around_zones():
    zone = ThreatZone.cylinder('z', (50.0, 0.0), 20.0)
    result = quick([ONE], [Task('t', (100.0, 0.0, 0.0))], [zone])
    leg, = result.legs['u1']
    assert leg.via
    assert leg.length == result.distance > 100.0


def test_locked_tasks_come_first_in_their_order():
    uavs, tasks = make(3, 12)
    result = quick(uavs, tasks, locked={'u1': ['t7', 't2'], 'unknown': ['t1'], 'u2': ['unknown']})
    check(result, uavs, tasks)
    assert result.routes['u1'][:2] == ('t7', 't2')


def test_a_locked_uav_flies_home_after_its_task():
    result = quick([ONE], [Task('t', (100.0, 0.0, 0.0))], locked={'u1': ['t']}, route_end='home')
    assert result.distance == 200.0
    assert [leg.length for leg in result.legs['u1']] == [100.0, 100.0]


def test_a_locked_task_inside_a_zone_is_left_out():
    zone = ThreatZone.hemisphere('z', (100.0, 0.0, 0.0), 50.0)
    result = quick([ONE], [Task('t', (100.0, 0.0, 10.0))], [zone], locked={'u1': ['t']})
    assert result.unassigned == {'t': 'inside zone z'}


def test_the_history_falls_and_ends_with_the_fit():
    uavs, tasks = make(3, 30)
    result = quick(uavs, tasks)
    fits = [fit for _, fit in result.history]
    assert fits == sorted(fits, reverse=True)
    assert fits[-1] == pytest.approx(result.fit)


def test_the_budget_is_kept_on_the_given_clock():
    now = iter(i * 0.01 for i in range(10_000))
    uavs, tasks = make(3, 30)
    result = plan(uavs, tasks, budget=1.0, clock=lambda: next(now))
    assert 0.9 <= result.solve_time <= 1.3


def test_every_iteration_is_reported_with_the_best_fit_so_far():
    uavs, tasks = make(3, 30)
    calls = []
    result = quick(uavs, tasks, on_iteration=lambda *each: calls.append(each))
    counts, fits = zip(*calls, strict=True)
    assert sorted(set(counts)) == list(counts)
    assert counts[-1] == result.iterations >= 300
    assert sorted(fits, reverse=True) == list(fits)
    assert fits[-1] == pytest.approx(result.fit)


def test_stop_ends_the_search_with_the_best_plan_so_far():
    uavs, tasks = make(3, 30)
    result = plan(uavs, tasks, budget=60.0, stop=lambda: True)
    check(result, uavs, tasks)
    assert result.iterations == 0


@pytest.mark.parametrize(('options', 'text'), [
    ({'budget': -1.0}, r'budget = -1\.0: expected a number in \[0, 86400\]'),
    ({'route_end': 'moon'}, "route_end = 'moon': expected one of hold, home"),
    ({'threads': 0}, r'threads = 0: expected an integer in \[1, 64\]'),
    ({'warm': {}}, "warm = 'dict': expected a Plan, its state or None"),
    ({'seed': 1.5}, r'seed = 1\.5: expected an integer'),
    ({'zones': None}, 'zones = None: expected an iterable of ThreatZone'),
    ({'max_iterations': -1}, 'max_iterations = -1: expected an integer'),
    ({'locked': {'u1': 't'}}, r"locked\[u1\] = 't': expected a sequence of task ids"),
    ({'budget': np.ones(2)}, r'budget = array\(\[1., 1.\]\): expected a number in'),
    ({'route_end': np.ones(2)}, r'route_end = array\(\[1., 1.\]\): expected one of hold, home'),
    ({'threads': True}, r'threads = True: expected an integer in \[1, 64\]'),
    ({'max_iterations': True}, 'max_iterations = True: expected an integer'),
])
def test_a_wrong_option_is_refused(options, text):
    with pytest.raises(InvalidValue, match=text):
        plan([ONE], [Task('t', (0.0, 0.0, 0.0))], **options)


def test_numbers_of_other_types_count_as_what_they_are():
    zone = ThreatZone.cylinder('z', (150.0, 20.0), 30.0)
    options = {'threads': np.int64(1), 'trips': np.int32(2), 'max_iterations': np.int64(5),
               'budget': Decimal('0.5'), 'altitude_min': Fraction(1, 2),
               'altitude_max': Decimal(90), 'clearance': np.float32(2.0)}
    assert plan([ONE], [Task('t', (300.0, 40.0, 9.0))], [zone], **options).routes == {
        ONE.id: ('t',)}


@pytest.mark.parametrize('objective', ['distance', 'balanced'])
def test_sums_of_the_largest_values_are_finite(objective):
    tasks = [Task(f't{i}', (float(i), 0.0, 0.0), value=1e200, announced=-4e9) for i in range(4)]
    found = quick([replace(ONE, range=2.5)], tasks, objective=objective)
    assert found.routes['u1'] == ('t0', 't1', 't2')
    assert (found.value, found.fit) == (pytest.approx(3e200), pytest.approx(0.02))
    assert math.isfinite(found.response)


def test_ids_are_used_once():
    with pytest.raises(InvalidValue, match="uav id = 'u1': expected an id used once"):
        plan([ONE, ONE], [])
    with pytest.raises(InvalidValue, match="task id = 't': expected an id used once"):
        plan([ONE], [Task('t', (0.0, 0.0, 0.0))] * 2)
    with pytest.raises(InvalidValue, match='expected a Uav'):
        plan(['u1'], [])


def test_a_task_cannot_be_locked_to_two_uavs():
    with pytest.raises(InvalidValue, match='not locked to u1, too'):
        plan([ONE, Uav('u2', (0.0, 0.0, 0.0))], [Task('t', (0.0, 0.0, 0.0))],
             locked={'u1': ['t'], 'u2': ['t']})


def test_an_unknown_solver_is_refused_with_the_known_names():
    with pytest.raises(UnknownName, match=r"solver 'magic': expected one of chain_q, "):
        plan([ONE], [], solver='magic')


@pytest.mark.parametrize('solver', SOLVERS)
@pytest.mark.parametrize('route_end', ['hold', 'home'])
def test_a_task_inside_a_zone_is_left_out_by_every_solver(solver, route_end):
    uavs, tasks = make(3, 12, seed=4, reach=4000.0)
    over = tasks[5].position
    dome = ThreatZone.hemisphere('dome', (over[0] + 5.0, over[1], 0.0), 60.0)
    result = quick(uavs, tasks, [dome], solver=solver, route_end=route_end,
                 max_iterations=6000 if solver == 'chain_q' else 60)
    check(result, uavs, tasks)
    assert result.unassigned == {'t5': 'inside zone dome'}


@pytest.mark.parametrize('reach', [math.inf, 9e4])
@pytest.mark.parametrize('zone', [ThreatZone.cylinder('z', (0.0, 0.0), 50.0),
                                  ThreatZone.hemisphere('z', (0.0, 0.0, -1.0), 50.0)])
def test_a_home_inside_a_zone_is_the_reason_that_no_task_is_served(reach, zone):
    uav = Uav('u1', (300.0, 0.0, 30.0), reach, home=(0.0, 0.0, 0.0))
    result = quick([uav], [Task('t', (350.0, 0.0, 30.0))], [zone], route_end='home')
    assert result.routes == {'u1': ()}
    assert result.unassigned == {'t': 'no safe path home; home of u1 is inside zone z'}
    assert quick([uav], [Task('t', (350.0, 0.0, 30.0))], [zone]).routes == {'u1': ('t',)}


def test_a_plan_or_its_state_is_a_warm_start():
    uavs, tasks = make(3, 30)
    cold = quick(uavs, tasks)
    for warm in (cold, cold.state):
        again = quick(uavs, tasks, warm=warm, max_iterations=0)
        assert again.warm_started
        assert again.routes == cold.routes


def test_a_plan_says_when_each_task_is_reached_and_when_it_ends():
    uav = Uav('u1', (0.0, 0.0, 0.0), cruise_speed=10.0, climb_speed=1.0)
    tasks = [Task('a', (100.0, 0.0, 20.0), 3.0, service_time=5.0), Task('b', (200.0, 0.0, 20.0))]
    result = quick([uav, Uav('idle', (0.0, 9e3, 0.0))], tasks, route_end='home')
    assert result.arrivals == {'a': pytest.approx(20.0), 'b': pytest.approx(35.0)}
    assert result.finish == pytest.approx(55.0)
    assert result.response == pytest.approx((3.0 * 20.0 + 35.0) / 4.0)
    assert result.waits == {'a': 0.0, 'b': 0.0}
    assert result.trips == {'u1': (('a', 'b'),)}
    assert result.cost == pytest.approx(result.distance)


def test_detours_count_in_the_arrivals():
    uav = Uav('u1', (0.0, 0.0, 10.0), cruise_speed=10.0)
    wall = ThreatZone.polygon('z', [(40.0, -100.0), (60.0, -100.0), (60.0, 100.0), (40.0, 100.0)])
    result = quick([uav], [Task('a', (100.0, 0.0, 10.0))], [wall])
    leg, = result.legs['u1']
    assert leg.via
    assert result.arrivals == {'a': pytest.approx(leg.length / 10.0)}


@pytest.mark.parametrize('solver', [name for name in SOLVERS if name != 'chain_q'])
def test_a_task_with_a_path_is_for_one_solver_only(solver):
    line = Task('line', (1.0, 0.0, 0.0), path=((1.0, 0.0, 0.0), (9.0, 0.0, 0.0)))
    with pytest.raises(InvalidValue, match='latest times, loads, paths'):
        quick([ONE], [line], solver=solver)


@pytest.mark.parametrize('objective', ['distance', 'finish'])
@pytest.mark.parametrize('limits', [{'altitude_max': 60.0}, {'altitude_max': 70.0}])
def test_no_leg_leads_over_a_task_beyond_the_altitude_limits(objective, limits):
    uav = Uav('u', (-44.08, -49.42, 34.77), range=350.0)
    tasks = [Task('t0', (-21.74, -37.78, 68.24)), Task('t2', (-28.43, 30.32, 113.11)),
             Task('t3', (-35.64, 31.79, 100.31), value=5.0)]
    zones = [ThreatZone.cylinder('z0', (-40.5, 10.66), 14.2, 0.0, 60.0, margin=5.0),
             ThreatZone.polygon('z2', [(-33.28, -10.12), (-36.75, -3.0), (-41.83, -15.69),
                                       (-41.39, -18.08), (-35.52, -12.68)], 0.0, 200.0)]
    found = plan([uav], tasks, zones, clearance=5.0, route_end='home', objective=objective,
                 max_iterations=50, budget=60.0, **limits)
    points = [point for leg in found.legs['u'] for point in leg.via]
    assert all(point[2] <= limits['altitude_max'] for point in points)


@pytest.mark.parametrize(('option', 'value'), [
    ('hard_range', 'no'), ('hard_range', None), ('weights', 5), ('stop', 5), ('on_iteration', 5),
    ('clock', 5), ('locked', [('u1', ['t0'])]), ('locked', {'u1': None}), ('altitude_max', 'x'),
    ('altitude_min', True)])
def test_an_option_of_another_type_is_refused_by_name(option, value):
    zone = ThreatZone.cylinder('z', (150.0, 20.0), 30.0)
    with pytest.raises(InvalidValue, match=option):
        quick([ONE], [Task('t0', (9.0, 9.0, 9.0))], [zone], **{option: value})
