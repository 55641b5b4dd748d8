# SPDX-License-Identifier: Apache-2.0
"""A bridge that exits completes a running upload first, and names the airborne UAVs."""
import signal
from threading import Event, Timer
from types import SimpleNamespace

import pytest
from test_mavlink_bridge import Sky
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.ros.bridge_shutdown import UPLOAD_TIMEOUT, BridgeShutdown

pytestmark = pytest.mark.ros
MANY = 150  # tasks


@pytest.fixture
def sky(start, probe, tmp_path):
    made = Sky(start, probe, tmp_path / 'flight.jsonl')
    yield made
    if made.thread.is_alive():
        made.land()


def hold_for_an_upload(sky, probe):
    """Let the ArduPilot vehicle hold while its mission is replaced.

    Returns an event: until it is set the upload does not end, as its items are lost from the
    middle on.
    """
    vehicle, may_end = sky.fleet.vehicles['uav_1'], Event()
    receive = vehicle.receive

    def receive_first(message, now):
        lost = message.get_type() == 'MISSION_ITEM_INT' and message.seq > MANY // 2
        return [] if lost and not may_end.is_set() else receive(message, now)
    vehicle.receive = receive_first
    sky.send(1, 1, [0, 1, 2, 3])
    probe.until(lambda: sky.completed(1))
    sky.send(1, 2, [*range(4, MANY), 2])
    probe.until(lambda: sky.states['uav_1'].mode == m.UavState.HOLD
                and sky.states['uav_1'].mission_state == m.UavState.UPLOADING)
    return may_end


def test_finding_36_a_bridge_exits_after_a_running_upload(sky, probe):
    may_end = hold_for_an_upload(sky, probe)
    Timer(1.0, may_end.set).start()
    code, output = sky.bridge.stop(signal.SIGINT, 30)
    assert code == 0, output
    assert 'exits after the upload to uav_1' in output
    assert 'exits while airborne: uav_1' in output
    assert 'held in the air' not in output
    # it flies the new list without a bridge, after some of the old one, each once
    old = ['u1_0', 'u1_1', 'u1_2', 'u1_3']
    probe.until(lambda: set(sky.flown(1)) - set(old))
    flown = sky.flown(1)
    begun = next(k for k, task in enumerate(flown) if task not in old)
    assert flown[:begun + 1] == [*old[:begun], 'u1_4']


def test_finding_36_an_upload_that_never_completes_delays_the_exit_for_a_limited_time(sky, probe):
    hold_for_an_upload(sky, probe)
    sky.fleet.set_alive('uav_1', False)
    code, output = sky.bridge.stop(signal.SIGINT, 60)
    assert code == 0, output
    assert 'exits while held in the air for a new list: uav_1' in output


def test_a_bridge_that_exits_takes_no_list_and_starts_no_take_off(sky, probe):
    may_end = hold_for_an_upload(sky, probe)
    sky.bridge.popen.send_signal(signal.SIGINT)
    probe.until(lambda: 'exits after the upload' in sky.bridge.output())
    sky.send(2, 1, [0])
    may_end.set()
    assert sky.bridge.popen.wait(30) == 0
    assert sky.states['uav_2'].mode == m.UavState.STANDBY
    assert sky.states['uav_2'].list_revision == 0


def session(uav_id, airborne, replacing_since, lost=False):
    return SimpleNamespace(uav_id=uav_id, executor=SimpleNamespace(
        telemetry=SimpleNamespace(
            airborne=airborne, link=SimpleNamespace(lost=lambda now: lost)),
        watch=SimpleNamespace(replacing_since=replacing_since)))


def test_an_upload_delays_the_exit_for_at_most_its_timeout():
    fleet = [session('a', True, None), session('b', True, 5.0)]
    assert not BridgeShutdown().waits(fleet[:1], 5.0)
    shutdown = BridgeShutdown()
    assert shutdown.waits(fleet, 100.0)
    assert shutdown.waits(fleet, 100.0 + 0.9 * UPLOAD_TIMEOUT)
    assert not shutdown.waits(fleet, 100.0 + UPLOAD_TIMEOUT)


def test_an_upload_to_a_lost_vehicle_delays_no_exit():
    lost = session('a', True, 5.0, lost=True)
    assert not BridgeShutdown().waits([lost], 100.0)
    assert BridgeShutdown().waits([lost, session('b', True, 5.0)], 100.0)
    assert 'held in the air for a new list: a' in BridgeShutdown.warnings([lost])[0]


def test_every_airborne_uav_is_named():
    fleet = [session('a', True, None), session('b', True, 5.0), session('c', False, None),
             session('d', True, None)]
    flying, held = BridgeShutdown.warnings(fleet)
    assert flying.startswith('exits while airborne: a, d; ')
    assert held.startswith('exits while held in the air for a new list: b; ')
    assert BridgeShutdown.warnings(fleet[2:3]) == []
