# SPDX-License-Identifier: Apache-2.0
"""Findings 23 and 24 with real nodes: journals of another origin, UAVs that are forgotten."""
import pytest
from test_allocator import Fleet, add, begin, task

from uav_task_alloc.allocator.persistence.restore import Saved
from uav_task_alloc.allocator.records import Outbox, UavList
from uav_task_alloc.allocator.state import admission
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
    assert other.popen.wait(20.0) == 1
    assert 'is of origin latitude 47.5' in other.output()
    assert 'expected that of the parameters, origin latitude 46.5' in other.output()
    assert 'Traceback' not in other.output()


def test_finding_24_the_publishers_of_a_forgotten_uav_are_gone(probe):
    world = World(AllocatorParams(), Saved())
    teller, painter = AllocationPublisher(probe.node, world), MarkerPublisher(probe.node, world)
    lists = {uav_id: UavList(uav_id, 1) for uav_id in ('real', 'ghost')}
    world.lists.lists.update(lists)

    def take(out):
        teller.take(out)
        painter.note(out)
        assert not teller.tell(0.0)

    def published(uav_id):
        return [probe.node.count_publishers(f'/{uav_id}/{topic}') for topic in (
            'task_list', 'path')]

    take(Outbox(lists=dict(lists)))
    assert published('real') == published('ghost') == [1, 1]
    admission.forget(world, 'ghost')
    take(world.outbox)
    probe.until(lambda: published('ghost') == [0, 0])
    assert published('real') == [1, 1]
    take(Outbox(forgotten={'real'}, lists={'real': lists['real']}))  # and heard again at once
    probe.until(lambda: published('real') == [1, 1])
    painter.on_look()
