# SPDX-License-Identifier: Apache-2.0
"""Holds on `<uav_id>/hold` through a real bridge to both simulated autopilots, over a kill."""
import signal

import pytest
from builtin_interfaces.msg import Time
from test_mavlink_bridge import Sky
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import LATCHED

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
    probe.until(lambda: all(mode == S.ON_MISSION for mode in modes(sky).values()), 90.0)
    for n, publisher in sky.holds.items():
        publisher.publish(m.UavHold(uav_id=f'uav_{n}', hold=True, reason='order o1 of ann'))
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
    text = sky.bridge.output()
    assert "uav_1/hold: uav_id = 'uav_2': expected uav_1: ignored" in text
    assert 'goes on: separation ended its hold' in text
