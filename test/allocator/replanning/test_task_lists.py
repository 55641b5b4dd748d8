# SPDX-License-Identifier: Apache-2.0
"""Task lists from routes, with fake paths: kept legs, unreachable tasks, the end of a list."""
import math

import pytest

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.replanning.task_lists import build_task_list, planned_legs
from uav_task_alloc.model import Leg, Plan, Task, Uav

UAV = Uav('a', (0.0, 0.0, 50.0), range=1e6, cruise_speed=10.0, home=(0.0, 0.0, 50.0))
TASKS = [Task('t1', (100.0, 0.0, 50.0), service_time=5.0), Task('t2', (200.0, 0.0, 50.0))]


class FakePaths:
    """Straight legs, but none to the points of `closed`; polylines through `cut` are not clear."""

    margin = 0.1

    def __init__(self, closed=(), cut=()):
        self.closed, self.cut = set(closed), set(cut)

    def leg(self, a, b):
        return None if b in self.closed else Leg((), math.dist(a, b))

    def clear(self, *points):
        return not self.cut & set(points)

    leg_clear = clear

    def why_no_leg(self, a, b):
        return ''

    def rest(self, position, leg, goal, velocity=None):
        points = (position, *leg.via, goal)
        return sum(map(math.dist, points, points[1:])) if self.clear(*points) else None

    rest_of_leg = rest


def build(paths, returns=False, published=None, legs=None):
    return build_task_list(UAV, TASKS, returns, legs or {}, published or UavList('a', 0), paths)


def test_arrivals_count_flight_and_service():
    new, unreachable = build(FakePaths())
    assert [stop.eta for stop in new.stops] == [10.0, 25.0]
    assert (new.distance, new.returns, unreachable) == (200.0, False, {})


def test_a_task_that_no_path_leads_to_is_left_out():
    new, unreachable = build(FakePaths(closed=[TASKS[0].position]))
    assert (new.task_ids, unreachable, new.distance) == (
        ('t2',), {'t1': 'no safe path for a'}, 200.0)


@pytest.mark.parametrize(('closed', 'returns', 'distance'), [
    ([], True, 400.0), ([UAV.home], False, 200.0)])
def test_a_list_returns_home_where_a_path_leads_there(closed, returns, distance):
    new, _ = build(FakePaths(closed), returns=True)
    assert (new.returns, new.distance) == (returns, distance)


@pytest.mark.parametrize(('offset', 'kept'), [(0.1, True), (100.0, False)])
def test_a_published_leg_is_kept_unless_another_is_shorter_by_the_margin(offset, kept):
    via = (50.0, offset, 50.0)
    plan = Plan({'a': ('t1', 't2')}, legs={'a': (Leg((via,), 0.0), Leg((), 100.0))})
    published, _ = build(FakePaths(), legs=planned_legs(plan))
    assert published.stops[0].leg.via == (via,)
    new, _ = build(FakePaths(), published=published)
    assert (new.stops[0].leg.via == (via,)) == kept


def test_a_published_leg_that_is_cut_is_replaced():
    via = (50.0, 0.1, 50.0)
    plan = Plan({'a': ('t1', 't2')}, legs={'a': (Leg((via,), 0.0), Leg((), 100.0))})
    published, _ = build(FakePaths(), legs=planned_legs(plan))
    new, _ = build(FakePaths(cut=[via]), published=published)
    assert new.stops[0].leg.via == ()


@pytest.mark.parametrize(('detour', 'kept'), [(10.0, True), (40.0, False)])
def test_a_leg_under_way_is_kept_unless_the_uav_would_turn_back(detour, kept):
    via = ((-detour, 0.0, UAV.position[2]),)
    published = UavList('a', 1, stops=(ListStop(TASKS[0], Leg(via, 0.0), 0.0),))
    new, _ = build_task_list(UAV, TASKS[:1], False, {}, published, FakePaths(), keep=True)
    assert new.stops[0].leg.via == (via if kept else ())
