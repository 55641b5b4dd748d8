# SPDX-License-Identifier: Apache-2.0
"""The adapters to PyVRP and OR-Tools are right: the independent evaluator finds no fault."""
import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.study.evaluator import evaluate
from uav_task_alloc.study.instances import Instance, make_instance
from uav_task_alloc.study.reference_solvers import REFERENCE_SOLVERS, best_at, integer_model

SOLVERS = pytest.mark.parametrize('name', REFERENCE_SOLVERS)
BUDGET = 0.2  # [s] of CPU
# four UAVs of two kinds on a line of 9 tasks; three are out of reach from either side
LINE = Instance(
    'line', (*(Uav(f'w{i}', (0.0, 0.0, 0.0), 45.0, home=(0.0, 5.0, 0.0)) for i in range(2)),
             *(Uav(f'e{i}', (100.0, 0.0, 0.0), 45.0) for i in range(2))),
    tuple(Task(f't{x}', (float(x), 0.0, 0.0), value=x / 10.0) for x in range(10, 100, 10)),
    (), 'home', True)


@SOLVERS
def test_open_routes_of_a_reference_solver_are_valid_and_as_short_as_ours(name):
    pytest.importorskip(name)
    instance = make_instance(3, 9, 5)
    incumbents = REFERENCE_SOLVERS[name](instance, BUDGET)
    evaluations = [evaluate(instance, routes) for _, routes in incumbents]
    assert all(each.is_valid(collects=False) for each in evaluations)
    ours = evaluate(instance, plan(instance.uavs, instance.tasks, budget=60.0,
                                max_iterations=5000).routes)
    assert evaluations[-1].length == pytest.approx(ours.length, rel=1e-5)


@SOLVERS
def test_a_reference_solver_serves_the_highest_value_within_range(name):
    pytest.importorskip(name)
    incumbents = REFERENCE_SOLVERS[name](LINE, BUDGET)
    evaluations = [evaluate(LINE, routes) for _, routes in incumbents]
    assert all(not each.faults for each in evaluations)
    assert evaluations[-1].value == 1.0 + 2.0 + 8.0 + 9.0  # 30 to 70 are beyond 45 m and back
    assert [when for when, _ in incumbents] == sorted(when for when, _ in incumbents)


def test_uavs_of_equal_start_home_and_range_share_a_vehicle_type_and_lengths_are_rounded_up():
    model = integer_model(LINE)
    assert [[uav.id for uav in uavs] for uavs in model.vehicle_types] == [
        ['w0', 'w1'], ['e0', 'e1']]
    assert model.ends == [2, 3]
    assert model.lengths[0, 1] == pytest.approx(model.unit * 100.0, abs=1.0)
    assert (model.lengths[0, model.first_task] >= model.unit * 10.0 - 1e-6).all()


def test_the_routes_at_a_budget_are_the_last_found_within_it():
    incumbents = [(0.1, {'a': ['x']}), (0.5, {'a': ['y']})]
    assert best_at(incumbents, 0.05) is None
    assert best_at(incumbents, 0.3) == {'a': ['x']}
    assert best_at(incumbents, 1.0) == {'a': ['y']}
