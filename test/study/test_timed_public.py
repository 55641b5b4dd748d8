# SPDX-License-Identifier: Apache-2.0
"""Public instances with time windows: what is read, and what their solutions cost."""
import math

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.study import timed_bench
from uav_task_alloc.study.instances import Instance
from uav_task_alloc.study.public import instance_sources, parse_instance, read_folder
from uav_task_alloc.study.timed_public import solution_trips

VRPTW = """NAME : small
TYPE : VRPTW
DIMENSION : 4
VEHICLES : 3
CAPACITY : 20
SERVICE_TIME : 5
EDGE_WEIGHT_TYPE : EUC_2D
NODE_COORD_SECTION
1 0 0
2 3 4
3 1 1
4 0 -9
DEMAND_SECTION
1 0
2 12
3 8
4 9
TIME_WINDOW_SECTION
1 0 50
2 0 40
3 30 45
4 0 40
DEPOT_SECTION
1
EOF
"""
PRIZES = VRPTW.replace('TYPE : VRPTW', 'TYPE : PCVRPTW').replace(
    'DEPOT_SECTION', 'PRIZE_SECTION\n1 0\n2 30\n3 2\n4 25\nDEPOT_SECTION')
TRIPS = VRPTW.replace('TYPE : VRPTW', 'TYPE: MTVRPTWR').replace('VEHICLES : 3', 'VEHICLES: 1')
TRIPS = TRIPS.replace(
    'DEPOT_SECTION', 'RELEASE_TIME_SECTION\n1 0\n2 2\n3 0\n4 0\n'
    'VEHICLES_RELOAD_DEPOT_SECTION\n1 1\nDEPOT_SECTION')
DEPOTS = """NAME: two
TYPE: MDVRPTW
DIMENSION: 4
VEHICLES: 2
CAPACITY: 20
VEHICLES_MAX_DURATION: 30
NODE_COORD_SECTION
1\t0\t0
2\t10\t0
3\t3.5\t0
4\t9\t0
DEMAND_SECTION
1 0
2 0
3 5
4 5
SERVICE_TIME_SECTION
1 0
2 0
3 1
4 2
TIME_WINDOW_SECTION
1 0 90
2 0 90
3 20 40
4 0 40
VEHICLES_DEPOT_SECTION
1\t1
2\t2
DEPOT_SECTION
1
2
EOF
"""
TOPTW = """2 1 3 1
0 60
 0 0 0 0 0 0 0 60
 1 3 4 5 10 1 1 1 0 20
 2 0 6.25 5 7 1 2 1 4 30 40
 3 9 0 5 0 1 1 1 0 40
"""


def run(instance, text):
    return evaluate_routes(instance.uavs, instance.tasks, instance.rules, solution_trips(text))


def test_windows_loads_and_service_are_read_and_lengths_cut():
    instance = parse_instance('small.vrp', VRPTW)
    assert (instance.group, len(instance.uavs), instance.grain) == ('VRPTW', 3, 10.0)
    assert instance.uavs[0] == Uav('u1', (0.0, 0.0, 0.0), cruise_speed=1.0, payload_capacity=20.0,
                                   available_until=50.0)
    assert instance.tasks[1] == Task('t2', (1.0, 1.0, 0.0), service_time=5.0, earliest=30.0,
                                     latest=45.0, payload=8.0)
    found = run(instance, 'Route #1: 1 2\nRoute #2: 3\nCost 27.0')
    assert found.violations == ()
    assert found.cost == pytest.approx(5.0 + 3.6 + 1.4 + 18.0)
    assert run(instance, 'Route #1: 1 2 3').violations


def test_the_known_cost_is_that_of_the_solution():
    solved = parse_instance('small.vrp', VRPTW, solution='Route #1: 1 2\nRoute #2: 3')
    assert solved.known == pytest.approx(28.0)
    with pytest.raises(InvalidValue, match=r'solution = .*expected a valid one'):
        parse_instance('small.vrp', VRPTW, solution='Route #1: 1 2 3')


def test_a_prize_is_lost_where_its_task_is_not_served():
    instance = parse_instance('small.vrp', PRIZES)
    assert [task.value for task in instance.tasks] == [30.0, 2.0, 25.0]
    assert run(instance, 'Route #1: 1\nRoute #2: 3').cost == pytest.approx(10.0 + 18.0 + 2.0)


def test_trips_begin_after_the_releases_of_their_loads():
    instance = parse_instance('small.vrp', TRIPS)
    found = run(instance, 'Route #1: 3 0 1 2')
    assert instance.trips > 1
    assert found.violations == ()
    assert found.timetable.trips == {'u1': (('t3',), ('t1', 't2'))}
    assert run(instance, 'Route #1: 1').timetable.departures == {'u1': (2.0,)}


def test_several_depots_and_limited_durations_are_read():
    instance = parse_instance('two.vrp', DEPOTS)
    assert [uav.position for uav in instance.uavs] == [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)]
    assert [task.id for task in instance.tasks] == ['t2', 't3']
    found = run(instance, 'Route #1: 2\nRoute #2: 3')
    assert found.cost == pytest.approx(9.0)
    assert found.timetable.departures == {'u1': (16.5,), 'u2': (0.0,)}


def test_team_orienteering_has_a_source_for_each_number_of_vehicles(tmp_path):
    (tmp_path / 'pr99.txt').write_text(TOPTW)
    (tmp_path / 'good_values.txt').write_text('# table\npr99.txt 10 17\n')
    (tmp_path / 'notes.sol').write_text('no instance')
    texts, skipped = read_folder(tmp_path)
    assert skipped == {}
    sources = instance_sources(tmp_path, texts)
    assert list(sources) == [f'pr99.txt*{count}' for count in (1, 2, 3, 4)]
    instance = parse_instance(**sources['pr99.txt*2'])
    assert (instance.known, instance.group, len(instance.uavs)) == (17.0, 'TOPTW-2', 2)
    assert (instance.grain, instance.collects) == (100.0, True)
    assert [(task.id, task.value, task.earliest, task.latest) for task in instance.tasks] == [
        ('t1', 10.0, 0.0, 20.0), ('t2', 7.0, 30.0, 40.0)]
    assert math.isnan(parse_instance(**sources['pr99.txt*3']).known)


def test_the_solution_beside_an_instance_is_its_best_known(tmp_path):
    (tmp_path / 'small.vrp').write_text(VRPTW)
    (tmp_path / 'small.sol').write_text('Route #1: 1 2\nRoute #2: 3')
    texts, _ = read_folder(tmp_path, '*.vrp')
    source = instance_sources(tmp_path, texts)['small.vrp']
    assert parse_instance(**source).known == pytest.approx(28.0)


@pytest.mark.parametrize(('old', 'new', 'text'), [
    ('TYPE : VRPTW', 'TYPE : CVRP',
     "small.vrp: TYPE = 'CVRP': expected one of VRPTW, PCVRPTW, MTVRPTWR, MDVRPTW"),
    ('DIMENSION : 4', 'DIMENSION : 5', 'small.vrp: points = 4: expected DIMENSION = 5'),
    ('TIME_WINDOW_SECTION', 'WINDOWS', 'expected an instance of Chao, MSTOP, Cordeau, VRPLIB or'),
])
def test_a_file_that_is_no_instance_is_refused(old, new, text):
    with pytest.raises(InvalidValue) as refused:
        parse_instance('small.vrp', VRPTW.replace(old, new))
    assert text in str(refused.value)


@pytest.mark.parametrize('name', ['nearest', 'ortools'])
def test_solvers_that_take_no_times_say_so(name):
    rows = timed_bench.found(parse_instance('small.vrp', VRPTW), name, (0.1, 1.0))
    assert [row['score'] for row in rows] == [None, None]
    assert rows[0]['faults'][0].endswith(f'{name} takes no windows, loads or trips')


@pytest.mark.parametrize(('text', 'score'), [
    (VRPTW, 28.0), (PRIZES, 28.0), (TRIPS, 28.0), (DEPOTS, 9.0), (TOPTW, 17.0)],
    ids=['VRPTW', 'PCVRPTW', 'MTVRPTWR', 'MDVRPTW', 'TOPTW'])
def test_chain_q_solves_them(text, score):
    instance = parse_instance('pr99.txt', text)
    row, = timed_bench.found(instance, 'chain_q', (0.05,))
    assert row['faults'] == []
    assert row['score'] == pytest.approx(score)


@pytest.mark.parametrize(('text', 'score'), [
    (VRPTW, 28.0), (PRIZES, 28.0), (TRIPS, 28.0), (DEPOTS, 9.0), (TOPTW, 17.0)],
    ids=['VRPTW', 'PCVRPTW', 'MTVRPTWR', 'MDVRPTW', 'TOPTW'])
def test_pyvrp_solves_the_same_model(text, score):
    pytest.importorskip('pyvrp')
    instance = parse_instance('pr99.txt', text)
    row, = timed_bench.found(instance, 'pyvrp', (0.1,))
    assert row['faults'] == []
    assert row['score'] == pytest.approx(score)


def test_what_pyvrp_cannot_express_is_said():
    pytest.importorskip('pyvrp')
    instance = Instance('fast', (Uav('u', (0.0, 0.0, 0.0)),), (Task('t', (1.0, 0.0, 0.0)),),
                        objective='finish')
    row, = timed_bench.found(instance, 'pyvrp', (0.1,))
    assert row['faults'] == ["fast: objective = 'given': expected none of it for pyvrp"]
