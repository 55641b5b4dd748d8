# SPDX-License-Identifier: Apache-2.0
"""Routes rebuilt by labels: the best one of one UAV, beside those of the others."""
import random
from itertools import permutations

import pytest

from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.colony import SELECTION
from uav_task_alloc.solver.timed.evaluator import evaluate_routes
from uav_task_alloc.solver.timed.labels import AT_NODE, BEFORE, best_label, empty_labels
from uav_task_alloc.solver.timed.order import set_order
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.rebuild import rebuild
from uav_task_alloc.solver.timed.search import BEST_WORTH, copy_incumbent, empty_incumbent
from uav_task_alloc.solver.timed.solve import solve_timed
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState


def problem_of(seed, tasks, uavs=1, rules=None, zones=()):
    """Random tasks with windows, loads and values, more than can be served."""
    rng = random.Random(seed)
    fleet = [Uav(f'u{i}', (rng.uniform(0.0, 100.0), 50.0, 0.0), range=rng.choice([150.0, 1e4]),
                 cruise_speed=10.0, turnaround=1.0, available_until=rng.choice([25.0, 40.0]),
                 payload_capacity=rng.choice([3.0, 99.0])) for i in range(uavs)]
    work = []
    for i in range(tasks):
        opens = rng.uniform(0.0, 25.0)
        work.append(Task(f't{i}', (rng.uniform(0.0, 100.0), rng.uniform(0.0, 100.0), 0.0),
                         value=1.0 + i % 3, service_time=rng.uniform(0.0, 2.0), earliest=opens,
                         latest=opens + rng.uniform(2.0, 10.0), payload=rng.choice([0.0, 1.0]),
                         allowed_uavs=frozenset({'u0'}) if i % 5 == 0 else None))
    rules = rules or Rules(returns=True)
    return make_timed(make_problem(fleet, work, {}, Limits(tuple(zones)), rules), {})


def route_of(room, label):
    """Task nodes of the route that ends at a label."""
    nodes = []
    while label > 0:
        nodes.append(int(room.link[label, AT_NODE]))
        label = int(room.link[label, BEFORE])
    return nodes[::-1]


def earned(problem, routes, u, nodes):
    """Price of the tasks less the way of a route of UAV u; None: it is not allowed."""
    a = problem.arrays
    order = empty_incumbent(a).order
    for before, after in zip([u, *nodes], [*nodes, a.ends + u], strict=True):
        order[before] = after
    set_order(a, routes, order)
    if routes.counts[at.INFEASIBLE]:
        return None
    return (sum(a.unserved[t - a.uavs] for t in nodes)
            - a.weight[at.BY_DISTANCE] * routes.route[u, at.METRES])


@pytest.mark.parametrize('seed', range(12))
@pytest.mark.parametrize('returns', [True, False])
def test_the_best_of_all_routes_is_found_where_all_tasks_are_near(seed, returns):
    problem = problem_of(seed, 6, rules=Rules(returns=returns))
    a, routes, room = problem.arrays, empty_timed_routes(problem.arrays), empty_labels(6, 200)
    label = best_label(a, routes, 0, room, 40.0, 0.0)
    found = route_of(room, label)
    best = max(filter(None, (earned(problem, routes, 0, list(nodes)) for count in range(1, 7)
                             for nodes in permutations(range(a.uavs, a.ends), count))))
    assert earned(problem, routes, 0, found) == pytest.approx(best)
    assert found


@pytest.mark.parametrize('seed', range(6))
@pytest.mark.parametrize('zones', [(), (ThreatZone.cylinder('z', (50.0, 60.0), 20.0),)])
def test_a_route_of_few_kept_labels_is_allowed_and_has_no_task_of_others(seed, zones):
    problem = problem_of(seed, 60, uavs=2, zones=zones)
    a, routes = problem.arrays, empty_timed_routes(problem.arrays)
    first = first_plan(problem, WarmState())[0]
    set_order(a, routes, first.order)
    others = {t for t in range(a.uavs, a.ends) if routes.link[t, at.OF_UAV] == 0}
    room = empty_labels(60, 5)
    found = route_of(room, best_label(a, routes, 1, room, 40.0, 1.0))
    assert others.isdisjoint(found)
    assert len(set(found)) == len(found)
    assert all(a.compatible[0, 1, t - a.uavs] for t in found)
    assert earned(problem, routes, 1, found) is not None


def test_labels_reach_the_end_of_the_time_though_there_is_little_room():
    rng = random.Random(4)
    work = [Task(f't{i}', (rng.uniform(0.0, 100.0), rng.uniform(0.0, 100.0), 0.0), latest=100.0)
            for i in range(150)]
    fleet = [Uav('u', (50.0, 50.0, 0.0), cruise_speed=5.0, available_until=100.0)]
    problem = make_timed(make_problem(fleet, work, {}, Limits(), Rules(returns=True)), {})
    a, routes, room = problem.arrays, empty_timed_routes(problem.arrays), empty_labels(150, 5)
    room = room._replace(link=room.link[:1500], value=room.value[:1500],
                         visited=room.visited[:1500])
    found = route_of(room, best_label(a, routes, 0, room, 100.0, 0.5 * a.unserved.mean()))
    assert earned(problem, routes, 0, found) is not None
    assert routes.row[a.ends, at.START] > 90.0


@pytest.mark.parametrize('uavs', [1, 2])
def test_rebuilt_routes_serve_more_and_are_those_set(uavs):
    gained = 0.0
    for seed in range(6):
        problem = problem_of(seed, 80, uavs)
        routes, best = empty_timed_routes(problem.arrays), first_plan(problem, WarmState())[0]
        before = float(best.score[BEST_WORTH])
        rebuild(problem.arrays, routes, best, False, 1e9)
        assert best.score[BEST_WORTH] >= before
        assert routes.sums[at.SERVED_WORTH] == best.score[BEST_WORTH]
        assert routes.counts[at.INFEASIBLE] == 0
        gained += float(best.score[BEST_WORTH]) - before
    assert gained > 0.0


HOME = Rules(returns=True)


@pytest.mark.parametrize(('uavs', 'most', 'rules'), [
    (3, 1e9, HOME), (1, 100.0, HOME),
    (1, 1e9, Rules(returns=True, objective=Objective(response=1.0))),
    (1, 1e9, Rules(returns=True, trips=2))])
def test_routes_stay_where_labels_do_not_pay_or_do_not_hold(uavs, most, rules):
    problem = problem_of(3, 80, uavs, rules)
    best = first_plan(problem, WarmState())[0]
    before = copy_incumbent(best)
    rebuild(problem.arrays, empty_timed_routes(problem.arrays), best, False, most)
    assert (best.order == before.order).all()


def test_a_plan_by_labels_is_valid_and_serves_no_less():
    problem = problem_of(5, 80, 2)
    base = problem.base
    found = solve_timed(base.uavs, base.tasks, {}, base.limits, base.rules, max_iterations=3000,
                        params=SELECTION)
    trips = {uav: [list(route)] for uav, route in found.routes.items()}
    assert not evaluate_routes(base.uavs, base.tasks, base.rules, trips).violations
    assert found.value > float(first_plan(problem, WarmState())[0].score[BEST_WORTH])
