# SPDX-License-Identifier: Apache-2.0
"""The search where many tasks are left out: which are tried, where, and what that costs."""
import math
import random
from dataclasses import replace

import numpy as np
import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK
from uav_task_alloc.solver.timed.colony import COLD, SELECTION, TimedColony
from uav_task_alloc.solver.timed.insertion import _within_reach
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.places import cost_at
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.round import REMOVED, begin_round, empty_round
from uav_task_alloc.solver.timed.ruin import insert_removed, list_absent, ruin_strings
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState


def selection_problem():
    """A UAV that reaches few of the tasks in time."""
    work = [Task(f't{i}', (10.0 + i, 0.0, 0.0), latest=3.0, value=1.0 + i) for i in range(30)]
    fleet = [Uav('u', (0.0, 0.0, 0.0), cruise_speed=5.0)]
    return make_timed(make_problem(fleet, work, {}, Limits(), Rules()), {})


@pytest.mark.parametrize(('skipped', 'most'), [(0.0, 10), (1.0, 1)])
def test_a_round_passes_over_absent_tasks_but_the_one_it_starts_at(skipped, most):
    problem = selection_problem()
    a, routes, found = problem.arrays, empty_timed_routes(problem.arrays), set()
    start, w, rng = first_plan(problem, WarmState())[0], empty_round(problem.arrays), rng_state(1)
    absent = start.order == np.arange(len(start.order))
    for _ in range(200):
        set_order(a, routes, start.order)
        list_absent(a, routes, w)
        begin_round(routes, w)
        ruin_strings(a, routes, w, 10.0, 10, skipped, rng)
        found.add(int(absent[w.removed[:w.counts[REMOVED]]].sum()))
    assert max(found) == most


def test_a_round_inserts_by_value_and_chance():
    problem = selection_problem()
    a, routes = problem.arrays, empty_timed_routes(problem.arrays)
    start, w, rng = first_plan(problem, WarmState())[0], empty_round(a), rng_state(1)
    ratios = set()
    for _ in range(20):
        set_order(a, routes, start.order)
        list_absent(a, routes, w)
        begin_round(routes, w)
        ruin_strings(a, routes, w, 10.0, 10, 0.0, rng)
        insert_removed(a, routes, w, 1.0, 1.0, 0.01, math.inf, rng)
        keys = w.order[:w.counts[REMOVED]]
        assert (np.diff(keys) >= 0.0).all()
        ratios |= set((-keys / a.unserved[w.removed[:keys.size] - a.uavs]).tolist())
    assert 0.5 <= min(ratios) < 0.7
    assert 1.3 < max(ratios) < 1.5


def test_leaving_a_task_out_costs_much_more_than_serving_tasks_in_clusters():
    corners = [(x, y) for x in (-1e3, 1e3) for y in (-1e3, 1e3)]
    work = [Task(f't{x:g} {y:g} {i}', (x + i % 5, y + i // 5, 0.0), value=1.0 + i % 3,
                 latest=300.0, service_time=120.0) for x, y in corners for i in range(20)]
    fleet = [Uav('u', (0.0, 0.0, 0.0)), Uav('v', (0.0, 0.0, 0.0))]
    problem = make_timed(make_problem(fleet, work, {}, Limits(), Rules()), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, SELECTION)
    before = colony.arrays.unserved.copy()
    values = np.array([task.value for task in work])
    colony.fly(0.0, 0.2, 200)
    assert colony.arrays.unserved == pytest.approx(before)
    cost, worth, *_ = colony.best.score.copy()
    colony.fly(0.85, 0.9, 0)
    most = np.maximum(before, 10.0 * cost / worth * values)
    assert most.max() > 1.5 * before.max()
    assert colony.arrays.unserved == pytest.approx(most)
    rise = most.sum() / before.sum()
    assert colony._temperature(0.85) == pytest.approx(rise * 10.0 * problem.scale)


def windows_problem():
    """UAVs of several speeds, and tasks at two heights of which many have no room in a window."""
    r = random.Random(16)

    def point():
        return r.uniform(0.0, 2000.0), r.uniform(0.0, 2000.0), r.choice((0.0, 40.0))

    fleet = [Uav(f'u{i}', (0.0, 0.0, 0.0), cruise_speed=speed, climb_speed=2.5, descent_speed=1.5)
             for i, speed in enumerate((8.0, 10.0, 15.0))]
    opens = [r.uniform(0.0, 500.0) for _ in range(60)]
    work = [Task(f't{i}', point(), earliest=t, latest=t + r.choice((30.0, 150.0, 600.0)),
                 service_time=5.0, value=r.choice((1.0, 4.0))) for i, t in enumerate(opens)]
    return fleet, work


@pytest.mark.parametrize('unserved', [math.inf, 2000.0])
@pytest.mark.parametrize('priced', [True, False])
def test_no_neighbour_is_passed_over_at_which_a_place_costs_less(unserved, priced):
    fleet, work = windows_problem()
    rules = Rules(returns=True, objective=Objective(unserved=unserved))
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3,
                         replace(COLD, by_gaps=True))
    if priced:
        colony._allow_excess()
    colony.fly(0.0, 0.01, 500)
    a, routes, w, rng = colony.arrays, colony.routes, empty_round(colony.arrays), rng_state(1)
    tried = 0
    for _ in range(60):
        begin_round(routes, w)
        ruin_strings(a, routes, w, 10.0, 10, 0.0, rng)
        for t in map(int, w.removed[:w.counts[REMOVED]]):
            row = a.near[t - a.uavs, :a.near_count[t - a.uavs]].tolist()
            for k, c in enumerate(row):
                for cost in costs_beside(a, routes, t, c, row[:k]):
                    tried += 1
                    least = cost + 1e-6 * max(1.0, abs(cost))
                    assert _within_reach(a, routes, t, 2 * k, least) == 2 * k
        insert_removed(a, routes, w, 1.0, 0.0, 0.0, math.inf, rng)
    assert tried > 300


def costs_beside(a, routes, t, c, nearer):
    """Costs of both places beside task c, but for those beside a nearer task too."""
    u = int(routes.link[c, at.OF_UAV])
    if u < a.uavs and not (routes.route[u, :at.METRES] > 1e-6).any():  # without excess
        then, before = (int(routes.link[c, side]) for side in (at.NEXT, at.PREV))
        for place, other in ((c, then), (before, before)):
            cost = cost_at(a, routes, LINK(u), LINK(t), LINK(place))
            if other not in nearer and cost < math.inf:
                yield cost
