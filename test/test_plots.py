# SPDX-License-Identifier: Apache-2.0
"""Maps are drawn for what can happen; what they look like is for eyes to judge."""
import json

import pytest

from uav_task_alloc import plots
from uav_task_alloc.model import Leg, Plan, Task, ThreatZone, Uav
from uav_task_alloc.record import heard, truth
from uav_task_alloc.record.heard import zone_to_json

ZONES = [ThreatZone.hemisphere('dome', (100.0, 100.0, 0.0), 30.0, margin=5.0),
         ThreatZone.polygon('field', [(200.0, 0.0), (260.0, 10.0), (230.0, 60.0)])]
PNG = b'\x89PNG'


@pytest.mark.parametrize('returns', [False, True])
def test_a_plan_is_drawn(tmp_path, returns):
    uavs = [Uav('u1', (0.0, 0.0, 0.0)), Uav('u2', (300.0, 0.0, 0.0))]
    tasks = [Task('a', (50.0, 90.0, 40.0)), Task('b', (220.0, 20.0, 40.0))]
    legs = (Leg(((10.0, 50.0, 20.0),), 120.0), *[Leg((), 100.0)] * returns)
    plan = Plan({'u1': ('a',), 'u2': ()}, {'b': 'inside zone field'}, 120.0, 1.0,
                legs={'u1': legs, 'u2': ()}, returns=returns)
    plots.draw_plan(uavs, tasks, ZONES, plan, tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


def test_a_plan_of_nothing_is_drawn(tmp_path):
    plots.draw_plan([], [], [], Plan({}), tmp_path / 'plan.png')
    assert (tmp_path / 'plan.png').read_bytes().startswith(PNG)


def write(path, *lines):
    path.write_text(''.join(json.dumps(line) + '\n' for line in lines))


def test_a_flight_with_a_late_zone_a_late_task_and_a_dead_uav_is_drawn(tmp_path):
    def add(wall, name, *place):
        return {'wall': wall, 'kind': 'announcement', 'action': 'ADD',
                'tasks': [{'id': name, 'position': place}]}
    write(tmp_path / heard.FILE,
          add(1.0, 'a', 50.0, 90.0, 40.0), add(2.0, 'b', 10.0, 20.0, 30.0),
          {'wall': 1.0, 'kind': 'zones', 'zones': [zone_to_json(ZONES[0])]},
          {'wall': 2.0, 'kind': 'zones', 'zones': [zone_to_json(zone) for zone in ZONES]})
    write(tmp_path / truth.FILE,
          *({'t': float(k), 'wall': float(k), 'uav': 'u1', 'x': 25.0 * k, 'y': 45.0 * k,
             'z': 40.0, 'alive': True} for k in range(4)),
          {'t': 2.0, 'wall': 2.0, 'uav': 'u1', 'event': 'item_reached', 'x': 50.0, 'y': 90.0,
           'z': 40.0},
          {'t': 3.0, 'wall': 3.0, 'uav': 'u1', 'event': 'died'})
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_a_run_in_which_nothing_happened_is_drawn(tmp_path):
    write(tmp_path / heard.FILE)
    write(tmp_path / truth.FILE)
    plots.draw_flight(tmp_path, tmp_path / 'map.png')
    assert (tmp_path / 'map.png').read_bytes().startswith(PNG)


def test_uavs_beyond_the_last_colour_start_again():
    assert plots.colour(0) == plots.colour(len(plots.COLOURS))
