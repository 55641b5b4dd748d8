# SPDX-License-Identifier: Apache-2.0
"""Reasons of tasks that no safe way leads to, or home from, of many tasks and UAVs."""
from collections import Counter

import pytest

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.geometry.distances import Distances

UAVS, TASKS = 60, 25
WALLS = [ThreatZone.polygon(f'wall {k}', corners) for k, corners in enumerate((
    ((-100.0, -100.0), (100.0, -100.0), (100.0, -90.0), (-100.0, -90.0)),
    ((-100.0, 90.0), (100.0, 90.0), (100.0, 100.0), (-100.0, 100.0)),
    ((-100.0, -100.0), (-90.0, -100.0), (-90.0, 100.0), (-100.0, 100.0)),
    ((90.0, -100.0), (100.0, -100.0), (100.0, 100.0), (90.0, 100.0))))]
DOME = ThreatZone.hemisphere('dome', (0.0, 0.0, -1.0), 30.0)


def world(home, inside):
    """UAVs outside of the walls; tasks inside of them, or outside."""
    uavs = [Uav(f'u{k}', (-200.0 - k, 3.0 * k, 20.0), home=home) for k in range(UAVS)]
    tasks = [Task(f't{k}', ((-60.0 if inside else -150.0) + k, 60.0, 20.0))
             for k in range(TASKS)]
    return uavs, tasks


@pytest.mark.parametrize('objective', ['distance', 'finish'])
@pytest.mark.parametrize(('home', 'inside', 'zones', 'reason'), [
    (None, True, WALLS, 'unreachable: no safe path past the zones'),
    ((0.0, 60.0, 20.0), False, WALLS, 'no safe path home'),
    ((0.0, 0.0, 0.0), False, [DOME],
     '; '.join(['no safe path home', *(f'home of u{k} is inside zone dome'
                                       for k in range(UAVS))]))],
    ids=['no path', 'no path home', 'homes in a zone'])
def test_reasons_of_many_uavs_ask_for_no_pair_of_a_uav_and_a_task_in_python(
        monkeypatch, objective, home, inside, zones, reason):
    uavs, tasks = world(home, inside)
    options = {'objective': objective, 'route_end': 'home', 'max_iterations': 0, 'budget': 1e3}
    assert set(plan(uavs, tasks, zones, **options).unassigned.values()) == {reason}
    calls: Counter[str] = Counter()

    def counting(name, method):
        def counted(*args, **options):
            calls[name] += 1
            return method(*args, **options)
        return counted

    for name, method in list(vars(Distances).items()):
        if callable(method) and not name.startswith('_'):
            monkeypatch.setattr(Distances, name, counting(name, method))
    assert len(plan(uavs, tasks, zones, **options).unassigned) == TASKS
    assert calls.total() < 10 * (UAVS + TASKS) < UAVS * TASKS


def test_a_task_without_a_way_in_the_time_is_searched_for_again():
    uavs, tasks = world(None, inside=True)
    found = plan(uavs, tasks, WALLS, budget=0.1, max_iterations=0, clock=iter(range(999)).__next__)
    assert set(found.unassigned.values()) == {
        'no safe path past the zones found in the time; searched for again with the next plan'}
