# SPDX-License-Identifier: Apache-2.0
"""scenario_player as a process: what it announces, when, and what it does before and after."""
import pytest
from rosgraph_msgs.msg import Clock
from test_allocator import Fleet
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc import scenario
from uav_task_alloc.model import Shape
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, from_stamp, to_stamp
from uav_task_alloc.nodes.scenario_player import describe

TEXT = """uavs:
  - {id: uav_1, position: [0, 0, 0], dies_at: 4}
tasks:
  - {id: t1, position: [10, 20, 30], value: 2.5, service_time: 1.5}
  - {id: t2, position: [40, 50, 60], at: 6}
zones:
  - {id: z1, shape: hemisphere, center: [500, 0, 0], radius: 80, margin: 5}
  - {id: z2, shape: polygon, vertices: [[0, 300], [9, 300], [9, 309]], appears: 2, vanishes: 5}
cancels:
  - {task: t1, at: 8}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / 'play.yaml'
    path.write_text(TEXT)
    return path


def test_a_moment_of_many_tasks_names_the_first_20():
    tasks = ''.join(f'  - {{id: t{n}, position: [{n}, 0, 30]}}\n' for n in range(1000))
    uavs = 'uavs:\n  - {id: uav_1, position: [0, 0, 0]}\n'
    moment = scenario.timeline(scenario.parse(uavs + 'tasks:\n' + tasks))[0]
    line = describe(moment)
    assert line.startswith('0.0 s: ')
    assert line.endswith('t18, t19 and 980 more')


def test_everything_is_announced_in_order_at_its_time(start, probe, file):
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    zones = probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    deaths = []

    def set_alive(request, response):
        deaths.append((request.uav_id, request.available))
        response.success = True
        return response

    probe.node.create_service(SetAvailability, 'fleet_sim/set_alive', set_alive)
    start('scenario_player', '-p', f'scenario:={file}', '-p', 'speedup:=8.0')
    probe.until(lambda: len(tasks) == 3 and len(zones) == 3 and deaths)

    add, cancel = m.TaskAnnouncement.ADD, m.TaskAnnouncement.CANCEL
    assert [(msg.action, [task.task_id for task in msg.tasks]) for msg in tasks] == [
        (add, ['t1']), (add, ['t2']), (cancel, ['t1'])]
    first, second, third = (from_stamp(msg.header.stamp) for msg in tasks)
    assert second - first >= 6.0 / 8.0 - 0.1
    assert third - second >= 2.0 / 8.0 - 0.1
    task = tasks[0].tasks[0]
    assert (task.position.x, task.value, from_stamp(task.service_time)) == (10.0, 2.5, 1.5)
    assert [[zone.zone_id for zone in msg.zones] for msg in zones] == [
        ['z1'], ['z1', 'z2'], ['z1']]
    assert zones[0].zones[0].shape == Shape.HEMISPHERE.value
    assert deaths == [('uav_1', False)]


def test_orders_are_given_when_their_tasks_are_planned(start, probe, tmp_path):
    path = tmp_path / 'ordered.yaml'
    more = '\n  - {id: uav_2, position: [9, 0, 0]}\ntasks:\n  - {id: t3, position: [90, 0, 50]}'
    path.write_text(TEXT.replace(', dies_at: 4', '').replace('at: 8', 'at: 40').replace(
        '\ntasks:', more) + """orders:
  - {at: 0.5, order: pin, uav: uav_2, tasks: [t3]}
  - {at: 1, order: next, uav: uav_1, tasks: [t1]}
  - {at: 7, order: forbid, uav: uav_1, tasks: [t2]}
  - {at: 8, order: pin, uav: uav_1, tasks: [t2]}
""")
    fleet = Fleet(probe)
    player = start('scenario_player', '-p', f'scenario:={path}', '-p', 'speedup:=8.0')
    start('allocator', '-p', 'uav_timeout:=60.0', '-p', 'route_end:=hold')
    probe.until(lambda: 'orders: next of uav_1 t1' in player.output(), 60.0)
    assert ' in force ' not in player.output()  # no UAV is known
    fleet.uav('uav_1', 0.0)
    probe.until(lambda: 'refused: ' in player.output(), 150.0, player.output)
    lines = [line.partition(']: ')[2] for line in player.output().splitlines()]
    first, second, third = (line for line in lines
                            if ' in force as ' in line or 'refused: ' in line)
    assert first.startswith('order uav_1: t1: in force as o1')
    assert second.startswith('forbid t2 to uav_1: in force as o2')
    assert third.startswith('order pin t2 to uav_1: refused: ')
    assert 'it contradicts order o2 of scenario_player (forbid t2 to uav_1)' in third
    probe.until(lambda: fleet.route('uav_1') == ['t1', 't3'])
    waits = 'order pin t3 to uav_2 waits: the allocator does not know uav_2'  # and delays no other
    probe.until(lambda: waits in player.output())


def test_keys_that_a_flight_ignores_are_named(start, probe, tmp_path):
    path = tmp_path / 'timed.yaml'
    path.write_text(TEXT.replace('id: uav_1', 'id: uav_1, available_from: 9', 1))
    player = start('scenario_player', '-p', f'scenario:={path}')
    probe.until(lambda: 'flights ignore available_from; only plan' in player.output())


def test_windows_are_announced_in_times_of_the_clock(start, probe, tmp_path):
    path = tmp_path / 'timed.yaml'
    path.write_text(TEXT.replace('service_time: 1.5', 'earliest: 60, latest: 90'))
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    start('scenario_player', '-p', f'scenario:={path}')
    probe.until(lambda: tasks)
    first, stamp = tasks[0].tasks[0], from_stamp(tasks[0].header.stamp)
    assert from_stamp(first.earliest) == pytest.approx(stamp + 60.0, abs=1.0)
    assert from_stamp(first.latest) - from_stamp(first.earliest) == pytest.approx(30.0, abs=1e-6)


def test_the_clock_waits_for_an_allocator(start, probe, file):
    player = start('scenario_player', '-p', f'scenario:={file}', '-p', 'speedup:=10.0')
    start('live_view')
    probe.until(lambda: 'waiting for an allocator' in player.output())
    probe.until(lambda: probe.node.count_subscribers('threat_zones') == 1)
    assert '0.0 s' not in player.output()
    zones = probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    probe.until(lambda: len(tasks) == 3)
    assert [zone.zone_id for zone in zones[0].zones] == ['z1']
    probe.until(lambda: 'everything is announced' in player.output())
    assert player.stop()[0] == 0


def test_the_clock_waits_for_a_first_plan_where_the_parameter_says_so(start, probe, file):
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    zones = probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    start('scenario_player', '-p', f'scenario:={file}', '-p', 'speedup:=50.0',
          '-p', 'wait_for_plan:=true')
    plans = probe.publisher(m.Allocation, 'allocation', LATCHED)
    probe.until(lambda: probe.node.count_publishers('threat_zones') == 1)
    assert not tasks + zones
    plans.publish(m.Allocation(revision=1))
    probe.until(lambda: len(tasks) == 3)


def test_a_late_subscriber_receives_all_tasks_and_the_latest_zones(start, probe, file):
    probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    start('scenario_player', '-p', f'scenario:={file}', '-p', 'speedup:=100.0')
    probe.until(lambda: len(tasks) == 3)
    late_tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    late_zones = probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    probe.until(lambda: len(late_tasks) == 3 and late_zones)
    assert [zone.zone_id for zone in late_zones[0].zones] == ['z1']


def test_a_bad_file_ends_it_with_one_line_and_status_1(start, probe, tmp_path):
    path = tmp_path / 'bad.yaml'
    path.write_text(TEXT.replace('radius: 80', 'radius: -80'))
    player = start('scenario_player', '-p', f'scenario:={path}')
    probe.until(lambda: player.popen.poll() is not None)
    assert player.popen.returncode == 1
    assert player.output().strip() == (
        f'{path}:7: scenario.zones[0].radius = -80: expected a number in (0, inf)')


def test_on_simulated_time_everything_is_announced_as_the_clock_says(start, probe, file):
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    zones = probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    player = start('scenario_player', '-p', f'scenario:={file}', '-p', 'use_sim_time:=true')
    clock = probe.publisher(Clock, '/clock', 10)
    probe.until(lambda: probe.node.count_publishers('threat_zones') == 1)
    now = [5000.0]

    def tick(until, ready):
        """Publish /clock until `until` [s] and then that time until `ready()`."""
        probe.until(lambda: (clock.publish(Clock(clock=to_stamp(now[0]))), ready())[1])
        assert not tasks[1:] or until >= 6.0

    tick(0.0, lambda: tasks and zones)
    start_at = from_stamp(tasks[0].header.stamp)
    assert start_at == 5000.0
    tick(0.0, lambda: '/clock has stood still at 5000.0 s' in player.output())
    now[0] = 4000.0  # it goes back: nothing is announced again, and the rest is not lost
    tick(0.0, lambda: '/clock went back by 1000.0 s' in player.output())
    assert len(tasks) == 1
    now[0] = 4006.0
    tick(6.0, lambda: len(tasks) == 2)
    tick(6.0, lambda: '/clock has stood still at 4006.0 s' in player.output())
    assert len(tasks) == 2
    now[0] = 4008.0
    tick(8.0, lambda: len(tasks) == 3)


def test_the_clock_of_a_player_is_published_where_no_other_node_does(start, probe, file):
    tasks = probe.collect(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    probe.collect(m.ThreatZoneArray, 'threat_zones', LATCHED)
    clocks = probe.collect(Clock, '/clock', 10)
    player = start('scenario_player', '-p', f'scenario:={file}', '-p', 'speedup:=8.0',
                   '-p', 'clock:=true')
    probe.until(lambda: len(tasks) == 3 and len(clocks) > 20)
    stamps = [from_stamp(msg.header.stamp) for msg in tasks]
    assert stamps[1] - stamps[0] == pytest.approx(6.0, abs=0.5)  # scenario seconds
    # of another topic: it may be received later
    probe.until(lambda: stamps[-1] <= from_stamp(clocks[-1].clock) + 1.0)
    assert from_stamp(clocks[0].clock) <= stamps[-1]
    probe.node.create_publisher(Clock, '/clock', 10)  # such as fleet_sim
    probe.until(lambda: 'another node publishes /clock' in player.output())


def test_the_text_of_the_tests_is_a_scenario():
    assert scenario.parse(TEXT).duration == 8.0
