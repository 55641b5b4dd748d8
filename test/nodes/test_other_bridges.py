# SPDX-License-Identifier: Apache-2.0
"""A bridge whose UAVs another node reports, too, warns and starts none; other fleets are left."""
import itertools
import time

import pytest
import rclpy
from conftest import Probe
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from test_bridge_findings import HEARTBEAT, Bridge as WholeBridge, fact
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import STATES
from uav_task_alloc.nodes.ros.other_bridges import SETTLING_TIME, OtherBridges

pytestmark = pytest.mark.ros


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
