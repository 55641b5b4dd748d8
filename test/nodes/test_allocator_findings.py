# SPDX-License-Identifier: Apache-2.0
"""Findings 23 and 24 with real nodes: journals of another origin, UAVs that are forgotten."""
import signal
import time

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Header
from test_allocator import Fleet, add, begin, task

from uav_task_alloc.allocator.core import make_safe_paths
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Outbox, SavedState
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.nodes.ros.allocation_publisher import AllocationPublisher
from uav_task_alloc.nodes.rviz.marker_publisher import MarkerPublisher
from uav_task_alloc.params import AllocatorParams

pytestmark = pytest.mark.ros


@pytest.fixture
def fleet(probe):
    return Fleet(probe)


def test_finding_23_a_journal_of_another_origin_ends_the_start(start, probe, fleet, tmp_path):
    state = ('-p', f'state_dir:={tmp_path}/state')
    node = begin(start, fleet, *state, '-p', 'origin.latitude:=47.5')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    assert node.stop()[0] == 0
    other = start('allocator', *state, '-p', 'origin.latitude:=46.5')
    assert other.popen.wait(90) == 1
    assert 'is of origin latitude 47.5' in other.output()
    assert 'expected that of the parameters, origin latitude 46.5' in other.output()
    assert 'Traceback' not in other.output()


def test_diagnostics_name_a_uav_of_a_machine_with_another_clock(start, probe, fleet):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    begin(start, fleet)
    ahead = probe.node.get_clock().now().seconds_nanoseconds()[0] + 3600
    fleet.uav('a', 0.0, header=Header(stamp=Time(sec=ahead)))
    probe.until(lambda: any('reports of a are stamped 3' in row.message
                            for msg in health for row in msg.status))


def test_diagnostics_say_that_simulated_time_stands_still(start, probe, fleet):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    begin(start, fleet, '-p', 'use_sim_time:=true')
    probe.until(lambda: any('nothing publishes /clock: waiting for it' in row.message
                            and row.level == DiagnosticStatus.WARN
                            for msg in health for row in msg.status))


def test_a_uav_is_not_silent_where_the_allocator_itself_was_stopped(start, probe, fleet):
    node = begin(start, fleet, '-p', 'uav_timeout:=1.0')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    for n in range(2, 6):
        node.popen.send_signal(signal.SIGSTOP)
        again = time.monotonic() + 2.0
        probe.until(lambda again=again: time.monotonic() > again)  # the UAV reports on
        node.popen.send_signal(signal.SIGCONT)
        fleet.tasks.publish(add(task(f't{n}', 100 * n)))
        probe.until(lambda name=f't{n}': name in fleet.route('a'))
    assert 'silent' not in node.output()


def test_finding_24_the_publishers_of_a_forgotten_uav_are_destroyed(probe):
    world = World(AllocatorParams(), SavedState(), make_safe_paths, lambda *_: None)
    publisher = AllocationPublisher(probe.node, world)
    marker_publisher = MarkerPublisher(probe.node, world)
    lists = {uav_id: UavList(uav_id, 1) for uav_id in ('real', 'ghost')}
    world.lists.lists.update(lists)

    def publish(outbox):
        publisher.enqueue(outbox)
        marker_publisher.update(outbox)
        probe.until(lambda: not publisher.publish_some(0.0))  # a time slice at a time

    def publishers(uav_id):
        return [probe.node.count_publishers(f'/{uav_id}/{topic}') for topic in (
            'task_list', 'path')]

    publish(Outbox(lists=dict(lists)))
    assert publishers('real') == publishers('ghost') == [1, 1]
    world.forget_uav('ghost')
    publish(world.outbox)
    probe.until(lambda: publishers('ghost') == [0, 0])
    assert publishers('real') == [1, 1]
    # reported again at once
    publish(Outbox(forgotten={'real'}, lists={'real': lists['real']}))
    probe.until(lambda: publishers('real') == [1, 1])
    marker_publisher.on_timer()
