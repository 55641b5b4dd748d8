# SPDX-License-Identifier: Apache-2.0
"""The search with time: its sums are true, its plans valid, its answers repeatable."""
import math
import random
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.objective import OBJECTIVES, Objective
from uav_task_alloc.solver.problem import Limits, Rules, make_problem
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.solver.timed import columns as at
from uav_task_alloc.solver.timed.arrays import LINK
from uav_task_alloc.solver.timed.colony import COLD, TimedColony
from uav_task_alloc.solver.timed.insertion import near_place, unlink
from uav_task_alloc.solver.timed.order import route_order, set_order
from uav_task_alloc.solver.timed.places import cost_at
from uav_task_alloc.solver.timed.problem import empty_timed_routes, make_timed
from uav_task_alloc.solver.timed.recorder import TimedRecorder
from uav_task_alloc.solver.timed.round import (
    REMOVED,
    begin_round,
    empty_round,
    save_route,
    take_back,
)
from uav_task_alloc.solver.timed.route_sums import cost_of
from uav_task_alloc.solver.timed.ruin import insert_removed, ruin_strings
from uav_task_alloc.solver.timed.search import BEST_COST
from uav_task_alloc.solver.timed.segments import update
from uav_task_alloc.solver.timed.warm import first_plan
from uav_task_alloc.solver.warm import WarmState
from uav_task_alloc.study.small_problems import compare_small, small_problem

MIXED = Objective(distance=0.1, finish=1.0, response=1.0, lateness=3.0, unserved=80.0)


def mixed_problem(seed, uavs=4, tasks=40):
    """UAVs on the ground and in the air, and tasks with windows, releases and loads."""
    r = random.Random(seed)

    def point():
        return r.uniform(0.0, 2000.0), r.uniform(0.0, 2000.0), r.choice((0.0, 40.0))

    fleet = []
    for i in range(uavs):
        home = point()
        fleet.append(Uav(
            f'u{i}', home if i % 2 == 0 else point(), home=home, range=r.choice((4000.0, 9000.0)),
            endurance=r.choice((math.inf, 500.0)), climb_speed=2.5, descent_speed=1.5,
            turnaround=30.0, payload_capacity=3.0, available_until=r.choice((math.inf, 1500.0))))
    work = []
    for i in range(tasks):
        opens = r.choice((-math.inf, 50.0, 300.0))
        work.append(Task(
            f't{i}', point(), value=r.choice((1.0, 4.0)), earliest=opens, service_time=5.0,
            latest=r.choice((math.inf, max(opens, 0.0) + 200.0)), release=r.choice((0.0, 100.0)),
            payload=r.choice((0.0, 0.0, 1.0))))
    return fleet, work


@pytest.mark.parametrize('objective', [*OBJECTIVES.values(), MIXED], ids=[*OBJECTIVES, 'mixed'])
@pytest.mark.parametrize('trips', [1, 3])
def test_sums_kept_during_search_are_those_of_routes_set_at_once(objective, trips):
    fleet, work = mixed_problem(trips)
    rules = Rules(returns=True, objective=objective, trips=trips)
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, COLD)
    colony.fly(0.0, 0.5, 2000)
    order = np.zeros(len(problem.arrays.fixed), LINK)
    route_order(colony.arrays, colony.routes, order)
    fresh = empty_timed_routes(colony.arrays)
    set_order(colony.arrays, fresh, order)
    assert fresh.sums == pytest.approx(colony.routes.sums, abs=1e-6)
    assert fresh.counts.tolist() == colony.routes.counts.tolist()
    assert fresh.empty.tolist() == colony.routes.empty.tolist()
    used = colony.routes.link[:, at.OF_UAV] != problem.arrays.uavs
    for column in (at.START, at.LATEST, at.WARP_BEFORE, at.WARP_AFTER):
        assert fresh.row[used, column] == pytest.approx(colony.routes.row[used, column], abs=1e-6)


@pytest.mark.parametrize('objective', list(OBJECTIVES))
def test_cost_of_the_search_is_that_of_the_evaluator(objective, monkeypatch):
    made = []
    monkeypatch.setattr('uav_task_alloc.solver.timed.solve.TimedRecorder', lambda *args, **named: (
        made.append(TimedRecorder(*args, **named)) or made[-1]))
    fleet, work = mixed_problem(5)
    zones = [ThreatZone.hemisphere('dome', (1000.0, 1000.0, 0.0), 300.0),
             ThreatZone.cylinder('mast', (400.0, 500.0), 80.0)]
    inside = [task for task in work if math.dist(task.position, (1000.0, 1000.0, 0.0)) < 301.0
              or math.dist(task.position[:2], (400.0, 500.0)) < 81.0]
    found = plan(fleet, [task for task in work if task not in inside], zones, budget=60.0,
                 objective=objective, trips=2, route_end='home', max_iterations=300)
    assert made[-1].best.score[BEST_COST] == pytest.approx(found.cost, rel=1e-9)


def test_a_way_out_of_a_zone_that_goes_on_straight_takes_the_time_of_its_length():
    dome = ThreatZone.hemisphere('dome', (0.0, 0.0, 0.0), 100.0)
    for position in ((500.0, 0.0, 20.0), (500.0, 0.0, 300.0)):  # around it, and straight
        found = plan([Uav('u', (0.0, 0.0, 20.0))], [Task('t', position, latest=400.0)], [dome],
                     budget=60.0, max_iterations=10)
        assert found.routes == {'u': ('t',)}


def test_the_same_seed_and_iterations_give_the_same_plan():
    fleet, work = mixed_problem(7)
    one, two = (plan(fleet, work, budget=60.0, objective='balanced', trips=2, seed=4,
                     max_iterations=400) for _ in range(2))
    assert one.routes == two.routes
    assert one.cost == two.cost


def test_stop_ends_the_solve_with_a_valid_plan():
    fleet, work = mixed_problem(8)
    found = plan(fleet, work, budget=600.0, objective='response', stop=lambda: True)
    assert found.iterations == 0
    assert found.value > 0.0


def test_two_threads_find_a_plan_not_worse_than_the_first_one():
    fleet, work = mixed_problem(9)
    first = plan(fleet, work, budget=0.0, objective=MIXED)
    found = plan(fleet, work, budget=60.0, objective=MIXED, threads=2, max_iterations=400)
    assert found.cost <= first.cost


def test_solvers_without_time_refuse_windows_by_name():
    with pytest.raises(InvalidValue, match="solver = 'ga': expected 'chain_q' where latest"):
        plan([Uav('u', (0.0, 0.0, 0.0))], [Task('t', (9.0, 0.0, 0.0), latest=5.0)], solver='ga')


def test_the_finish_is_earlier_with_the_objective_finish():
    fleet = [Uav(f'u{i}', (0.0, float(i), 0.0)) for i in range(3)]
    work = [Task(f't{i}', (100.0 * (1 + i), 0.0, 0.0), service_time=60.0) for i in range(6)]
    short, early = (plan(fleet, work, budget=60.0, objective=goal, max_iterations=300)
                    for goal in (Objective(), 'finish'))
    assert sum(bool(row) for row in short.routes.values()) == 1
    assert early.finish < 0.6 * short.finish


def test_a_later_departure_that_delays_locked_tasks_is_not_worse_than_the_first_plan():
    problem = small_problem(10440)  # a locked task, an endurance that binds, mean response
    result = compare_small(problem, rounds=300)
    assert result is not None
    assert result.faults == ()


def test_a_long_search_passes_through_excess_and_its_best_has_none():
    fleet, work = mixed_problem(11)
    problem = make_timed(make_problem(fleet, work, {}, Limits(), Rules(returns=True)), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, COLD)
    excess, scores = set(), []
    for share in np.arange(0.0, 0.6, 0.01):
        colony.fly(share, share + 0.01, 100)
        excess.add(bool(colony.routes.counts[at.INFEASIBLE] > 0))
        scores.append(colony.best.score.copy())
    fresh = empty_timed_routes(problem.arrays)
    set_order(problem.arrays, fresh, colony.best.order)
    assert excess == {True, False}
    assert fresh.counts[at.INFEASIBLE] == 0
    assert fresh.sums[at.SERVED_WORTH] == scores[-1][1] >= scores[0][1]


def test_of_two_tasks_the_one_announced_later_is_served_where_only_one_can_be():
    tasks = [Task('old', (100.0, 0.0, 0.0), latest=9.0, announced=-500.0),
             Task('new', (-80.0, 0.0, 0.0), latest=9.0, announced=-1.0),
             Task('far', (-81.0, 0.0, 0.0), latest=9.0, announced=-1.0, value=0.5)]
    goal = Objective(distance=1.0, response=1.0)
    result = plan([Uav('u', (10.0, 0.0, 0.0), cruise_speed=10.0, range=90.5)], tasks, seed=1,
                  objective=goal, max_iterations=300, budget=60.0)
    assert result.unassigned.keys() == {'old', 'far'}


def test_a_search_through_excess_that_finds_nothing_better_goes_on_without():
    fleet, work = mixed_problem(11)
    problem = make_timed(make_problem(fleet, work, {}, Limits(), Rules(returns=True)), {})
    start = first_plan(problem, WarmState())[0]
    colony = TimedColony(problem, start, 3, COLD)
    colony.best.score[:2] = -1.0, math.inf  # nothing is better
    for share in np.arange(0.0, 0.9, 0.01):
        colony.fly(share, share + 0.01, 200)
        allowed = bool(np.isfinite(colony.arrays.price).any())
        assert allowed == (0.02 <= share < 0.595), share
    assert colony.routes.counts[at.INFEASIBLE] == 0


def cheapest_place(a, routes, t):
    """The cost of the cheapest place of task t: in any route, in one without time warp."""
    least = timely = math.inf
    for u in range(a.uavs):
        c = u
        while c < a.ends:
            cost = cost_at(a, routes, LINK(u), t, LINK(c))
            least = min(least, cost)
            timely = timely if routes.route[u, at.WARP] > 0.0 else min(timely, cost)
            c = int(routes.link[c, at.NEXT])
    return least, timely


@pytest.mark.parametrize('returns', [True, False])
@pytest.mark.parametrize('grain', [0.0, 10.0])
@pytest.mark.parametrize('objective', ['distance', 'response'])
@pytest.mark.parametrize('priced', [True, False])
@pytest.mark.parametrize('whole', [True, False])
@pytest.mark.parametrize('gaps', [True, False])
def test_neighbours_passed_over_have_no_cheaper_place(
        returns, grain, objective, priced, whole, gaps):
    fleet, work = mixed_problem(12)
    if not whole:
        fleet = [replace(uav, endurance=math.inf) for uav in fleet]
        work = [replace(task, payload=0.0) for task in work]
    rules = Rules(returns=returns, grain=grain, objective=OBJECTIVES[objective])
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3,
                         replace(COLD, by_gaps=gaps))
    if priced:
        colony._allow_excess()
    colony.fly(0.0, 0.01, 500)
    a, routes, w, rng = colony.arrays, colony.routes, empty_round(colony.arrays), rng_state(1)
    found = []
    for _ in range(100):
        begin_round(routes, w)
        ruin_strings(a, routes, w, 10.0, 10, 0.0, rng)
        for t in w.removed[:w.counts[REMOVED]]:
            place, _, cost = near_place(a, routes, t, True, 0.0, math.inf, rng)
            found.append((cost if place >= 0 else math.inf, *cheapest_place(a, routes, t)))
        insert_removed(a, routes, w, 1.0, 0.0, 0.0, math.inf, rng)
    near, least, timely = map(np.array, zip(*found, strict=True))
    assert np.isfinite(near).sum() > 300
    assert (near >= least - 1e-6).all()
    assert (near <= timely + 1e-6).all()  # a place that ends time warp may be passed over


def gap(a, routes, i, j):
    """From the departure of node i to the latest start of node j, unless j is late already."""
    departure, latest = routes.row[i, at.DEPARTURE], routes.row[j, at.LATEST]
    arrival = max(departure, a.fixed[j, at.RELEASE]) + routes.row[i, at.TIME]
    return math.inf if arrival > latest else latest - departure


@pytest.mark.parametrize('whole', [True, False])
@pytest.mark.parametrize('gaps', [True, False])
def test_reach_and_gaps_kept_during_search_are_those_of_the_legs(whole, gaps):
    fleet, work = mixed_problem(13)
    if not whole:
        fleet = [replace(uav, endurance=math.inf) for uav in fleet]
        work = [replace(task, payload=0.0) for task in work]
    problem = make_timed(make_problem(fleet, work, {}, Limits(), Rules(returns=True)), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3,
                         replace(COLD, by_gaps=gaps))
    colony.fly(0.0, 0.5, 2000)
    a, routes = colony.arrays, colony.routes
    for t in range(a.uavs, a.ends):
        legs, times = [-math.inf] * 2, [-math.inf] * 2  # to tasks, to others
        if routes.link[t, at.OF_UAV] < a.uavs:
            for other, column in ((at.NEXT, at.LEG), (at.PREV, at.LEG_TO)):
                node = routes.link[t, other]
                kind = 0 if a.uavs <= node < a.ends else 1
                i, j = (t, node) if other == at.NEXT else (node, t)
                legs[kind] = max(legs[kind], routes.row[t, column])
                times[kind] = max(times[kind], gap(a, routes, i, j))
        assert routes.reach[t].tolist() == legs
        if a.gaps and routes.link[t, at.OF_UAV] < a.uavs:
            assert routes.gap[t].tolist() == times


@pytest.mark.parametrize('objective', ['distance', 'response', 'balanced'])
def test_a_round_that_is_given_up_would_not_have_cost_less_than_the_limit(objective):
    fleet, work = mixed_problem(14)
    rules = Rules(returns=True, objective=OBJECTIVES[objective])
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, COLD)
    colony.fly(0.0, 0.5, 500)
    a, routes, w, rng = colony.arrays, colony.routes, empty_round(colony.arrays), rng_state(1)
    given_up = 0
    for _ in range(200):
        before, chance, ends = cost_of(a, routes.sums), rng.copy(), []
        for limit in (before, math.inf):
            rng[:] = chance
            begin_round(routes, w)
            ruin_strings(a, routes, w, 10.0, 10, 0.0, rng)
            insert_removed(a, routes, w, 1.0, 0.0, 0.01, limit, rng)
            ends.append((int(routes.counts[at.SERVED]), cost_of(a, routes.sums)))
            if limit < math.inf or ends[-1][1] >= before:
                take_back(a, routes, w)
        given_up += ends[0] != ends[1]
        assert ends[0] == ends[1] or ends[1][1] >= before - 1e-6
    assert given_up > 50


@pytest.mark.parametrize('response', [0.0, 1.0])
def test_a_place_costs_what_it_adds_to_all_ends_that_are_nearly_the_last_one(response):
    r = random.Random(15)
    fleet = [Uav(f'u{i}', (r.uniform(0.0, 2000.0), 0.0, 0.0)) for i in range(4)]
    work = [Task(f't{i}', (r.uniform(0.0, 2000.0), r.uniform(0.0, 2000.0), 0.0),
                 service_time=5.0) for i in range(30)]
    rules = Rules(returns=True, objective=Objective(1e-3, 1.0, response))
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, COLD)
    colony.fly(0.0, 0.5, 300)
    a, routes, w, counted = colony.arrays, colony.routes, empty_round(colony.arrays), 0
    ends = routes.route[:, at.END]
    a.weight[at.FINISH_FROM] = 0.8 * np.sort(ends)[1]
    set_order(a, routes, colony.best.order)
    for t in range(a.uavs, a.ends):
        u, full = routes.link[t, at.OF_UAV], cost_of(a, routes.sums) + a.unserved[t - a.uavs]
        before = routes.link[t, at.PREV]
        then, tasks = routes.link[t, at.NEXT], routes.route[u, at.TASKS]
        begin_round(routes, w)
        save_route(a, routes, w, u)
        unlink(a, routes, LINK(t))
        update(a, routes, u, before, then, tasks)
        less = cost_of(a, routes.sums)
        assert cost_at(a, routes, u, LINK(t), before) == pytest.approx(full - less, abs=1e-6)
        take_back(a, routes, w)
        last = routes.sums[at.FINISH]
        assert routes.sums[at.BEYOND] == pytest.approx(
            sum(max(0.0, end - a.weight[at.FINISH_FROM]) for end in ends))
        counted += last > a.weight[at.FINISH_FROM] and ends[u] < last - 1.0 and (
            ends[u] > a.weight[at.FINISH_FROM])
    assert counted >= 5  # on routes that count though they are not the last


@pytest.mark.parametrize(('prices', 'hard', 'count'), [
    ({}, True, True), ({'unserved': 6.0}, True, False), ({'lateness': 0.2}, True, False),
    ({}, False, False)])
def test_all_ends_count_unless_something_else_has_a_price(prices, hard, count):
    fleet, work = mixed_problem(16)
    rules = Rules(hard=hard, objective=Objective(1e-3, 1.0, **prices))
    problem = make_timed(make_problem(fleet, work, {}, Limits(), rules), {})
    colony = TimedColony(problem, first_plan(problem, WarmState())[0], 3, COLD)
    colony.fly(0.0, 0.5, 10)
    assert (colony.arrays.weight[at.FINISH_FROM] < math.inf) == count


@pytest.mark.parametrize('seed', range(6))
def test_a_search_ends_where_leaving_out_old_tasks_costs_less_than_nothing(seed):
    r = random.Random(seed)
    fleet = [Uav(f'u{i}', (r.uniform(0.0, 1000.0), r.uniform(0.0, 1000.0), 0.0))
             for i in range(2)]
    work = [Task(f't{i}', (r.uniform(0.0, 1000.0), r.uniform(0.0, 1000.0), 0.0),
                 value=r.choice([1.0, 2.0]), announced=r.choice([0.0, -100.0, -400.0]))
            for i in range(6)]
    goal = Objective(0.05, 0.0, 1.0, unserved=40.0)
    built, found = (plan(fleet, work, budget=60.0, max_iterations=rounds, objective=goal)
                    for rounds in (0, 600))
    assert found.cost <= built.cost + 1e-9


def test_a_search_ends_where_locked_tasks_end_after_the_time_of_their_uav():
    fleet = [Uav('u', (0.0, 0.0, 0.0), available_until=10.0), Uav('v', (0.0, 9.0, 0.0))]
    work = [Task('a', (1000.0, 0.0, 0.0)), Task('b', (500.0, 0.0, 0.0))]
    found = plan(fleet, work, locked={'u': ('a',)}, budget=60.0, max_iterations=100)
    assert found.routes['u'][0] == 'a'


def test_temperatures_follow_the_price_of_lateness_where_nothing_else_counts():
    fleet, work = mixed_problem(15)
    scales = []
    for lateness in (2.0, 4.0):
        only = Objective(distance=0.0, finish=0.0, response=0.0, lateness=lateness)
        rules = Rules(objective=only)
        scales.append(make_timed(make_problem(fleet, work, {}, Limits(), rules), {}).scale)
    assert scales[0] > 1.0  # at 15 m/s the nearest tasks are some seconds away
    assert scales[1] == pytest.approx(2.0 * scales[0])


@pytest.mark.parametrize('seed', range(12))
def test_tasks_of_little_value_are_flown_in_the_best_order(seed):
    rng = random.Random(seed)
    uav, *tasks = (
        make(name, (rng.uniform(-1e3, 1e3), rng.uniform(-1e3, 1e3), 30.0)) for make, name in [
            (Uav, 'u'), (Task, 't0'), (Task, 't1'), (Task, 't2'), (Task, 'other')])
    tasks = [replace(tasks[0], value=100.0), *tasks[1:3],
             replace(tasks[3], value=100.0, required_capabilities={'camera'})]
    rules = {'objective': 'balanced', 'route_end': 'home', 'budget': 60.0}
    best = min(plan([uav], tasks, locked={'u': order}, max_iterations=0, **rules).cost
               for order in permutations(('t0', 't1', 't2')))
    assert plan([uav], tasks, max_iterations=500, **rules).cost == pytest.approx(best)
