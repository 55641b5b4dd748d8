# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs are sent to waiting places by a running allocator, and leave them for tasks."""
import math

import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from std_srvs.srv import Trigger
from test_allocator import add, begin, fleet, task
from uav_task_alloc_msgs import msg as m

pytestmark = pytest.mark.ros
__all__ = ['fleet']  # a fixture
HELD = {'authority': m.UavState.HELD, 'mode': m.UavState.HOLD, 'range_remaining': 60_000.0}
AROUND = [task(f's{k}', 2500.0 + 40.0 * k, 2500.0, service_time=Duration()) for k in range(20)]
LEARNT = '-p', 'anticipate:=learnt', '-p', 'objective:=response'


def place(fleet, uav_id='a'):
    """The last point of a list without tasks that does not return; None: there is none."""
    msg = fleet.lists.get(uav_id)
    if msg is None or msg.tasks or msg.end != m.TaskList.HOLD or not msg.end_via:
        return None
    return msg.end_via[-1]


def see(fleet):
    """Announce tasks in one place, and withdraw them."""
    fleet.tasks.publish(add(*AROUND))
    fleet.until_state('s19', m.TaskStatus.PENDING)
    fleet.tasks.publish(add(*AROUND, action=m.TaskAnnouncement.CANCEL))
    fleet.until_state('s19', m.TaskStatus.CANCELLED)


def texts(health):
    """What the diagnostics say of waiting."""
    return {pair.key: pair.value for msg in health[-3:] for status in msg.status
            for pair in status.values if pair.key.startswith('waiting of ')}


def test_an_idle_uav_waits_where_tasks_came_from_and_leaves_for_one(start, probe, fleet, tmp_path):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    process = begin(start, fleet, *LEARNT, '-p', f'state_dir:={tmp_path}')
    see(fleet)
    fleet.uav('a', 0.0, home=Point(), **HELD)
    probe.until(lambda: place(fleet), 30.0)
    there = place(fleet)
    assert math.dist((there.x, there.y), (2900.0, 2500.0)) < 1500.0
    probe.until(lambda: texts(health).get('waiting of a', '').startswith('waits at ('))
    probe.until(lambda: fleet.allocations[-1].trigger == 'waiting places')
    process.stop()
    fleet.lists['a'] = None
    begin(start, fleet, *LEARNT, '-p', f'state_dir:={tmp_path}')
    probe.until(lambda: place(fleet) == there, 30.0)
    fleet.tasks.publish(add(task('t1', 300.0)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    assert not fleet.lists['a'].end_via
    answer = probe.call(Trigger, 'allocator/forget_demand', Trigger.Request())
    assert (answer.success, answer.message) == (True, '21 announcements forgotten')


def test_by_default_an_idle_uav_gets_no_list(start, probe, fleet):
    begin(start, fleet)
    see(fleet)
    fleet.uav('a', 0.0, home=Point(), **HELD)
    fleet.uav('b', 100.0, home=Point(), **HELD)
    fleet.tasks.publish(add(task('t1', 101.0)))
    probe.until(lambda: fleet.route('b') == ['t1'])
    assert fleet.lists['a'] is None
