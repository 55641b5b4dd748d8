# SPDX-License-Identifier: Apache-2.0
"""The `fence_area` of a scenario: read, written, planned in, passed on to the nodes."""
import pytest

from uav_task_alloc import plan, scenario
from uav_task_alloc.cli.plan_pieces import with_pieces
from uav_task_alloc.errors import ScenarioError
from uav_task_alloc.geometry.fence_area import area_corners
from uav_task_alloc.geometry.polygon import contains_point

TEXT = """
uavs: [{id: uav_1, position: [100, 100, 0]}]
tasks: [{id: in, position: [700, 500, 50]}, {id: out, position: [700, 900, 50]}]
fence_area: [[0, 0], [0, 600], [800, 600], {latitude: 47.397742, longitude: 8.556193}]
"""


def test_an_area_is_read_counter_clockwise_and_written():
    played = scenario.parse(TEXT)
    assert [(round(x), round(y)) for x, y in played.fence_area] == [
        (800, 0), (800, 600), (0, 600), (0, 0)]
    assert scenario.parse(scenario.to_yaml(played)) == played
    assert scenario.parse(TEXT.partition('fence_area')[0]).fence_area == ()


def test_the_nodes_get_the_same_area():
    played = scenario.parse(TEXT)
    fleet = scenario.fleet_parameters(played)
    assert fleet['allocator']['fence_area'] == fleet['mavlink_bridge']['fence_area']
    found = area_corners(fleet['allocator']['fence_area'], played.origin)
    assert [tuple(round(v, 1) for v in corner) for corner in found] == [
        tuple(round(v, 1) for v in corner) for corner in played.fence_area]
    plain = scenario.fleet_parameters(scenario.parse(TEXT.partition('fence_area')[0]))
    assert 'fence_area' not in plain['allocator']


def test_a_plan_of_a_scenario_stays_inside():
    played = scenario.parse(TEXT)
    found = plan([uav.uav for uav in played.uavs], [timed.task for timed in played.tasks],
                 played.no_fly_zones(), budget=0.02)
    assert found.routes == {'uav_1': ('in',)}
    assert found.unassigned['out'].startswith('inside zone outside of fence_area')


def test_work_is_cut_at_the_border():
    played = with_pieces(scenario.parse(TEXT.replace(
        'tasks: [', 'tasks: [{id: l, kind: line, path: [[100, 300, 50], [2000, 300, 50]]}, ')))
    ends = [timed.task.end for timed in played.tasks if timed.task.path]
    assert [round(x) for x, _, _ in ends] == [790]  # the clearance is 10 m


def test_arrivals_are_inside():
    played = scenario.parse(TEXT + 'arrivals: {count: 60, between: [0, 9], area: [[-500, -500, '
                            '50], [1500, 1500, 50]]}\n')
    points = [timed.task.position[:2] for timed in played.tasks if timed.task.id.startswith('a')]
    assert len(points) == 60
    assert all(contains_point(played.fence_area, point) for point in points)


@pytest.mark.parametrize(('area', 'why'), [
    ('[[0, 0], [9, 0]]', 'expected a list of at least 3 corners'),
    ('[[0, 0], [9, 9], [9, 0], [0, 9]]', 'edges that do not cross'),
    (str([[k, k * k] for k in range(21)]), 'at most 20 corners')])
def test_an_area_that_is_none_is_refused_with_its_line(area, why):
    with pytest.raises(ScenarioError, match=f'scenario:4: .*fence_area.*{why}'):
        scenario.parse(TEXT.partition('fence_area')[0] + f'fence_area: {area}\n')
