# SPDX-License-Identifier: Apache-2.0
"""A battery that is changed at the base, through real nodes: out, back full, flying again."""
import json
import re

import pytest
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    EVENTS,
    LATCHED,
    STATES,
    announcement,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.scenario import load, simulation_parameters

pytestmark = pytest.mark.ros
# 70 % of the battery suffice for either task, and not for both
SCENARIO = """
route_end: home
trips: 2
uavs:
  - {id: uav_1, system_id: 1, autopilot: ardupilot, position: [0, 0, 0], range: 1400,
     full_range: 2000, turnaround: 40, climb_speed: 4, descent_speed: 4}
"""
TASKS = [Task('east', (480.0, 0.0, 30.0)), Task('west', (-480.0, 0.0, 30.0))]


@pytest.fixture
def nodes(start, tmp_path):
    """Allocator, bridge and simulated fleet, with the parameters of the scenario."""
    path, port = tmp_path / 'trips.yaml', free_port()
    path.write_text(SCENARIO)
    more = {'allocator': {'uav_timeout': 5.0, 'state_dir': f'{tmp_path}/state'},
            'mavlink_bridge': {'state_dir': f'{tmp_path}/state'},
            'fleet_sim': {'log_file': f'{tmp_path}/truth.jsonl'}}
    parameters = simulation_parameters(load(path), path, port, 20.0)
    return {node: start(node, *(part for name, value in {**parameters[node], **more[node]}.items()
                                for part in ('-p', f'{name}:={json.dumps(value)}')))
            for node in more}


def test_a_uav_flies_on_after_its_battery_was_changed(nodes, probe, tmp_path):
    states = probe.collect(m.UavState, 'uav_states', STATES)
    events = probe.collect(m.TaskEvent, 'task_events', EVENTS)
    statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
    announce = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    announce.publish(announcement(m.TaskAnnouncement.ADD, TASKS, 1.0))

    def outputs():
        return [process.output()[-2000:] for process in nodes.values()]

    def completed():  # the bridge repeats an event that the allocator does not show in time
        return list(dict.fromkeys(
            event.task_id for event in events if event.event == m.TaskEvent.COMPLETED))

    probe.until(lambda: len(completed()) == 2, 300.0, outputs)
    assert sorted(completed()) == ['east', 'west']
    reasons = {status.reason for msg in statuses for status in msg.statuses}
    assert 'after battery change 1 of uav_1' in reasons  # the plan counts on the second trip
    changed = next(k for k, state in enumerate(states) if state.available
                   and state.battery > 0.9)  # it is in the fleet again
    assert any(state.battery < 0.2 for state in states[:changed])
    assert not all(state.available for state in states[:changed])
    assert any(state.active_task_id == completed()[1] for state in states[changed:])
    assert m.UavState.FAULT not in {state.mode for state in states}
    log = nodes['allocator'].output()
    out = re.search('turns home: the last moment by its battery|below the reserve', log)
    assert out is not None
    assert out.start() < log.index('above the reserve again')
    assert 'authority HELD: its battery was changed' in nodes['mavlink_bridge'].output()
    nodes['fleet_sim'].stop()
    rows = [json.loads(line) for line in (tmp_path / 'truth.jsonl').read_text().splitlines()]
    happened = [row['event'] for row in rows if 'event' in row]
    assert 'battery_changed' in happened
    assert not {'died', 'crashed'} & set(happened)
