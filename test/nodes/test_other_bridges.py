# SPDX-License-Identifier: Apache-2.0
"""Two bridges whose UAVs have the same ids are warned of; other nodes and fleets are not."""
import pytest
import rclpy
from conftest import Probe
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from test_bridge_findings import HEARTBEAT, Bridge as WholeBridge, fact
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import LATCHED, STATES
from uav_task_alloc.nodes.ros.other_bridges import OtherBridges

pytestmark = pytest.mark.ros


class Bridge(Probe):
    """What others see of a bridge."""

    def __init__(self, namespace, uav_id):
        super().__init__('mavlink_bridge', namespace=namespace)
        self.node.create_publisher(m.UavState, 'uav_states', STATES)
        self.collect(m.TaskList, f'{uav_id}/task_list', LATCHED)


@pytest.fixture
def bridge(domain):
    """bridge(namespace, uav_id) -> Bridge; they are destroyed."""
    made = []

    def make(namespace, uav_id):
        made.append(Bridge(namespace, uav_id))
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


def test_the_diagnostics_of_a_bridge_name_the_uavs_that_another_one_flies(
        whole, bridge, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    whole.node.others.patience = 0.0
    whole.send(HEARTBEAT)
    bridge('/', 'uav_1')
    whole.until(lambda: whole.log['warning'])
    assert whole.log['warning'][0].startswith('uav_ids: uav_1: another node reports and flies')
    whole.until(lambda: not probe.executor.spin_once(timeout_sec=0.0)
              and (fact(health, 'uav_ids') or [0])[0] == ord(DiagnosticStatus.WARN))


def test_another_bridge_with_the_same_uav_is_warned_of_once_it_stays(bridge):
    first, _ = bridge('/one', 'uav_1'), bridge('/one', 'uav_1')
    first.until(lambda: OtherBridges(first.node, patience=0.0).warning(['uav_1'], 0.0))
    others = OtherBridges(first.node)
    assert others.warning(['uav_1', 'uav_2'], 0.0) == ''
    assert others.warning(['uav_1', 'uav_2'], 29.0) == ''
    assert others.warning(['uav_1', 'uav_2'], 31.0).startswith(
        'uav_1: another node reports and flies UAVs of these ids, too')


def test_a_bridge_of_other_uavs_a_recorder_and_another_fleet_are_not_warned_of(bridge):
    first, recorder = bridge('/two', 'uav_1'), Probe('recorder', namespace='/two')
    bridge('/two', 'uav_2')
    bridge('/three', 'uav_1')
    recorder.collect(m.TaskList, 'uav_1/task_list', LATCHED)
    first.until(lambda: first.node.count_subscribers('/two/uav_1/task_list') == 2
                and first.node.count_publishers('/two/uav_states') == 2
                and first.node.count_publishers('/three/uav_states') == 1)
    others = OtherBridges(first.node, patience=0.0)
    assert others.warning(['uav_1'], 0.0) == ''
    recorder.close()
