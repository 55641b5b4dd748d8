# SPDX-License-Identifier: Apache-2.0
"""The nodes among other nodes: what they may touch, two fleets at once, a clean stop at work."""
import math
import signal
from fnmatch import fnmatch
from pathlib import Path
from xml.etree import ElementTree

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from rclpy.qos import QoSProfile, ReliabilityPolicy
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, STATES

pytestmark = pytest.mark.ros
POLICIES = ElementTree.parse(Path(__file__).parents[2] / 'config/sros2/policies.xml')
UNUSED = {'/clock'}  # only with use_sim_time
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
BRIDGE = ('-p', "connections:=['udpin:127.0.0.1:0']")


def allowed(node, what, right):
    """The full names that the policy of a node lets it e.g. publish."""
    profile = POLICIES.find(f'.//profile[@node="{node}"]')
    names = [each.text for group in profile.findall(f'{what}s[@{right}="ALLOW"]')
             for each in group.findall(what)]
    return {name.replace('~', f'/{node}') if name[0] == '~' else
            name if name[0] == '/' else f'/{name}' for name in names}


@pytest.mark.parametrize(('name', 'given'), [('allocator', ()), ('mavlink_bridge', BRIDGE)])
def test_the_policy_allows_what_a_node_does_and_no_more(start, probe, name, given):
    start(name, *given)
    probe.until(lambda: name in probe.node.get_node_names())
    if name == 'allocator':
        states = probe.node.create_publisher(m.UavState, 'uav_states', STATES)
        work = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
        probe.node.create_timer(0.1, lambda: states.publish(uav()))
        work.publish(tasks('t', 2))
        resume = srv.ResumeUav.Request(uav_id='u')  # a topic of holds exists from the first on
        probe.until(lambda: probe.call(srv.ResumeUav, 'allocator/resume_uav', resume).success)
    graph = probe.node
    for what, right, look in (
            ('topic', 'publish', graph.get_publisher_names_and_types_by_node),
            ('topic', 'subscribe', graph.get_subscriber_names_and_types_by_node),
            ('service', 'reply', graph.get_service_names_and_types_by_node)):
        patterns = allowed(name, what, right)

        def seen(look=look):
            return {found for found, _ in look(name, '/')}

        needed = {pattern for pattern in patterns - UNUSED if '*' not in pattern
                  or (name, right) == ('allocator', 'publish')}
        probe.until(lambda: all(any(fnmatch(got, pattern) for got in seen())
                                for pattern in needed))  # noqa: B023
        assert {got for got in seen() if not any(fnmatch(got, p) for p in patterns)} == set()
    assert graph.get_client_names_and_types_by_node(name, '/') == []


def test_the_diagnostics_of_a_bridge_have_its_full_name(start, probe):
    start('mavlink_bridge', '-r', '__ns:=/north', *BRIDGE)
    shown = probe.collect(DiagnosticArray, '/diagnostics', 10)
    probe.until(lambda: shown)
    assert {status.name.partition(':')[0] for status in shown[0].status} == {
        '/north/mavlink_bridge'}


def test_an_operator_may_order_and_an_observer_may_not():
    offered = {name for name in allowed('allocator', 'service', 'reply')
               if 'parameter' not in name and 'type_description' not in name}
    assert allowed('operator', 'service', 'request') == offered
    assert allowed('observer', 'service', 'request') == set()
    assert allowed('observer', 'topic', 'publish') == {'/parameter_events', '/rosout'}


def uav(name='u'):
    return m.UavState(uav_id=name, position=Point(z=50.0), home=Point(x=math.nan), battery=1.0,
                      range_remaining=math.nan, cruise_speed=math.nan, available=True)


def tasks(prefix, number):
    return m.TaskAnnouncement(tasks=[
        m.Task(task_id=f'{prefix}{k}', position=Point(x=7.0 * (k % 40), y=9.0 * k, z=50.0),
               value=1.0) for k in range(number)])


def test_two_fleets_in_one_domain_do_not_exchange_messages(start, probe):
    allocations = {}
    for side in 'ab':
        start('allocator', '-r', f'__ns:=/{side}')
        states = probe.publisher(m.UavState, f'{side}/uav_states', STATES)
        work = probe.publisher(m.TaskAnnouncement, f'{side}/task_announcements', ANNOUNCEMENTS)
        probe.node.create_timer(0.1, lambda to=states, side=side: to.publish(uav(f'u_{side}')))
        work.publish(tasks(side, 2))
        allocations[side] = probe.collect(m.Allocation, f'{side}/allocation', LATCHED)
    for side in 'ab':
        probe.until(lambda side=side: allocations[side] and allocations[side][-1].value == 2.0)
    for side in 'ab':
        lists = allocations[side][-1].lists
        assert [each.uav_id for each in lists] == [f'u_{side}']
        assert sorted(p.task.task_id for p in lists[0].tasks) == [f'{side}0', f'{side}1']


def test_a_remapped_topic_is_received(start, probe):
    start('allocator', '-r', 'task_announcements:=orders')
    orders = probe.publisher(m.TaskAnnouncement, 'orders', ANNOUNCEMENTS)
    statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
    orders.publish(tasks('t', 1))
    probe.until(lambda: statuses and statuses[-1].statuses[0].task_id == 't0')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_an_allocator_exits_in_order_during_a_solve(start, probe, number, tmp_path):
    process = start('allocator', '-p', 'solve_budget:=60.0', '-p', f'state_dir:={tmp_path}')
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    work = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
    probe.until(lambda: 'ready' in process.output())
    work.publish(tasks('t', 100))
    probe.until(lambda: statuses)
    states.publish(uav())
    probe.until(lambda: 'u reports' in process.output())
    code, out = process.stop(number)
    assert (code, 'Traceback' in out) == (0, False)


def test_publishers_that_are_not_received_are_in_the_diagnostics(start, probe):
    start('allocator')
    start('mavlink_bridge', *BRIDGE)
    shown = probe.collect(DiagnosticArray, '/diagnostics', 10)
    publishers = [probe.node.create_publisher(m.TaskAnnouncement, 'task_announcements', 10),
                  probe.node.create_publisher(m.ThreatZoneArray, 'threat_zones', BEST_EFFORT)]
    zones = ('threat_zones: nothing is received of probe, which offers reliability best_effort: '
             'expected reliable')
    tasks = ('task_announcements: nothing is received of probe, which offers durability volatile: '
             'expected transient_local')

    def warnings(name):
        return next((each.message for array in reversed(shown) for each in array.status
                     if each.name.startswith(name) and each.level == each.WARN), '')

    probe.until(lambda: tasks in warnings('/allocator') and zones in warnings('/allocator'))
    probe.until(lambda: warnings('/mavlink_bridge: topics') == zones)
    for publisher in publishers:
        probe.node.destroy_publisher(publisher)
    shown.clear()
    probe.until(lambda: any(each.name.startswith('/allocator') and each.level == each.OK
                            for array in shown for each in array.status))
