# SPDX-License-Identifier: Apache-2.0
"""The evaluator names the faults of routes, and measures their length and value."""
import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, ThreatZone, Uav
from uav_task_alloc.study.evaluator import evaluate
from uav_task_alloc.study.instances import Instance

UAVS = (Uav('a', (0.0, 0.0, 0.0), 10.0), Uav('b', (0.0, 0.0, 0.0), 20.0, home=(3.0, 0.0, 0.0)))
TASKS = (Task('near', (3.0, 4.0, 0.0), value=2.0), Task('far', (0.0, 12.0, 5.0), value=5.0))
OPEN = Instance('open', UAVS, TASKS)
HOME = Instance('home', UAVS, TASKS, route_end='home', collects=True)


def test_open_routes_end_at_their_last_task():
    result = evaluate(OPEN, {'a': ['near'], 'b': ['far']})
    assert (result.length, result.value, result.missing, result.faults) == (5.0 + 13.0, 7.0, 0, ())
    assert result.is_valid(collects=False)


def test_returning_routes_end_at_home_and_an_idle_uav_flies_nothing():
    result = evaluate(HOME, {'a': [], 'b': ['near']})
    assert (result.length, result.value, result.missing) == (5.0 + 4.0, 2.0, 1)
    assert result.is_valid(collects=True)
    assert not result.is_valid(collects=False)


@pytest.mark.parametrize(('routes', 'fault'), [
    ({'a': ['far']}, 'a flies 13 m, its range is 10 m'),
    ({'a': ['near'], 'b': ['near']}, 'b serves near, which a serves'),
    ({'b': ['near', 'near']}, 'b serves near, which b serves'),
    ({'b': ['gone']}, 'b serves gone, which is no task'),
    ({'c': ['near']}, 'c is no UAV'),
])
def test_a_fault_is_named_and_the_routes_are_invalid(routes, fault):
    result = evaluate(OPEN, routes)
    assert result.faults == (fault,)
    assert not result.is_valid(collects=True)


def test_zones_are_refused():
    zone = ThreatZone.hemisphere('z', (9.0, 9.0, 0.0), 1.0)
    with pytest.raises(InvalidValue, match='expected none: legs are straight here'):
        evaluate(Instance('zones', UAVS, TASKS, (zone,)), {})
