# SPDX-License-Identifier: Apache-2.0
"""The bridge as a process, between ROS topics and simulated vehicles on UDP."""
import json
import math
import signal
import threading
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.time import Time
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import HandOver

from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Leg, Task, ThreatZone
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    EVENTS,
    LATCHED,
    STATES,
    announcement,
    from_zones,
    header,
    planned_task,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet

pytestmark = pytest.mark.ros
ORIGIN = Origin(47.397742, 8.545594, 488.0)
KINDS = {1: 'ardupilot', 2: 'px4'}


class Sky:
    """Two fast vehicles, a bridge, and what it publishes."""

    def __init__(self, start, probe, log, *args):
        self.probe, self._start, self._args, self.log = probe, start, args, log
        self.port = free_port()
        self.fleet = UdpFleet([(VehicleConfig(f'uav_{n}', n, ORIGIN, (20.0 * n, 0.0, 0.0),
                                           arming_delay=0.0, floods=False), kind)
                            for n, kind in KINDS.items()], ('127.0.0.1', self.port), 10.0, log)
        self.states, self.events = {}, []
        probe.node.create_subscription(m.UavState, 'uav_states', self.on_state, STATES)
        probe.node.create_subscription(m.TaskEvent, 'task_events', self.events.append, EVENTS)
        self.health = probe.collect(DiagnosticArray, '/diagnostics', 10)
        self.lists = {n: probe.node.create_publisher(m.TaskList, f'uav_{n}/task_list', LATCHED)
                      for n in KINDS}
        self.thread = threading.Thread(target=self.fleet.spin)
        self.thread.start()
        self.bridge = self.again()

    def again(self):
        """A bridge, the first or the next."""
        self.states.clear()
        self.bridge = self._start(
            'mavlink_bridge', '-p', f"connections:=['udpin:127.0.0.1:{self.port}']", '-p',
            'takeoff:=true', *self._args)
        self.probe.until(lambda: len(self.states) == len(KINDS))
        return self.bridge

    def receive_rest(self):
        """Receive what was published before the end of the bridge."""
        end = time.monotonic() + 0.5
        self.probe.until(lambda: time.monotonic() > end)

    def on_state(self, msg):
        self.states[msg.uav_id] = msg

    def until(self, condition, timeout=60.0):
        self.probe.until(condition, timeout, lambda: '\n'.join(map(str, self.states.values())))

    def send(self, n, revision, names, **fields):
        """Tasks 60 m from each other, each at the place of its name."""
        tasks = [planned_task(ListStop(Task(f'u{n}_{k}', (60.0 * k, 40.0 + 40.0 * n, 50.0)),
                                       Leg((), 60.0), 0.0)) for k in names]
        self.lists[n].publish(m.TaskList(header=header(0.0), uav_id=f'uav_{n}',
                                         revision=revision, tasks=tasks, **fields))

    def completed(self, n):
        return [e.task_id for e in self.events
                if e.uav_id == f'uav_{n}' and e.event == m.TaskEvent.COMPLETED]

    def fact(self, n, key):
        """What the diagnostics say of a vehicle now: older ones may still be on their way."""
        begin = self.probe.node.get_clock().now().nanoseconds
        values = []

        def is_said():
            values[:] = (v.value for array in self.health for s in array.status for v in s.values
                         if Time.from_msg(array.header.stamp).nanoseconds > begin
                         and s.hardware_id == f'uav_{n}' and v.key == key)
            return values

        self.probe.until(is_said)
        return values[-1]

    def flown(self, n):
        """Tasks by the places that the vehicle really reached so far, in order."""
        whole, _, _ = self.log.read_text().rpartition('\n')  # the last line may be under way
        lines = [json.loads(line) for line in whole.splitlines()]
        return [f'u{n}_{round(line["x"] / 60.0)}' for line in lines
                if line['uav'] == f'uav_{n}' and line.get('event') == 'item_reached']

    def land(self):
        """Stop the vehicles; the log is whole then."""
        self.fleet.stop()
        self.thread.join()
        self.fleet.close()


@pytest.fixture
def sky(start, probe, tmp_path):
    made = []

    def make(*args):
        made.append(Sky(start, probe, tmp_path / 'flight.jsonl', *args))
        return made[-1]
    yield make
    for one in made:
        if one.thread.is_alive():
            one.land()


def test_lists_are_flown_and_replaced_in_flight_and_every_task_is_reported_once(sky, probe):
    world = sky()
    for n in KINDS:
        world.send(n, 1, [0, 20, 2, 3])
    flying = set(KINDS)
    while flying:  # each on its long leg: a listed task that was flown is reported again
        world.until(lambda: any(map(world.completed, flying)))
        for n in [n for n in flying if world.completed(n)]:
            world.send(n, 2, [3, 5, 2])
            flying.remove(n)
    world.until(lambda: all(f'u{n}_2' in world.completed(n) for n in KINDS))
    world.land()
    for n in KINDS:
        assert world.completed(n) == world.flown(n)
        assert len(set(world.completed(n))) == len(world.completed(n))
        assert world.completed(n)[-1] == f'u{n}_2'
        state = world.states[f'uav_{n}']
        assert state.list_revision == 2
        assert state.mission_state == m.UavState.VERIFIED


@pytest.mark.parametrize('moment', ['upload', 'flight'])
def test_a_bridge_killed_and_restarted_flies_no_task_twice(sky, probe, moment, tmp_path):
    world = sky('-p', f'state_dir:={tmp_path}/state')
    for n in KINDS:
        world.send(n, 1, [0, 1, 2, 3, 4])
    world.until(lambda: all(f'u{n}_1' in world.completed(n) for n in KINDS))
    if moment == 'upload':
        for n in KINDS:
            world.send(n, 2, [4, 3, 2])
        world.until(lambda: any(s.mission_state == m.UavState.UPLOADING
                                or s.list_revision == 2 for s in world.states.values()))
    world.bridge.stop(signal.SIGKILL)
    world.receive_rest()
    before = {n: set(world.completed(n)) for n in KINDS}
    world.again()
    world.until(lambda: all({f'u{n}_{k}' for k in range(5)} <= set(world.completed(n))
                            for n in KINDS), 60.0)
    if moment == 'flight':
        assert [world.fact(n, 'uploads') for n in KINDS] == ['0', '0']  # nothing differed
    world.land()
    for n in KINDS:
        assert sorted(world.flown(n)) == [f'u{n}_{k}' for k in range(5)]
        completed = [t for t in world.completed(n) if world.completed(n).count(t) == 1]
        assert set(completed) >= {f'u{n}_{k}' for k in range(5)} - before[n]


def test_what_was_flown_while_the_bridge_was_dead_is_not_flown_again(sky, probe, tmp_path):
    world = sky('-p', f'state_dir:={tmp_path}/state')
    for n in KINDS:
        world.send(n, 1, [0, 1, 2])
    world.until(lambda: all(f'u{n}_0' in world.completed(n) for n in KINDS))
    world.bridge.stop(signal.SIGKILL)
    world.until(lambda: all(len(world.flown(n)) == 3 for n in KINDS))
    for n in KINDS:
        world.send(n, 2, [])  # an allocator that received nothing gives them up
    world.again()
    for n in KINDS:
        world.send(n, 3, [2, 3, 1])
    # it holds for a reason that the bridge did not see
    world.until(lambda: world.states['uav_2'].authority == m.UavState.LOST)
    world.until(lambda: hand_over(probe, 'uav_2')[0])
    world.until(lambda: all({f'u{n}_{k}' for k in range(4)} == set(world.completed(n))
                            for n in KINDS), 60.0)
    world.land()
    for n in KINDS:
        assert world.flown(n) == [f'u{n}_{k}' for k in range(4)]


def hand_over(probe, uav_id, operator='anna'):
    answer = probe.call(HandOver, 'mavlink_bridge/hand_over',
                        HandOver.Request(uav_id=uav_id, operator_name=operator))
    return answer.success, answer.message


def test_a_uav_that_landed_is_flown_again_after_a_hand_over(sky, probe):
    world = sky('-p', 'when_empty:=return')
    world.until(lambda: all(s.authority == m.UavState.HELD for s in world.states.values()))
    world.send(1, 1, [0, 1], end=m.TaskList.RETURN_HOME)
    world.until(lambda: world.states['uav_1'].authority == m.UavState.NONE, 90.0)
    assert world.completed(1) == ['u1_0', 'u1_1']
    assert not world.states['uav_1'].available
    assert '~/hand_over' in world.states['uav_1'].reason
    assert world.states['uav_2'].authority == m.UavState.HELD
    for _ in range(2):  # at least a second later, when its heartbeat says that it is disarmed
        assert world.fact(1, 'authority') == 'NONE'
    world.until(lambda: hand_over(probe, 'uav_1')[0])
    assert 'hand_over of uav_1 by anna: the bridge has uav_1 now' in world.bridge.output()
    world.until(lambda: world.states['uav_1'].available)
    world.send(1, 2, [2], end=m.TaskList.RETURN_HOME)
    world.until(lambda: 'u1_2' in world.completed(1), 60.0)


def test_a_hand_over_that_is_refused_says_why(sky, probe):
    world = sky('-p', 'takeoff:=false')
    assert hand_over(probe, 'uav_9') == (
        False, "refused: uav 'uav_9': expected one of uav_1, uav_2")
    success, message = hand_over(probe, 'uav_2', 'two\nlines')
    assert (success, message) == (False, 'refused: on the ground, and takeoff is false')
    assert f'hand_over of uav_2 by two?lines: {message}' in world.bridge.output()


def test_a_pilot_takes_a_uav_and_the_other_gets_its_tasks(sky, probe, start):
    world = sky()
    start('allocator', '-p', 'route_end:=hold')
    announce = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    work = [Task(f't{k}', (20.0, 300.0 + 100.0 * k, 50.0)) for k in range(4)]
    work.append(Task('only', (20.0, 250.0, 50.0), allowed_uavs=frozenset({'uav_1'})))
    announce.publish(announcement(m.TaskAnnouncement.ADD, work, 1.0))
    world.until(lambda: world.states['uav_1'].active_task_id == 'only', 60.0)
    with world.fleet._lock:
        assert world.fleet.vehicles['uav_1'].rc_mode(5)  # LOITER, by the switch
    world.until(lambda: world.states['uav_1'].authority == m.UavState.LOST)
    assert not world.states['uav_1'].available
    assert 'LOITER' in world.states['uav_1'].reason
    world.until(lambda: set(world.completed(2)) == {f't{k}' for k in range(4)}, 90.0)
    assert '-> LOITER' in world.bridge.output()


def test_authority_persists_over_a_restart_of_the_bridge(sky, probe, tmp_path):
    world = sky('-p', f'state_dir:={tmp_path}/state')
    world.send(1, 1, [0, 1], end=m.TaskList.RETURN_HOME)
    world.until(lambda: world.states['uav_1'].authority == m.UavState.NONE, 90.0)
    assert sorted(path.name for path in (tmp_path / 'state').glob('*.json')) == [
        'authority_uav_1.json', 'authority_uav_2.json']
    world.bridge.stop(signal.SIGKILL)
    world.again()
    world.until(lambda: world.states['uav_2'].authority == m.UavState.HELD)
    assert world.states['uav_1'].authority == m.UavState.NONE  # else it would take off again
    assert world.fact(1, 'authority_why') == 'landed'


def test_a_corrupt_authority_file_is_reported_and_awaits_a_hand_over(sky, probe, tmp_path):
    path = tmp_path / 'authority_uav_1.json'
    path.write_text('{')
    world = sky('-p', f'state_dir:={tmp_path}')
    assert f'{path}: Expecting' in world.bridge.output()
    world.until(lambda: world.states['uav_2'].authority == m.UavState.HELD)
    world.until(lambda: world.states['uav_1'].reason == (
        'authority NONE: its authority file cannot be used; given back by ~/hand_over'))
    world.until(lambda: hand_over(probe, 'uav_1')[0])
    world.until(lambda: world.states['uav_1'].authority == m.UavState.HELD)


def test_a_bad_zone_is_refused_with_one_warning(sky, probe):
    world = sky()
    zones = probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
    array = from_zones([ThreatZone.cylinder('z', (9e3, 9e3), 10.0)], 0.0)
    zones.publish(array)
    array.zones[0].radius = -1.0
    for _ in range(3):
        zones.publish(array)
    world.until(lambda: 'threat_zones: zone z: radius = -1.0' in world.bridge.output())
    world.until(lambda: any(status.message.startswith('refused: zone z: radius = -1.0')
                            for array in world.health for status in array.status))
    world.send(1, 1, [0])
    world.until(lambda: world.completed(1) == ['u1_0'])
    assert world.bridge.output().count('radius = -1.0') == 1


def test_finding_38_each_uav_has_its_own_range(sky, probe):
    world = sky('-p', "full_ranges:=['uav_1:6000', 'uav_3:1']", '-p', 'full_range:=9000.0')
    world.until(lambda: all(state.battery > 0.9 for state in world.states.values()))
    for n, most in ((1, 6000.0), (2, 9000.0)):
        state = world.states[f'uav_{n}']
        assert state.range_remaining == pytest.approx(most * state.battery, rel=1e-3)


def test_the_limits_of_single_uavs_are_in_their_states(sky, probe):
    world = sky('-p', "uav_limits:=['uav_1:endurance=900,climb_speed=4,turnaround=60']", '-p',
                'full_range:=9000.0')
    world.until(lambda: all(state.battery > 0.9 for state in world.states.values()))
    one, two = world.states['uav_1'], world.states['uav_2']
    assert one.endurance == pytest.approx(900.0 * one.battery, rel=1e-3)
    assert (one.climb_speed, one.turnaround, one.full_range) == (4.0, 60.0, 9000.0)
    assert all(map(math.isnan, (one.descent_speed, one.payload_capacity, one.cruise_speed,
                                two.endurance, two.climb_speed, two.turnaround)))


def test_states_carry_what_the_allocator_plans_with(sky, probe):
    world = sky('-p', 'full_range:=20000.0', '-p', "capabilities:=['uav_1:camera,thermal']")
    world.until(lambda: world.states['uav_1'].home.x == pytest.approx(20.0, abs=0.1)
                and world.states['uav_1'].battery > 0.9)
    one, two = world.states['uav_1'], world.states['uav_2']
    assert one.position.x == pytest.approx(20.0, abs=0.1)
    assert one.range_remaining == pytest.approx(20000.0 * one.battery, rel=1e-3)
    assert (list(one.capabilities), list(two.capabilities)) == (['camera', 'thermal'], [])
    assert one.available
    assert one.mode == m.UavState.STANDBY
    assert one.cruise_speed != one.cruise_speed


def test_a_bad_list_is_refused_with_a_reason_and_changes_nothing(sky, probe):
    world = sky()
    world.send(1, 1, [0, 1])
    world.until(lambda: world.states['uav_1'].list_revision == 1)
    bad = planned_task(ListStop(Task('far', (0.0, 0.0, 50.0)), Leg((), 1.0), 0.0))
    bad.task.position.x = float('nan')
    world.lists[1].publish(m.TaskList(uav_id='uav_1', revision=2, tasks=[bad]))
    world.until(lambda: 'three finite coordinates' in world.bridge.output())
    world.lists[1].publish(m.TaskList(uav_id='uav_2', revision=2))
    world.until(lambda: "uav_id = 'uav_2': expected uav_1" in world.bridge.output())
    world.until(lambda: world.completed(1) == ['u1_0', 'u1_1'])
    assert world.states['uav_1'].list_revision == 1


def test_diagnostics_name_each_uav_and_its_mission(sky, probe):
    world = sky()
    arrays = world.health
    world.send(2, 1, [0, 1])
    world.until(lambda: any(s.hardware_id == 'uav_2' and 'VERIFIED' in s.message
                            for array in arrays for s in array.status))
    details = {v.key: v.value for s in arrays[-1].status if s.hardware_id == 'uav_2'
               for v in s.values}
    assert details['autopilot'] == 'px4'
    assert details['mission'] == 'VERIFIED'
