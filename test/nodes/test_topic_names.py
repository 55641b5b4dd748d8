# SPDX-License-Identifier: Apache-2.0
"""A namespace and an id that are too long together: refused with a message; the nodes go on."""
import math

import pytest
from geometry_msgs.msg import Point
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, STATES

pytestmark = pytest.mark.ros
SPACE, LONG = '/' + 'n' * 120, 'u' * 150
REFUSED = 'expected at most 115 characters in namespace'


def state(uav_id):
    return m.UavState(uav_id=uav_id, position=Point(z=50.0), home=Point(x=math.nan),
                      battery=1.0, range_remaining=1e6, cruise_speed=15.0, available=True)


def task(name):
    return m.TaskAnnouncement(tasks=[m.Task(task_id=name, position=Point(x=9.0, z=50.0),
                                            value=1.0)])


def test_finding_31_an_id_too_long_for_its_namespace_is_refused_and_the_allocator_goes_on(
        start, probe):
    node = start('allocator', '-r', f'__ns:={SPACE}')
    states = probe.publisher(m.UavState, f'{SPACE}/uav_states', STATES)
    probe.publisher(m.TaskAnnouncement, f'{SPACE}/task_announcements', ANNOUNCEMENTS).publish(
        task('t1'))

    def reported(uav_id, words):
        states.publish(state(uav_id))
        return words in node.output()

    probe.until(lambda: reported(LONG, f"uav_states: uav_id = '{LONG[:20]}"), 20.0, node.output)
    assert REFUSED in node.output()
    lists = probe.collect(m.TaskList, f'{SPACE}/good/task_list', LATCHED)
    probe.until(lambda: reported('good', '') and lists, 60.0, node.output)
    assert [planned.task.task_id for planned in lists[-1].tasks] == ['t1']
    assert node.stop()[0] == 0


def test_finding_31_restored_lists_whose_topic_name_is_too_long_are_named(
        start, probe, tmp_path):
    before = start('allocator', '-p', f'state_dir:={tmp_path}')
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS).publish(task('t1'))
    lists = probe.collect(m.TaskList, f'{LONG}/task_list', LATCHED)
    probe.until(lambda: (states.publish(state(LONG)), lists)[1], 60.0, before.output)
    assert before.stop()[0] == 0
    after = start('allocator', '-p', f'state_dir:={tmp_path}', '-r', f'__ns:={SPACE}')
    probe.until(lambda: 'its task list is not published: uav_id = ' in after.output(), 20.0,
                after.output)
    probe.until(lambda: 'ready' in after.output(), 60.0, after.output)
    assert REFUSED in after.output()
    assert after.stop()[0] == 0


def test_finding_31_an_id_too_long_for_its_namespace_has_no_list_and_the_view_goes_on(
        start, probe):
    view = start('live_view', '-p', 'page:=false', '-r', f'__ns:={SPACE}')
    states = probe.publisher(m.UavState, f'{SPACE}/uav_states', STATES)

    def seen():
        states.publish(state(LONG))
        return REFUSED in view.output()

    probe.until(seen, 20.0, view.output)
    probe.until(lambda: (states.publish(state('good')), probe.node.count_subscribers(
        f'{SPACE}/good/task_list'))[1], 20.0, view.output)
    assert view.stop()[0] == 0
