# SPDX-License-Identifier: Apache-2.0
"""Nodes whose origins differ refuse to fly, say so, and go on when they agree."""
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger
from test_allocator import Fleet, S, add, begin, task
from test_mavlink_bridge import Sky
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.nodes.conversions.messages import LATCHED
from uav_task_alloc.nodes.ros.origin_check import MOST_ORIGINS, ORIGIN_TIMEOUT, OriginReports

pytestmark = pytest.mark.ros
HERE = Origin(47.397742, 8.545594, 488.0)
OTHER = m.FleetOrigin(latitude=47.4, longitude=8.545594, altitude_amsl=488.0)
SAME = m.FleetOrigin(latitude=47.397742, longitude=8.545594, altitude_amsl=488.0)
WHY = ('fleet_origin of another node is (47.4000000, 8.5455940, 488 m), 251.061 m from origin.* '
       '= (47.3977420, 8.5455940, 488 m) of this one: expected the same')


@pytest.fixture
def sky(start, probe, tmp_path):
    sky = Sky(start, probe, tmp_path / 'flight.jsonl')
    yield sky
    if sky.thread.is_alive():
        sky.land()


def publish_origin(probe, origin):
    """Publish this origin, as another node would."""
    publisher = probe.publisher(m.FleetOrigin, 'fleet_origin', LATCHED)
    publisher.publish(origin)
    return publisher


def messages(health):
    return [status.message for array in health for status in array.status]


@pytest.mark.parametrize('executable', ['allocator', 'mavlink_bridge'])
def test_finding_37_both_nodes_publish_their_origin(start, probe, executable):
    origins = probe.collect(m.FleetOrigin, 'fleet_origin', LATCHED)
    start(executable, '-p', 'origin.latitude:=-33.9', '-p', 'origin.longitude:=151.2', '-p',
          'origin.altitude_amsl:=40.0', *(
              ['-p', "connections:=['udpin:127.0.0.1:0']"] * (executable == 'mavlink_bridge')))
    probe.until(lambda: origins)
    assert origins[0] == m.FleetOrigin(latitude=-33.9, longitude=151.2, altitude_amsl=40.0)


def test_finding_37_a_bridge_flies_no_list_while_a_node_has_another_origin(sky, probe):
    other = publish_origin(probe, OTHER)
    probe.until(lambda: sky.states['uav_1'].reason == WHY)
    for n in (1, 2):
        sky.send(n, 1, [0])
    assert not sky.states['uav_1'].available
    probe.until(lambda: f'refuses to fly new lists: {WHY}' in messages(sky.health))
    assert f'refuses to fly new lists: {WHY}' in sky.bridge.output()
    assert sky.fact(1, 'list_revision') == '0'
    probe.node.destroy_publisher(other)
    probe.until(lambda: all(sky.completed(n) == [f'u{n}_0'] for n in (1, 2)), 60.0)
    assert sky.states['uav_1'].reason == ''


def test_finding_37_a_vehicle_on_the_ground_stays_there_when_another_origin_appears(sky, probe):
    sky.send(1, 1, [0, 1, 2])
    probe.until(lambda: sky.states['uav_1'].mode == m.UavState.ON_MISSION)
    other = publish_origin(probe, OTHER)
    sky.send(2, 1, [0])
    probe.until(lambda: sky.states['uav_2'].reason == WHY)
    # who flies already flies on
    probe.until(lambda: sky.completed(1) == ['u1_0', 'u1_1', 'u1_2'], 60.0)
    assert sky.states['uav_2'].mode == m.UavState.STANDBY
    probe.node.destroy_publisher(other)
    probe.until(lambda: sky.completed(2) == ['u2_0'], 60.0)


def test_finding_37_an_allocator_of_another_origin_is_not_flown(sky, start, probe):
    plans = probe.collect(m.Allocation, 'allocation', LATCHED)
    fleet = Fleet(probe)
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    allocator = start('allocator', '-p', 'origin.latitude:=47.4')
    fleet.connected()
    fleet.tasks.publish(add(task('t0', 100)))
    probe.until(lambda: sky.states['uav_1'].reason == WHY)
    probe.until(lambda: any('refuses to plan: fleet_origin' in each for each in messages(health)))
    allocator.stop()
    probe.until(lambda: sky.states['uav_1'].reason == '')
    assert not plans or not plans[-1].lists
    begin(start, fleet)
    fleet.tasks.publish(add(task('t1', 100)))
    fleet.until_state('t1', S.COMPLETED)


def in_conflict(start, probe):
    """(fleet, publisher of the other origin, allocator that refuses to plan for it)."""
    fleet = Fleet(probe)
    other = publish_origin_first(probe)
    node = begin(start, fleet)
    probe.until(lambda: 'refuses to plan: fleet_origin' in node.output())
    fleet.uav('a', 0.0)
    return fleet, other, node


def test_finding_37_an_allocator_resumes_planning_when_the_other_origin_disappears(start, probe):
    fleet, other, _ = in_conflict(start, probe)
    fleet.tasks.publish(add(task('t0', 100)))
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    probe.until(lambda: any('refuses to plan' in each for each in messages(health)))
    assert fleet.route('a') is None
    probe.node.destroy_publisher(other)
    probe.until(lambda: fleet.route('a') == ['t0'])


def test_while_origins_differ_holds_are_published_and_orders_by_lists_are_refused(start, probe):
    fleet, other, node = in_conflict(start, probe)
    holds = probe.collect(m.UavHold, 'a/hold', LATCHED)

    def paused():
        return probe.call(srv.PauseUav, 'allocator/pause_uav', srv.PauseUav.Request(
            uav_id='a', keep_tasks=True)).success

    probe.until(paused)  # once the UAV has reported
    probe.until(lambda: holds and holds[-1].hold)
    probe.until(lambda: 'unnamed: pause a' in node.output())
    for kind, name, request in (
            (srv.ReturnUav, 'return_uav', srv.ReturnUav.Request(uav_id='a')),
            (srv.PinTask, 'pin_task', srv.PinTask.Request(uav_id='a', task_id='t0')),
            (srv.ApprovePlan, 'approve_plan', srv.ApprovePlan.Request(accept=True))):
        answer = probe.call(kind, f'allocator/{name}', request)
        assert not answer.success
        assert answer.message.startswith('refused: nothing is planned: fleet_origin of another')
    replan = probe.call(Trigger, 'allocator/replan', Trigger.Request())
    assert (replan.success, replan.message[:33]) == (False, 'nothing is planned: fleet_origin ')
    assert probe.call(srv.ResumeUav, 'allocator/resume_uav',
                      srv.ResumeUav.Request(uav_id='a')).success
    probe.until(lambda: not holds[-1].hold)
    probe.node.destroy_publisher(other)
    fleet.tasks.publish(add(task('t0', 100)))
    probe.until(lambda: fleet.route('a') == ['t0'])


def publish_origin_first(probe):
    """Publish another origin before there is a subscriber."""
    publisher = probe.node.create_publisher(m.FleetOrigin, 'fleet_origin', LATCHED)
    publisher.publish(OTHER)
    return publisher


def test_the_same_origin_and_an_invalid_one_change_nothing(sky, probe):
    publish_origin(probe, SAME)
    publish_origin(probe, m.FleetOrigin(latitude=float('nan')))
    sky.send(1, 1, [0])
    probe.until(lambda: sky.completed(1) == ['u1_0'])
    probe.until(lambda: 'fleet_origin: origin latitude = nan' in sky.bridge.output())


def test_origins_a_millimetre_apart_are_the_same():
    origins = OriginReports(HERE)
    origins.add(Origin(47.39774201, 8.54559401, 488.001))
    assert origins.conflict(0.0) == ''
    origins.add(Origin(47.397742, 8.545594, 488.1))
    assert '0.1 m from origin.*' in origins.conflict(0.0)


def test_a_conflict_lasts_until_the_remaining_nodes_could_publish_again():
    origins = OriginReports(HERE)
    origins.add(Origin(47.4, 8.5, 488.0))
    origins.on_node_left(10.0)
    assert origins.conflict(10.0 + 0.9 * ORIGIN_TIMEOUT)
    assert origins.conflict(10.0 + ORIGIN_TIMEOUT) == ''
    origins.add(Origin(47.4, 8.5, 488.0))
    assert origins.conflict(11.0 + ORIGIN_TIMEOUT)


def test_a_flood_of_origins_is_bounded():
    origins = OriginReports(HERE)
    for k in range(10 * MOST_ORIGINS):
        origins.add(Origin(float(k % 90), 8.5, float(k)))
    assert len(origins._differing) == MOST_ORIGINS
