# SPDX-License-Identifier: Apache-2.0
"""An allocator that keeps UAVs apart in flight, as others meet it: alerts, holds, diagnostics."""
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Vector3
from test_allocator import Fleet, add, begin, task
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED

pytestmark = pytest.mark.ros
U, A = m.UavState, m.SeparationAlert
RULE = ('-p', 'separation.horizontal:=10.0', '-p', 'separation.vertical:=5.0')
OWN = {'mode': U.ON_MISSION, 'authority': U.HELD, 'cruise_speed': 10.0, 'home': Point(x=-500.0)}


@pytest.fixture
def fleet(probe):
    fleet = Fleet(probe)
    fleet.alerts = probe.collect(A, 'separation_alerts', EVENTS)
    fleet.holds = {name: probe.collect(m.UavHold, f'{name}/hold', LATCHED) for name in 'ab'}
    fleet.health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    return fleet


def fly(fleet, uav_id, x, y, east, north=0.0, **more):
    fleet.uav(uav_id, x, y, velocity=Vector3(x=east, y=north), **more)


def alerts(fleet, action):
    return [each for each in fleet.alerts if each.action == action]


def until_action(fleet, action):
    """The first alert with this action."""
    fleet.probe.until(lambda: alerts(fleet, action), facts=lambda: fleet.alerts)
    return alerts(fleet, action)[0]


def warnings(fleet):
    return ' '.join(pair.value for each in fleet.health for status in each.status
                    for pair in status.values if pair.key.startswith('warning of'))


def test_a_uav_holds_for_a_pilot_who_crosses_and_goes_on_after_him(start, probe, fleet):
    begin(start, fleet, *RULE)
    fly(fleet, 'a', 0.0, 0.0, 10.0, **OWN)
    fleet.tasks.publish(add(task('t', 600)))
    probe.until(lambda: fleet.route('a') == ['t'])
    fly(fleet, 'b', 70.0, 70.0, 0.0, -10.0, authority=U.LOST, available=False, mode=U.ON_MISSION)
    alert = until_action(fleet, A.HOLD)
    assert (list(alert.uavs), alert.holder, alert.reason) == (['a', 'b'], 'a', 'a holds for b')
    assert alert.horizontal < 10.0
    assert alert.vertical < 5.0
    probe.until(lambda: fleet.holds['a'])
    hold = fleet.holds['a'][0]
    assert (hold.uav_id, hold.hold, hold.source) == ('a', True, m.UavHold.SEPARATION)
    assert hold.reason == 'a holds for b'
    assert hold.expires.sec - hold.header.stamp.sec == 60
    probe.until(lambda: 'a holds for b' in warnings(fleet))
    fly(fleet, 'a', 0.0, 0.0, 0.0, **{**OWN, 'mode': U.HOLD})
    fly(fleet, 'b', 70.0, -120.0, 0.0, -10.0, authority=U.LOST, available=False,
        mode=U.ON_MISSION)
    assert until_action(fleet, A.RELEASE).holder == 'a'
    probe.until(lambda: not fleet.holds['a'][-1].hold)
    assert fleet.holds['a'][-1].source == m.UavHold.SEPARATION
    assert not fleet.holds['b']  # a pilot is never held
    assert fleet.route('a') == ['t']


def test_head_on_both_stop_and_it_is_said_that_no_hold_keeps_them_apart(start, probe, fleet):
    node = begin(start, fleet, *RULE)
    fly(fleet, 'a', 0.0, 0.0, 10.0, **OWN)
    fly(fleet, 'b', 3000.0, 0.0, -10.0, **OWN)
    fleet.tasks.publish(add(task('ta', 1600, allowed_uavs=['a']),
                            task('tb', -100, allowed_uavs=['b'])))
    probe.until(lambda: fleet.route('a') == ['ta'] and fleet.route('b') == ['tb'])
    fly(fleet, 'a', 700.0, 0.0, 10.0, **OWN)
    fly(fleet, 'b', 760.0, 0.0, -10.0, **OWN)
    alert = until_action(fleet, A.UNRESOLVED)
    assert list(alert.uavs) == ['a', 'b']
    assert 'no hold keeps them apart' in alert.reason
    for name, holds in fleet.holds.items():
        probe.until(lambda holds=holds: holds, facts=lambda: fleet.alerts)
        assert (holds[0].uav_id, holds[0].hold, holds[0].source) == (
            name, True, m.UavHold.SEPARATION)
    probe.until(lambda: 'a and b would be' in node.output())
    probe.until(lambda: 'a and b would be' in warnings(fleet))
