# SPDX-License-Identifier: Apache-2.0
"""Two allocators on one fleet: one publishes, the other says why it does not."""
import signal

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rosgraph_msgs.msg import Clock
from test_allocator import Fleet, add, task
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.nodes.conversions.messages import LATCHED

pytestmark = pytest.mark.ros
SECOND = ('-r', '__node:=second')


@pytest.fixture
def fleet(probe):
    return Fleet(probe)


@pytest.fixture
def health(probe):
    """The last status of each allocator, by node."""
    found = {}

    def take(msg):
        for status in msg.status:
            if status.name.endswith(': allocation'):
                found[status.name.partition(':')[0]] = status

    probe.node.create_subscription(DiagnosticArray, '/diagnostics', take, 10)
    return found


def role(health, node):
    return {pair.key: pair.value for pair in health[node].values}['role'] if (
        node in health) else ''


def working(start, probe, fleet, *more):
    """An allocator whose UAV has a list and says that it holds it."""
    node = start('allocator', '-p', 'route_end:=hold', *more)
    fleet.connected()
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100), task('t2', 200)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2'])
    fleet.uav('a', 0.0, list_revision=fleet.lists['a'].revision)
    return node


def publishers(probe):
    return [probe.node.count_publishers(f'/{topic}') for topic in (
        'allocation', 'task_statuses', 'allocation_markers', 'a/task_list', 'a/path')]


@pytest.mark.parametrize('more', [(), ('-p', 'use_sim_time:=true')], ids=['wall', 'simulated'])
def test_finding_22_the_second_allocator_publishes_nothing_and_reports_it(
        start, probe, fleet, health, more):
    clock = probe.node.create_publisher(Clock, 'clock', LATCHED)
    clock.publish(Clock(clock=Time(sec=70)))
    working(start, probe, fleet, *more)
    probe.until(lambda: role(health, '/allocator') == 'leading')
    second = start('allocator', *more, *SECOND)
    probe.until(lambda: role(health, '/second') == 'passive')
    assert health['/second'].level == DiagnosticStatus.ERROR
    assert 'another allocator leads this fleet: /allocator (inst' in health['/second'].message
    assert second.output().count('another allocator leads this fleet') == 1
    probe.until(lambda: publishers(probe) == [1] * 5)
    fleet.tasks.publish(add(task('t3', 300)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2', 't3'])
    answer = probe.call(SubmitTasks, 'allocator/submit_tasks',
                        SubmitTasks.Request(announcement=add(task('t4', 400))))
    assert answer.accepted == ['t4']
    probe.until(lambda: fleet.route('a') == ['t1', 't2', 't3', 't4'])
    assert fleet.revisions['a'] == [1, 2, 3]  # of one allocator
    assert role(health, '/allocator') == 'leading'
    services = dict(probe.node.get_service_names_and_types())
    assert '/second/submit_tasks' not in services
    assert second.stop()[0] == 0


def test_finding_22_an_allocator_whose_journal_is_in_use_publishes_nothing(
        start, probe, fleet, health, tmp_path):
    state = ('-p', f'state_dir:={tmp_path}/state')
    working(start, probe, fleet, *state)
    second = start('allocator', *state, *SECOND)
    probe.until(lambda: role(health, '/second') == 'passive')
    assert 'database is locked' in health['/second'].message
    assert publishers(probe) == [1] * 5
    assert fleet.revisions['a'] == [1]
    assert second.stop()[0] == 0


def test_finding_22_a_killed_allocator_leads_again_after_its_restart(
        start, probe, fleet, health, tmp_path):
    state = ('-p', f'state_dir:={tmp_path}/state')
    first = working(start, probe, fleet, *state)
    second = start('allocator', *SECOND)
    probe.until(lambda: role(health, '/second') == 'passive')
    first.stop(signal.SIGKILL)
    health.clear()
    again = working(start, probe, fleet, *state)
    probe.until(lambda: role(health, '/allocator') == 'leading')
    probe.until(lambda: fleet.revisions['a'][-1] > 1)
    assert fleet.revisions['a'] == sorted(set(fleet.revisions['a']))
    assert 'passive' not in again.output()
    assert role(health, '/second') in ('', 'passive')
    assert second.stop()[0] == 0


def test_finding_22_a_replay_of_diagnostics_stops_no_allocator(start, probe, fleet, health):
    node = working(start, probe, fleet)
    values = {'allocation topic': '/allocation', 'instance': 'old', 'started': '1',
              'role': 'leading'}
    replay = probe.publisher(DiagnosticArray, '/diagnostics', 10)
    probe.until(lambda: role(health, '/allocator') == 'leading')
    for name in ('/old', '/bad'):
        values['started'] = {'/old': '1', '/bad': '²'}[name]
        replay.publish(DiagnosticArray(status=[DiagnosticStatus(
            name=f'{name}: allocation', values=[
                KeyValue(key=key, value=value) for key, value in values.items()])]))
    probe.until(lambda: "started = '²': expected a time" in node.output())
    fleet.tasks.publish(add(task('t3', 300)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2', 't3'])
