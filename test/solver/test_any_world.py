# SPDX-License-Identifier: Apache-2.0
"""Random small worlds: plans are valid and give reasons; a warm plan is no worse."""
import math
from dataclasses import replace

import pytest
from hypothesis import Phase, given, settings, strategies as st
from plan_checks import check

from uav_task_alloc import SOLVERS, Task, ThreatZone, Uav, plan

SKILLS = ('camera', 'lidar')
steps = st.integers(-6, 6).map(lambda i: 25.0 * i)  # coincident and collinear points are common
points = st.tuples(steps, steps, st.sampled_from([0.0, 20.0, 80.0]))
skills = st.frozensets(st.sampled_from(SKILLS))
ranges = st.sampled_from([0.0, 60.0, 200.0, 700.0, math.inf])


def fleets(most=4):
    uav = st.builds(lambda place, reach, able, home: (place, reach, able, home),
                    points, ranges, skills, st.none() | points)
    return st.lists(uav, max_size=most).map(lambda rows: [
        Uav(f'u{i}', place, reach, capabilities=able, home=home)
        for i, (place, reach, able, home) in enumerate(rows)])


def works(most=9):
    allowed = st.none() | st.frozensets(st.sampled_from(['u0', 'u1', 'u9']))
    task = st.tuples(points, st.sampled_from([1.0, 2.5]), skills, allowed)
    return st.lists(task, max_size=most).map(lambda rows: [
        Task(f't{i}', place, value, required_capabilities=able, allowed_uavs=allowed_ids)
        for i, (place, value, able, allowed_ids) in enumerate(rows)])


ZONES = st.lists(st.one_of(
    st.builds(ThreatZone.hemisphere, st.uuids().map(str), points, st.sampled_from([30.0, 60.0])),
    st.builds(ThreatZone.cylinder, st.uuids().map(str), points, st.just(40.0))), max_size=3)
OPTIONS = st.fixed_dictionaries({
    'route_end': st.sampled_from(['hold', 'home']), 'hard_range': st.booleans(),
    'threads': st.sampled_from([1, 1, 1, 2]), 'seed': st.integers(0, 9),
    'solver': st.sampled_from([*['chain_q'] * 6, *SOLVERS])})


def quick(uavs, tasks, zones, **options):
    return plan(uavs, tasks, zones, budget=60.0,
                max_iterations=200 if options['solver'] == 'chain_q' else 5, **options)


def alone(task, uav, zones, options):
    """Metres beyond range when this UAV serves only this task; inf: it may not or cannot."""
    result = plan([replace(uav, range=math.inf)], [task], zones, budget=60.0, max_iterations=0,
                route_end=options['route_end'])
    return math.inf if result.unassigned else result.distance - uav.range


def check_reasons(result, uavs, tasks, zones, options):
    for task in (each for each in tasks if each.id in result.unassigned):
        reason = result.unassigned[task.id]
        short = [alone(task, uav, zones, options) for uav in uavs]
        if reason.startswith('left out'):
            assert min(short) <= 1e-6
        elif reason.startswith('beyond'):
            assert 0.0 < min(short) < math.inf
        else:
            assert min(short, default=math.inf) == math.inf


def order(result):
    """Sort key of plans: more value, then less distance and excess."""
    return -result.value, result.distance + 100.0 * result.penalty


@settings(max_examples=60, deadline=None, derandomize=True,
          phases=[Phase.generate])
@given(uavs=fleets(), tasks=works(), zones=ZONES, options=OPTIONS)
def test_plans_of_random_small_worlds_are_valid(uavs, tasks, zones, options):
    result = quick(uavs, tasks, zones, **options)
    check(result, uavs, tasks, options['hard_range'])
    check_reasons(result, uavs, tasks, zones, options)
    assert math.isfinite(result.distance)
    if options['threads'] == 1:
        assert quick(uavs, tasks, zones, **options).routes == result.routes


@settings(max_examples=60, deadline=None, derandomize=True,
          phases=[Phase.generate])
@given(uavs=fleets(), tasks=works(), zones=ZONES, options=OPTIONS, data=st.data())
def test_plans_after_random_small_changes_are_valid(uavs, tasks, zones, options, data):
    before = quick(uavs, tasks, zones, **options)
    moved = [replace(uav, position=data.draw(points), range=data.draw(ranges)) for uav in uavs]
    fleet = moved[data.draw(st.integers(0, 1)):]
    work = tasks[data.draw(st.integers(0, 2)):] + [Task('new', data.draw(points))]
    zones = data.draw(st.sampled_from([zones, zones[1:], []]))
    ids = {task.id for task in work}
    locked = {uav.id: row for uav in fleet if (row := [
        task_id for task_id in before.routes[uav.id][:data.draw(st.integers(0, 2))]
        if task_id in ids])}
    only_repaired = {**options, 'solver': 'chain_q'}  # baselines construct a plan in any case
    repaired = plan(fleet, work, zones, budget=60.0, max_iterations=0, warm=before,
                    locked=locked, **only_repaired)
    result = quick(fleet, work, zones, warm=before, locked=locked, **options)
    check_locked_plan(result, fleet, work, zones, locked, options)
    assert order(result)[0] <= order(repaired)[0] + 1e-9
    if result.value == pytest.approx(repaired.value):
        assert order(result)[1] <= order(repaired)[1] + 1e-6


def check_locked_plan(result, uavs, tasks, zones, locked, options):
    """As check, but locked tasks stay first even beyond range; then nothing is added to them."""
    for uav in uavs:
        row = [task_id for task_id in locked.get(uav.id, ()) if task_id not in result.unassigned]
        assert list(result.routes[uav.id][:len(row)]) == row
    flown = [task_id for row in result.routes.values() for task_id in row]
    assert sorted([*flown, *result.unassigned]) == sorted(task.id for task in tasks)
    assert math.isfinite(result.distance)
    if options['hard_range']:
        held = [task for task in tasks if any(task.id in row for row in locked.values())]
        alone = quick(uavs, held, zones, locked=locked, **options)
        for uav in uavs:
            assert result.route(uav.id).distance <= 1e-6 + max(
                uav.range, alone.route(uav.id).distance)
