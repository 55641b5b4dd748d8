# SPDX-License-Identifier: Apache-2.0
"""A bridge whose UAVs another node reports, too, warns and starts none; other fleets are left."""
import itertools
import time

import pytest
import rclpy
from conftest import Probe
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from pymavlink.dialects.v20 import ardupilotmega as d
from test_bridge_findings import HEARTBEAT, Bridge as WholeBridge, fact
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import LATCHED, STATES
from uav_task_alloc.nodes.ros.other_bridges import SETTLING_TIME, OtherBridges

pytestmark = pytest.mark.ros
ARMED = d.MAVLink_heartbeat_message(
    d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4, d.MAV_MODE_FLAG_SAFETY_ARMED, 4 << 16 | 4 << 24,
    4, 3)


class Bridge(Probe):
    """What others see of a bridge, and what it finds of them."""

    def __init__(self, namespace, first):
        super().__init__('mavlink_bridge', namespace=namespace)
        self.states = self.node.create_publisher(m.UavState, 'uav_states', STATES)
        self.others = OtherBridges(self.node)
        self.clock = itertools.count(first, 9)

    def report(self, uav_id):
        msg = m.UavState(uav_id=uav_id)
        msg.header.stamp.nanosec = next(self.clock)
        self.others.note_own(msg)
        self.states.publish(msg)

    def finds(self):
        self.others.search(time.monotonic())
        self.executor.spin_once(timeout_sec=0.02)
        return self.others.grounded(time.monotonic())


@pytest.fixture
def bridge(domain):
    """bridge(namespace) -> Bridge; they are destroyed."""
    made = []

    def make(namespace):
        made.append(Bridge(namespace, len(made)))  # no two report at the same time
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def whole(domain):
    """A bridge in this process."""
    rclpy.init(args=['--ros-args', '-p', "connections:=['udpin:127.0.0.1:0']"])
    whole = WholeBridge()
    yield whole
    whole.close()
    rclpy.try_shutdown()


def test_a_bridge_whose_uavs_another_node_reports_starts_none_and_says_so(whole, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    states = probe.node.create_publisher(m.UavState, 'uav_states', STATES)
    whole.send(HEARTBEAT)
    whole.node.others.note_own(m.UavState(uav_id='uav_1'))
    msg = m.UavState(uav_id='uav_1')
    msg.header.stamp.sec = 7

    def warned():
        states.publish(msg)
        probe.executor.spin_once(timeout_sec=0.0)
        return (fact(health, 'uav_ids') or [0])[0] == ord(DiagnosticStatus.WARN)

    whole.until(warned)
    assert whole.log['warning'][0].startswith('uav_ids: uav_1: another node reports UAVs of these')
    reason = 'ids of its own: another node reports UAVs of this bridge, too'
    assert whole.node.grounded() == reason
    whole.until(lambda: [session.executor.policy.grounded for session in list(
        whole.node.ground_station.sessions.values())] == [reason])
    whole.until(lambda: not whole.node.grounded())  # it has ended


def test_while_its_id_is_shared_a_uav_holds_gets_no_lists_and_is_not_available(whole, probe):
    states = probe.node.create_publisher(m.UavState, 'uav_states', STATES)
    seen = probe.collect(m.UavState, 'uav_states', STATES)
    lists = probe.node.create_publisher(m.TaskList, 'uav_1/task_list', LATCHED)
    msg, clock = m.UavState(uav_id='uav_1'), itertools.count(1000, 50)

    def fly():
        whole.send(ARMED, d.MAVLink_global_position_int_message(
            next(clock), 473977420, 85455940, 500000, 10000, 0, 0, 0, 0),
            d.MAVLink_extended_sys_state_message(0, d.MAV_LANDED_STATE_IN_AIR))
        probe.executor.spin_once(timeout_sec=0.0)

    def shared(until):
        def step():
            fly()
            msg.header.stamp.sec += 1
            states.publish(msg)
            return whole.node.others.shared('uav_1', time.monotonic()) and until()
        whole.until(step)

    shared(lambda: True)
    session, = whole.node.ground_station.sessions.values()
    lists.publish(m.TaskList(uav_id='uav_1', revision=1))
    shared(lambda: 'uav_1' in whole.node.lists.pending)
    reason = whole.node.others.shared('uav_1', time.monotonic())
    assert reason.startswith('another node reports uav_1, too (states are published by /mavlink_')
    assert probe.node.get_name() in reason
    shared(lambda: any(each.reason == reason and not each.available for each in seen))
    shared(lambda: session.executor.holds.for_shared_id)
    assert session.executor.onboard.tasks is None
    whole.until(lambda: fly() or session.executor.onboard.tasks is not None)  # it has ended
    whole.until(lambda: not session.executor.holds.for_shared_id)


def test_a_list_that_came_while_its_id_was_shared_is_flown_only_where_it_is_sent_again(
        whole, probe):
    lists = probe.node.create_publisher(m.TaskList, 'uav_1/task_list', LATCHED)
    gone = Probe('rosbag2_player')
    of_recording = gone.node.create_publisher(m.TaskList, 'uav_1/task_list', LATCHED)
    whole.send(HEARTBEAT)
    whole.until(lambda: whole.node.lists.known)
    session, = whole.node.ground_station.sessions.values()
    taken = []
    session.executor.assign = lambda tasks, now: taken.append(tasks.revision) or []
    shared = ['another node']
    whole.node.others.shared = lambda uav_id, now: shared[0]
    lists.publish(m.TaskList(uav_id='uav_1', revision=5))
    whole.until(lambda: 'uav_1' in whole.node.lists.pending)
    of_recording.publish(m.TaskList(uav_id='uav_1', revision=900))
    whole.until(lambda: whole.node.lists.pending['uav_1'].revision == 900)
    whole.node.origins.conflict = lambda: 'another origin'  # as of a second fleet
    gone.close()
    whole.until(lambda: whole.node.count_publishers('uav_1/task_list') == 1)
    shared[0] = ''
    whole.until(lambda: 'uav_1' not in whole.node.lists.pending)
    whole.node.origins.conflict = lambda: ''
    whole.until(lambda: taken)
    assert taken == [5]


def test_a_recording_that_is_played_is_told_from_a_second_bridge(whole, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    player, clock = Probe('rosbag2_player'), itertools.count(1)
    played = player.node.create_publisher(m.UavState, 'uav_states', STATES)
    other = probe.node.create_publisher(m.UavState, 'uav_states', STATES)
    whole.send(HEARTBEAT)
    whole.node.others.note_own(m.UavState(uav_id='uav_1'))

    def reported(until):
        def step():
            msg = m.UavState(uav_id='uav_1')
            msg.header.stamp.sec = next(clock)
            played.publish(msg)
            probe.executor.spin_once(timeout_sec=0.0)
            return whole.node.others.warning(time.monotonic()) and until()
        whole.until(step)

    def warning():
        return whole.node.others.warning(time.monotonic())

    reported(lambda: 'another node reports' in warning())  # it may be the other one
    probe.node.destroy_publisher(other)
    reported(lambda: 'a recording that is played reports' in warning())
    assert 'states are published by /mavlink_bridge and /rosbag2_player' in warning()
    assert 'expected the end of `ros2 bag play`' in warning()
    assert whole.node.grounded() == ('ids of its own: a recording that is played reports UAVs of '
                                     'this bridge, too')
    reported(lambda: whole.node.others.shared('uav_1', time.monotonic()))
    assert whole.node.others.shared('uav_1', time.monotonic()).startswith(
        'a recording that is played reports uav_1, too (states are published by /mavlink_bridge')
    reported(lambda: (fact(health, 'uav_ids') or [0])[0] == ord(DiagnosticStatus.WARN))
    player.close()


def test_a_single_report_of_another_node_holds_no_uav(domain):
    one = Bridge('/four', 0)
    one.others.note_own(m.UavState(uav_id='uav_1'))
    for second in range(1, 4):
        assert one.others.shared('uav_1', time.monotonic()) == ''
        msg = m.UavState(uav_id='uav_1')
        msg.header.stamp.sec = second
        one.others._on_state(msg)
    assert one.others.shared('uav_1', time.monotonic()) == 'another node reports uav_1, too'
    assert one.others.shared('uav_2', time.monotonic()) == ''
    one.close()


def test_two_bridges_with_the_same_uav_find_each_other(bridge):
    first, second = bridge('/one'), bridge('/one')

    def found():
        first.report('uav_1')
        second.report('uav_1')
        return first.finds() and second.finds()

    first.until(found)
    assert 'uav_1: another node reports UAVs' in first.others.warning(time.monotonic())
    assert first.others.warning(time.monotonic() + 60.0) == ''  # it has ended


def test_a_bridge_of_other_uavs_and_another_fleet_are_not_found(bridge):
    first, second, elsewhere = bridge('/two'), bridge('/two'), bridge('/three')
    own, others = (each.collect(m.UavState, 'uav_states', STATES) for each in (first, second))

    def found():
        first.report('uav_1')
        second.report('uav_2')
        elsewhere.report('uav_1')
        first.finds()
        second.finds()
        return min(len({msg.uav_id for msg in each}) for each in (own, others)) == 2 and (
            first.others._subscription is not None) and len(own) > 50

    first.until(found)
    assert first.others.warning(time.monotonic()) == second.others.warning(
        time.monotonic()) == elsewhere.others.warning(time.monotonic()) == ''


def test_a_first_take_off_waits_until_others_would_have_been_found(whole):
    whole.send(HEARTBEAT)
    whole.until(lambda: whole.node.lists.known)
    session, = whole.node.ground_station.sessions.values()
    assert session.executor.policy.settling == 'the search for other bridges'
    whole.until(lambda: not session.executor.policy.settling)
    assert time.monotonic() - whole.node.others._began >= SETTLING_TIME
