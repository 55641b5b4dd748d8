# SPDX-License-Identifier: Apache-2.0
"""The models for PyVRP and OR-Tools are right: one judge, who knows neither, finds no fault."""
import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.study import reference_solvers as rivals
from uav_task_alloc.study.evaluator import judge
from uav_task_alloc.study.instances import Instance, make_instance

RIVALS = pytest.mark.parametrize('name', rivals.REFERENCE_SOLVERS)
BUDGET = 0.2  # [s] of CPU
# four UAVs of two kinds on a line of 9 tasks; three are out of reach from either side
LINE = Instance(
    'line', (*(Uav(f'w{i}', (0.0, 0.0, 0.0), 45.0, home=(0.0, 5.0, 0.0)) for i in range(2)),
             *(Uav(f'e{i}', (100.0, 0.0, 0.0), 45.0) for i in range(2))),
    tuple(Task(f't{x}', (float(x), 0.0, 0.0), value=x / 10.0) for x in range(10, 100, 10)),
    (), 'home', True)


@RIVALS
def test_open_routes_of_a_rival_are_sound_and_as_good_as_ours(name):
    pytest.importorskip(name)
    instance = make_instance(3, 9, 5)
    found = rivals.REFERENCE_SOLVERS[name](instance, BUDGET)
    judged = [judge(instance, routes) for _, routes in found]
    assert all(each.counts(collects=False) for each in judged)
    ours = judge(instance, plan(instance.uavs, instance.tasks, budget=60.0,
                                max_iterations=5000).routes)
    assert judged[-1].length == pytest.approx(ours.length, rel=1e-5)


@RIVALS
def test_a_rival_that_collects_within_range_takes_what_it_can(name):
    pytest.importorskip(name)
    found = rivals.REFERENCE_SOLVERS[name](LINE, BUDGET)
    judged = [judge(LINE, routes) for _, routes in found]
    assert all(not each.faults for each in judged)
    assert judged[-1].value == 1.0 + 2.0 + 8.0 + 9.0  # 30 to 70 are beyond 45 m and back
    assert [when for when, _ in found] == sorted(when for when, _ in found)


def test_uavs_that_are_alike_share_a_crew_and_lengths_are_rounded_up():
    made = rivals.model(LINE)
    assert [[uav.id for uav in crew] for crew in made.crews] == [['w0', 'w1'], ['e0', 'e1']]
    assert made.ends == [2, 3]
    assert made.ways[0, 1] == pytest.approx(made.unit * 100.0, abs=1.0)
    assert (made.ways[0, made.tasks] >= made.unit * 10.0 - 1e-6).all()


def test_the_routes_after_a_budget_are_the_last_that_were_known_by_then():
    found = [(0.1, {'a': ['x']}), (0.5, {'a': ['y']})]
    assert rivals.at(found, 0.05) is None
    assert rivals.at(found, 0.3) == {'a': ['x']}
    assert rivals.at(found, 1.0) == {'a': ['y']}
