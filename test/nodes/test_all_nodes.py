# SPDX-License-Identifier: Apache-2.0
"""All nodes together: tasks in, flown missions out, judged by where the vehicles really were."""
import json
from dataclasses import replace

import pytest
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    EVENTS,
    LATCHED,
    STATES,
    announcement,
    from_zones,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port

pytestmark = pytest.mark.ros
SCENARIO = """
name: pair
seed: 1
origin: {latitude: 47.397742, longitude: 8.545594, altitude_amsl: 488.0}
uavs:
  - {id: uav_1, system_id: 1, autopilot: ardupilot, position: [0, 0, 0], range: 20000}
  - {id: uav_2, system_id: 2, autopilot: px4, position: [400, 0, 0], range: 20000}
"""
NEAR = [Task(f't{i}', (100.0 * i, 150.0, 50.0)) for i in range(5)]
# the shortest plan has one UAV fly all of it, so one task each is for one only
BOTH = [replace(NEAR[0], allowed_uavs={'uav_1'}), *NEAR[1:4],
        replace(NEAR[4], allowed_uavs={'uav_2'})]
LATE = [Task('late_1', (50.0, 300.0, 50.0)), Task('late_2', (350.0, 300.0, 50.0))]


class Fleet:
    """The nodes of a small fleet, and what the probe receives."""

    def __init__(self, start, probe, folder):
        (folder / 'pair.yaml').write_text(SCENARIO)
        self.start, self.probe, self.port = start, probe, free_port()
        self.folder = folder
        self.flight = folder / 'flight.jsonl'
        self.states = probe.collect(m.UavState, 'uav_states', STATES)
        self.events = probe.collect(m.TaskEvent, 'task_events', EVENTS)
        self.statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
        self.allocator = start('allocator', '-p', 'uav_timeout:=2.0', '-p', 'route_end:=hold',
                               '-p', f'state_dir:={folder / "state"}')
        self.bridge = self.start_bridge()
        self.sim = start('fleet_sim', '-p', f'scenario:={folder / "pair.yaml"}',
                         '-p', 'speedup:=8.0', '-p', f'target:=127.0.0.1:{self.port}',
                         '-p', f'log_file:={self.flight}')
        self.announce = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)

    def start_bridge(self):
        return self.start('mavlink_bridge', '-p', 'takeoff:=true', '-p', 'relaunch:=automatic',
                          '-p', f'state_dir:={self.folder / "state"}', '-p',
                          f"connections:=['udpin:127.0.0.1:{self.port}']")

    def add(self, tasks):
        self.announce.publish(announcement(m.TaskAnnouncement.ADD, tasks, 1.0))

    def until(self, condition, timeout=60.0):
        self.probe.until(condition, timeout, lambda: '\n'.join(map(str, (
            *{state.uav_id: state for state in self.states}.values(), *self.statuses[-1:],
            self.allocator.output()[-2000:], self.bridge.output()[-2000:]))))

    def state_of(self, task):
        rows = self.statuses[-1].statuses if self.statuses else []
        return next((row.state for row in rows if row.task_id == task.id), None)

    def wait_for(self, tasks, state=m.TaskStatus.COMPLETED, timeout=60.0):
        self.until(lambda: all(self.state_of(task) == state for task in tasks), timeout)

    def visitors(self, task):
        """The vehicles that reached the item at a task, in order, by the simulator's log."""
        lines = [json.loads(line) for line in self.flight.read_text().splitlines()]
        return [line['uav'] for line in lines if line.get('event') == 'item_reached' and max(
            abs(line[axis] - value) for axis, value in zip('xyz', task.position, strict=True)
        ) < 1.0]

    def visits(self, task):
        """How often it was reached."""
        return len(self.visitors(task))


@pytest.fixture
def fleet(start, probe, tmp_path):
    return Fleet(start, probe, tmp_path)


def test_tasks_that_arrive_in_flight_are_flown_once_each_by_both_autopilots(fleet):
    fleet.add(BOTH)
    fleet.until(lambda: any(e.event == m.TaskEvent.COMPLETED for e in fleet.events), 60.0)
    fleet.add(LATE)
    fleet.wait_for(NEAR + LATE)
    fleet.until(lambda: all(fleet.visits(task) == 1 for task in NEAR + LATE))
    done = [e for e in fleet.events if e.event == m.TaskEvent.COMPLETED]
    assert sorted(e.task_id for e in done) == sorted(task.id for task in NEAR + LATE)
    assert {e.uav_id for e in done} == {'uav_1', 'uav_2'}
    fleet.until(  # a slow machine still uploads the list without the last task
        lambda: {s.mission_state for s in fleet.states[-20:]} == {m.UavState.VERIFIED})


def test_a_bridge_killed_in_flight_comes_back_and_flies_no_task_twice(fleet):
    fleet.add(NEAR)
    fleet.until(lambda: any(e.event == m.TaskEvent.COMPLETED for e in fleet.events), 60.0)
    fleet.bridge.popen.kill()
    fleet.bridge.popen.wait()
    fleet.start_bridge()
    fleet.wait_for(NEAR)
    fleet.until(lambda: all(fleet.visits(task) >= 1 for task in NEAR))
    assert [fleet.visits(task) for task in NEAR] == [1] * len(NEAR)


def test_an_allocator_killed_in_flight_comes_back_and_loses_nothing(fleet, tmp_path):
    fleet.add(NEAR)
    fleet.until(lambda: any(e.event == m.TaskEvent.COMPLETED for e in fleet.events), 60.0)
    fleet.allocator.popen.kill()
    fleet.allocator.popen.wait()
    fleet.start('allocator', '-p', 'route_end:=hold', '-p', f'state_dir:={tmp_path / "state"}')
    fleet.wait_for(NEAR)
    fleet.until(lambda: all(fleet.visits(task) >= 1 for task in NEAR))
    assert [fleet.visits(task) for task in NEAR] == [1] * len(NEAR)


def test_the_tasks_of_a_uav_that_falls_silent_go_to_the_other(fleet):
    fleet.add(NEAR)
    fleet.until(lambda: any(s.uav_id == 'uav_2' and s.active_task_id
                            for s in fleet.states), 60.0)
    answer = fleet.probe.call(SetAvailability, 'fleet_sim/set_alive',
                              SetAvailability.Request(uav_id='uav_2', available=False))
    assert answer.success, answer.message
    fleet.wait_for(NEAR)
    fleet.until(lambda: all(fleet.visits(task) >= 1 for task in NEAR))
    twice = [task.id for task in NEAR if fleet.visits(task) > 1]
    # at most what it had reached the moment before, which nobody received
    assert [fleet.visitors(task) for task in NEAR if task.id in twice] in (
        [], [['uav_2', 'uav_1']])
    assert not {(event.uav_id, event.task_id) for event in fleet.events
                if event.event == m.TaskEvent.COMPLETED} & {('uav_2', name) for name in twice}


def test_a_task_inside_a_zone_is_left_out_with_the_reason(fleet):
    zones = fleet.probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
    zones.publish(from_zones([ThreatZone.hemisphere('dome', (200.0, 150.0, 0.0), 80.0)], 1.0))
    fleet.add(NEAR)
    fleet.wait_for(NEAR[2:3], m.TaskStatus.UNASSIGNED)
    fleet.wait_for(NEAR[:2] + NEAR[3:])
    reason = next(row.reason for row in fleet.statuses[-1].statuses if row.task_id == 't2')
    assert 'dome' in reason
    assert fleet.visits(NEAR[2]) == 0
