# SPDX-License-Identifier: Apache-2.0
"""The history of problems with time is that of the fit, whatever is minimised."""
import math
import random

import pytest

from uav_task_alloc.model import Task, Uav
from uav_task_alloc.objective import OBJECTIVES, fit
from uav_task_alloc.solver.solve import plan


def timed_problem(seed, ranges):
    """Two UAVs, twelve tasks of which one has a way; deadlines, so that times matter."""
    r = random.Random(seed)
    fleet = [Uav(f'u{i}', (r.uniform(-500.0, 500.0), 0.0, 50.0), range=r.choice(ranges),
                 endurance=r.choice((150.0, math.inf)), home=(0.0, 0.0, 0.0)) for i in range(2)]
    work = [Task(f't{i}', (r.uniform(-500.0, 500.0), r.uniform(-500.0, 500.0), 50.0),
                 value=r.uniform(0.5, 9.0), latest=r.choice((90.0, math.inf))) for i in range(11)]
    way = ((0.0, 100.0, 50.0), (200.0, 100.0, 50.0))
    return fleet, [*work, Task('way', way[0], path=way)]


@pytest.mark.parametrize('objective', list(OBJECTIVES))
@pytest.mark.parametrize('route_end', ['hold', 'home'])
@pytest.mark.parametrize('locked', [{}, {'u0': ['t0', 'way'], 'u1': ['t1']}])
def test_the_history_ends_with_the_fit_of_the_plan(objective, route_end, locked):
    for seed, hard_range, ranges in ((1, True, (math.inf,)), (2, False, (100.0, 900.0)),
                                     (3, True, (50.0, 1500.0))):
        fits = []
        found = plan(*timed_problem(seed, ranges), objective=objective, route_end=route_end,
                     locked=locked, hard_range=hard_range, max_iterations=200, budget=60.0,
                     on_iteration=lambda _, best, fits=fits: fits.append(best))
        assert found.fit == fit(found.distance, found.value, found.penalty)
        assert found.history[-1][1] == pytest.approx(found.fit, rel=1e-9)
        assert set(fits) <= {each for _, each in found.history}
        assert [*found.history] == sorted(found.history, key=lambda each: each[0])


def test_the_history_begins_with_an_infinite_fit_where_nothing_can_be_served():
    found = plan([Uav('u', (0.0, 0.0, 0.0), endurance=1.0)], [Task('t', (500.0, 0.0, 0.0))])
    assert [each for _, each in found.history] == [math.inf] == [found.fit]


@pytest.mark.parametrize('hard_range', [True, False])
@pytest.mark.parametrize('route_end', ['hold', 'home'])
def test_what_a_uav_lacks_before_its_first_task_counts_only_where_it_has_tasks(
        hard_range, route_end):
    late = Uav('late', (900.0, 0.0, 50.0), home=(0.0, 900.0, 0.0), endurance=10.0,
               available_from=40.0)  # in the air: it would wait there for longer than it can
    task, far = Task('t', (50.0, 0.0, 50.0)), Task('far', (905.0, 0.0, 50.0))
    options = {'objective': 'balanced', 'route_end': route_end, 'max_iterations': 50,
               'budget': 60.0, 'trips': 2}
    found = plan([Uav('u', (0.0, 0.0, 50.0)), late], [task, far], hard_range=hard_range, **options)
    if hard_range:
        assert (found.routes['late'], found.penalty) == ((), 0.0)
    assert found.history[-1][1] == pytest.approx(found.fit, rel=1e-9)
    for locked in ({}, {'late': ['far']}):
        alone = plan([late], [far, task], hard_range=False, locked=locked, **options)
        assert alone.penalty >= 30.0 * late.cruise_speed
        assert alone.history[-1][1] == pytest.approx(alone.fit, rel=1e-9)
