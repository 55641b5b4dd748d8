# SPDX-License-Identifier: Apache-2.0
import pytest
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS
from uav_task_alloc.nodes.ros.held_announcements import HeldAnnouncements


def add(frame, task_id='t1'):
    return m.TaskAnnouncement(action=m.TaskAnnouncement.ADD,
                              tasks=[m.Task(task_id=task_id, frame=frame)])


def test_announcements_wait_from_the_first_in_wgs84_on_and_keep_their_order():
    lines = []
    held = HeldAnnouncements(lines.append)
    assert not held.holds(add(m.Task.LOCAL, 'a'))
    messages = [add(m.Task.WGS84, 'b'), add(m.Task.LOCAL, 'c'),
                m.TaskAnnouncement(action=m.TaskAnnouncement.CANCEL)]
    assert all(held.holds(msg) for msg in messages)
    assert lines == ['tasks in WGS84, and later ones, wait for fleet_origin']
    assert list(held.release()) == messages
    assert list(held.release()) == []
    assert not held.holds(add(m.Task.LOCAL, 'd'))


def test_no_more_wait_than_the_topic_keeps():
    held = HeldAnnouncements([].append)
    for _ in range(ANNOUNCEMENTS.depth):
        assert held.holds(add(m.Task.WGS84))
    with pytest.raises(InvalidValue, match="fleet_origin = 'unknown': expected an origin"):
        held.holds(add(m.Task.LOCAL))
    assert len(list(held.release())) == ANNOUNCEMENTS.depth
