# SPDX-License-Identifier: Apache-2.0
"""Holds and returns through a real bridge to both simulated autopilots, over a kill."""
import math
import signal

import pytest
from builtin_interfaces.msg import Time
from test_mavlink_bridge import Sky
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import ReturnUav, UndoOrder

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, announcement

pytestmark = pytest.mark.ros
S = m.UavState


@pytest.fixture
def sky(start, probe, tmp_path):
    sky = Sky(start, probe, tmp_path / 'flight.jsonl', '-p', f'state_dir:={tmp_path}/bridge')
    sky.holds = {n: probe.node.create_publisher(m.UavHold, f'uav_{n}/hold', LATCHED)
                 for n in (1, 2)}
    yield sky
    sky.land()


def modes(sky):
    return {n: sky.states[f'uav_{n}'].mode for n in (1, 2)}


def test_a_hold_is_flown_by_both_autopilots_and_outlives_a_kill_of_the_bridge(sky):
    probe = sky.probe
    for n in (1, 2):
        sky.send(n, 1, range(1, 9))
    held = set()

    def hold_those_on_their_way():  # at once: the other one may take off much later
        for n, publisher in sky.holds.items():
            if n not in held and modes(sky)[n] == S.ON_MISSION:
                held.add(n)
                publisher.publish(
                    m.UavHold(uav_id=f'uav_{n}', hold=True, reason='order o1 of ann'))
        return held == {1, 2}

    probe.until(hold_those_on_their_way, 90.0)
    probe.until(lambda: all(mode == S.HOLD for mode in modes(sky).values()), 60.0)
    for publisher in sky.holds.values():  # as if the allocator were down, too
        probe.node.destroy_publisher(publisher)
    sky.bridge.stop(signal.SIGKILL)
    sky.again()
    probe.until(lambda: sky.fact(1, 'held_by') == 'operator: order o1 of ann', 60.0)
    for n in (1, 2):
        sky.send(n, 2, range(1, 9))
    probe.until(lambda: all(sky.states[f'uav_{n}'].list_revision == 2 for n in (1, 2)), 60.0)
    assert set(modes(sky).values()) == {S.HOLD}
    done = {n: len(sky.completed(n)) for n in (1, 2)}
    assert all(count < 8 for count in done.values())
    for n in (1, 2):
        probe.node.create_publisher(m.UavHold, f'uav_{n}/hold', LATCHED).publish(
            m.UavHold(uav_id=f'uav_{n}', hold=False, reason='resumed'))
    probe.until(lambda: all(f'u{n}_8' in sky.completed(n) for n in (1, 2)), 120.0)


def test_a_separation_hold_expires_and_a_bad_message_is_named(sky):
    probe = sky.probe
    sky.send(1, 1, range(1, 9))
    probe.until(lambda: modes(sky)[1] == S.ON_MISSION, 90.0)
    sky.holds[1].publish(m.UavHold(uav_id='uav_2', hold=True))
    now = probe.node.get_clock().now().to_msg()
    sky.holds[1].publish(m.UavHold(
        uav_id='uav_1', hold=True, source=m.UavHold.SEPARATION, reason='uav_2 passes',
        expires=Time(sec=now.sec + 8, nanosec=now.nanosec)))
    probe.until(lambda: modes(sky)[1] == S.HOLD, 30.0)
    probe.until(lambda: modes(sky)[1] == S.ON_MISSION, 60.0)
    sky.holds[1].publish(m.UavHold(
        uav_id='uav_1', hold=True, source=m.UavHold.SEPARATION,
        expires=Time(sec=now.sec - 600)))
    probe.until(lambda: any('uav_1/hold: a hold to keep UAVs separate expired 6' in row.message
                            for array in sky.health for row in array.status
                            if row.name.endswith('holds')))
    text = sky.bridge.output()
    assert 'before it came, and is ignored: expected machines whose clocks agree' in text
    assert "uav_1/hold: uav_id = 'uav_2': expected uav_1: ignored" in text
    assert 'goes on: separation ended its hold' in text


def start_allocator(start, *more):
    return start('allocator', '-p', 'route_end:=hold', '-p', 'uav_timeout:=60.0', *more)


def give_work(start, probe, sky, *more):
    """Start an allocator and wait until both UAVs fly to its tasks, which are far apart."""
    sky.allocator = start_allocator(start, *more)
    tasks = [Task(f't{k}', (600.0 * (k % 2) - 300.0, 600.0 + 150.0 * k, 50.0)) for k in range(6)]
    probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS).publish(
        announcement(m.TaskAnnouncement.ADD, tasks, 1.0))
    probe.until(lambda: all(mode == S.ON_MISSION for mode in modes(sky).values()), 150.0)
    return {task.id for task in tasks}


def order_home(probe, uav_id, dry_run=False):
    return probe.call(ReturnUav, 'allocator/return_uav',
                      ReturnUav.Request(uav_id=uav_id, operator_name='ann', dry_run=dry_run))


@pytest.mark.parametrize('n', [1, 2])
def test_a_uav_that_is_ordered_home_lands_there_and_its_tasks_move_on(start, probe, sky, n):
    tasks = give_work(start, probe, sky)
    given = order_home(probe, f'uav_{n}')
    assert (given.success, given.order_id) == (True, 'o1'), given.message
    probe.until(lambda: modes(sky)[n] in (S.RETURNING, S.LANDING), 60.0)
    probe.until(lambda: modes(sky)[n] == S.STANDBY and sky.states[f'uav_{n}'].authority == S.NONE,
                120.0)
    place = sky.states[f'uav_{n}'].position
    assert math.hypot(place.x - 20.0 * n, place.y) < 3.0  # of its home, where it started
    assert abs(place.z) < 1.0
    probe.until(lambda: {*sky.completed(1), *sky.completed(2)} == tasks, 120.0)
    assert modes(sky)[n] == S.STANDBY


@pytest.mark.parametrize('n', [1, 2])
def test_a_return_by_order_outlives_a_kill_of_either_node(start, probe, sky, tmp_path, n):
    state = ('-p', f'state_dir:={tmp_path}/state')
    tasks = give_work(start, probe, sky, *state)
    assert order_home(probe, f'uav_{n}').order_id == 'o1'
    probe.until(lambda: modes(sky)[n] == S.RETURNING, 60.0)
    sky.allocator.stop(signal.SIGKILL)
    sky.bridge.stop(signal.SIGKILL)
    done = set(sky.completed(n))
    sky.again()
    start_allocator(start, *state)
    probe.until(lambda: modes(sky)[n] == S.STANDBY, 120.0)
    place = sky.states[f'uav_{n}'].position
    assert math.hypot(place.x - 20.0 * n, place.y) < 3.0  # of its home, where it started
    probe.until(lambda: {*sky.completed(1), *sky.completed(2)} == tasks, 120.0)
    assert set(sky.completed(n)) == done
    assert modes(sky)[n] == S.STANDBY
    undone = probe.call(UndoOrder, 'allocator/undo_order',
                        UndoOrder.Request(order_id='o1', operator_name='ann'))
    assert undone.success, undone.message


def test_a_uav_of_a_pilot_is_not_ordered_home(start, probe, sky):
    give_work(start, probe, sky)
    with sky.fleet._lock:
        assert sky.fleet.vehicles['uav_1'].rc_mode(5)  # LOITER, by the switch
    probe.until(lambda: sky.states['uav_1'].authority == S.LOST)
    probe.until(lambda: not order_home(probe, 'uav_1', True).success)
    refused = order_home(probe, 'uav_1')
    assert 'uav_1, whose bridge has no authority (' in refused.message
    assert 'LOITER' in refused.message
    all_others = order_home(probe, '')
    assert all_others.success
    assert 'uav_1, whose bridge has no authority (' in all_others.message
    probe.until(lambda: modes(sky)[2] == S.STANDBY and sky.states['uav_2'].authority == S.NONE,
                120.0)
    assert sky.states['uav_1'].authority == S.LOST
    assert modes(sky)[1] == S.UNKNOWN  # LOITER still, which is no mode of the bridge
