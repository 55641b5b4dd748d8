# SPDX-License-Identifier: Apache-2.0
"""The allocator as other programs meet it: topics, services, restarts."""
import math
import signal

import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks
from visualization_msgs.msg import MarkerArray

from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, EVENTS, LATCHED, STATES

pytestmark = pytest.mark.ros
S = m.TaskStatus


def task(task_id, x=0.0, y=0.0, **more):
    more.setdefault('value', 1.0)
    return m.Task(task_id=task_id, position=Point(x=float(x), y=float(y), z=50.0), **more)


def add(*tasks, action=m.TaskAnnouncement.ADD):
    return m.TaskAnnouncement(action=action, tasks=list(tasks))


class Fleet:
    """UAVs that publish their states, and what the allocator publishes."""

    def __init__(self, probe):
        self.probe, self.states = probe, {}
        self.lists, self.revisions = {}, {}
        self.tasks = probe.node.create_publisher(m.TaskAnnouncement, 'task_announcements',
                                                 ANNOUNCEMENTS)
        self.zones = probe.node.create_publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
        self.events = probe.node.create_publisher(m.TaskEvent, 'task_events', EVENTS)
        self.state = probe.node.create_publisher(m.UavState, 'uav_states', STATES)
        self.allocations = probe.collect(m.Allocation, 'allocation', LATCHED)
        self.statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)
        probe.node.create_timer(0.1, self.publish_states)

    def uav(self, uav_id, x, y=0.0, **more):
        more = {'range_remaining': math.nan, 'cruise_speed': math.nan,
                'home': Point(x=math.nan), 'available': True, **more}
        if uav_id not in self.lists:
            self.lists[uav_id], self.revisions[uav_id] = None, []
            self.probe.node.create_subscription(m.TaskList, f'{uav_id}/task_list', self.on_list,
                                                LATCHED)
        self.states[uav_id] = m.UavState(uav_id=uav_id, position=Point(x=x, y=y, z=50.0), **more)

    def publish_states(self):
        for state in self.states.values():
            self.state.publish(state)

    def on_list(self, msg):
        self.lists[msg.uav_id] = msg
        self.revisions[msg.uav_id].append(msg.revision)

    def event(self, kind, task_id, uav_id, **more):
        more.setdefault('revision', self.lists[uav_id].revision if self.lists.get(uav_id) else 0)
        self.events.publish(m.TaskEvent(event=kind, task_id=task_id, uav_id=uav_id, **more))

    def route(self, uav_id):
        msg = self.lists.get(uav_id)
        return None if msg is None else [planned.task.task_id for planned in msg.tasks]

    def status(self, task_id):
        latest = self.statuses[-1].statuses if self.statuses else ()
        matching = [status for status in latest if status.task_id == task_id]
        return matching[0] if matching else S(state=255)

    def until_state(self, task_id, state):
        self.probe.until(lambda: self.status(task_id).state == state)
        return self.status(task_id)

    def connected(self):
        self.probe.until(lambda: self.tasks.get_subscription_count()
                         and self.state.get_subscription_count()
                         and self.events.get_subscription_count())


@pytest.fixture
def fleet(probe):
    return Fleet(probe)


def begin(start, fleet, *more):
    process = start('allocator', '-p', 'uav_timeout:=1.5', '-p', 'route_end:=hold', *more)
    fleet.connected()
    return process


def test_a_burst_causes_one_plan_and_only_changed_lists_are_published(start, probe, fleet):
    node = begin(start, fleet)
    markers = probe.collect(MarkerArray, 'allocation_markers', LATCHED)
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    fleet.tasks.publish(add(task('t0', 100)))
    assert fleet.until_state('t0', S.PENDING).reason == 'no UAV known yet'
    fleet.uav('a', 0.0)
    fleet.uav('b', 1000.0, cruise_speed=20.0)
    probe.until(lambda: fleet.route('a') == ['t0'])
    probe.until(lambda: fleet.allocations and fleet.allocations[-1].distance == 100.0)
    before = len(fleet.allocations)
    for k in range(20):
        fleet.tasks.publish(add(task(f't{k + 1}', 1010 + k, service_time=Duration(sec=2))))
    probe.until(lambda: len(fleet.route('b') or ()) == 20)
    late = probe.collect(m.TaskList, 'b/task_list', LATCHED)
    # time enough for a second plan, if there were one
    probe.until(lambda: late and len(fleet.allocations) > before)
    assert late[-1].revision == fleet.lists['b'].revision == 1
    assert len(fleet.allocations) - before == 1
    first, second = fleet.lists['b'].tasks[:2]
    assert first.leg_distance == pytest.approx(10.0)
    assert first.eta == Duration(sec=4)  # 10 m from rest with 2.5 m/s2
    assert second.eta.sec == 7
    assert fleet.revisions['a'] == [1]
    allocation = fleet.allocations[-1]
    assert [each.uav_id for each in allocation.lists] == ['a', 'b']
    assert allocation.distance == pytest.approx(129.0)
    assert allocation.value == pytest.approx(21.0)
    assert 'ADD t1' in allocation.trigger
    probe.until(lambda: markers and health)
    assert any(pair.key == 'UAVs known' for pair in health[-1].status[0].values)
    code, out = node.stop()
    assert code == 0
    assert 'Traceback' not in out


def test_progress_silence_and_a_zone_change_the_lists(start, probe, fleet):
    begin(start, fleet)
    fleet.uav('a', 0.0)
    fleet.uav('b', 0.0, 3000.0)
    fleet.tasks.publish(add(task('t1', 1000), task('t2', 1100), task('t3', 1000, 3000)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2'] and fleet.route('b') == ['t3'])
    fleet.event(m.TaskEvent.STARTED, 't1', 'a')
    fleet.until_state('t1', S.ACTIVE)
    fleet.zones.publish(m.ThreatZoneArray(zones=[
        m.ThreatZone(zone_id='z1', shape=m.ThreatZone.CYLINDER, center=Point(x=500.0),
                     radius=100.0, z_min=0.0, z_max=500.0),
        m.ThreatZone(zone_id='bad', radius=-1.0)]))
    probe.until(lambda: fleet.lists['a'].tasks[0].via)
    assert fleet.lists['a'].tasks[0].leg_distance > 1005.0
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'a')
    fleet.until_state('t1', S.COMPLETED)
    probe.until(lambda: fleet.route('a') == ['t2'])
    del fleet.states['a']
    probe.until(lambda: fleet.route('a') == [])
    probe.until(lambda: fleet.route('b') == ['t3', 't2'])
    assert fleet.revisions['a'] == sorted(set(fleet.revisions['a']))
    fleet.uav('a', 1000.0)
    fleet.tasks.publish(add(task('t4', 1000, 5)))
    probe.until(lambda: fleet.route('a') and fleet.route('a')[0] == 't4')


BAD = [
    (task('nan', math.nan), 'position'),
    (task('negative', value=-1.0), 'value'),
    (task('naught', value=0.0), 'value'),
    (task('impatient', service_time=Duration(sec=-1)), 'service_time'),
    (task('no name!'), 'ROS name'),
    (task('9lives'), 'ROS name'),
    (task('nowhere', frame=7), 'frame'),
    (task('pole', frame=1, latitude=91.0), 'latitude'),
]


def test_bad_messages_are_refused_with_a_reason_and_change_nothing_else(start, probe, fleet):
    node = begin(start, fleet)
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    fleet.tasks.publish(add(*(bad for bad, _ in BAD)))
    fleet.tasks.publish(add(task('t1', 999)))
    fleet.tasks.publish(add(task('ghost'), action=m.TaskAnnouncement.UPDATE))
    fleet.tasks.publish(add(task('spirit'), action=m.TaskAnnouncement.CANCEL))
    fleet.tasks.publish(add(task('odd'), action=9))
    for bad, why in [*BAD, (task('ghost'), 'unknown task'), (task('spirit'), 'unknown task'),
                     (task('odd'), 'action = 9')]:
        assert why in fleet.until_state(bad.task_id, S.REJECTED).reason
    fleet.uav('b', math.nan)
    fleet.uav('c', 0.0, range_remaining=-5.0)
    fleet.event(m.TaskEvent.COMPLETED, 't9', 'a')
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'z')
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'a', revision=77)
    fleet.event(9, 't1', 'a')
    fleet.state.publish(m.UavState(uav_id='no name!'))
    for words in ("'t1' REJECTED: duplicate id", 'uav b: position', 'uav c: range_remaining',
                  "'t9': unknown task", "unknown UAV 'z'", 'revision 77', 'event = 9',
                  "uav_id = 'no name!'"):
        probe.until(lambda words=words: words in node.output())
    assert node.output().count('uav b: position') == 1
    assert fleet.route('a') == ['t1']
    assert fleet.lists['a'].tasks[0].task.position.x == 100.0
    assert fleet.status('t1').state == S.ASSIGNED
    assert fleet.revisions['a'] == [1]


def test_every_new_fault_of_a_zone_is_logged_and_its_last_valid_form_stays(start, probe, fleet):
    node = begin(start, fleet)
    for radius, words in ((50.0, 'zones changed: z'), (-1.0, 'zone z: radius = -1.0'),
                          (math.nan, 'zone z: radius = nan'), (60.0, 'zones changed: z'),
                          (-1.0, 'zone z: radius = -1.0')):
        count = node.output().count(words)
        fleet.zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone(zone_id='z', radius=radius)]))
        probe.until(lambda words=words, count=count: node.output().count(words) > count)
    assert node.output().count('zones changed') == 2


def test_lists_are_published_again_when_the_route_end_changes(start, probe, fleet):
    begin(start, fleet, '-p', 'route_end:=hold')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'a')
    probe.until(lambda: fleet.route('a') == [] and fleet.lists['a'].end == m.TaskList.HOLD)
    home = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value='home')
    probe.call(SetParameters, '/allocator/set_parameters', SetParameters.Request(
        parameters=[Parameter(name='route_end', value=home)]))
    probe.until(lambda: fleet.lists['a'].end == m.TaskList.RETURN_HOME)


def test_windows_are_kept_waited_for_and_refused_in_times_of_the_clock(start, probe, fleet):
    begin(start, fleet)
    fleet.uav('a', 0.0, cruise_speed=10.0)
    fleet.tasks.publish(add(task('t0', 1)))
    probe.until(lambda: fleet.route('a') == ['t0'])
    now = fleet.lists['a'].header.stamp.sec
    opens = task('opens', 100, earliest=Time(sec=now + 600), latest=Time(sec=now + 700),
                 service_time=Duration(sec=5))
    answer = probe.call(SubmitTasks, 'allocator/submit_tasks', SubmitTasks.Request(
        announcement=add(opens, task('past', 10, latest=Time(sec=now - 7200)),
                         task('far', 100_000, latest=Time(sec=now + 60)),
                         task('odd', 10, earliest=Time(sec=now + 9), latest=Time(sec=now + 8)))))
    assert answer.accepted == ['opens']
    assert sorted(answer.rejected) == ['far', 'odd', 'past']
    why = dict(zip(answer.rejected, answer.reasons, strict=True))
    assert 'UTC is 2 h in the past: it is ' in why['past']
    assert 'UTC cannot be kept: the earliest possible start is ' in why['far']
    assert 'task odd: latest = ' in why['odd']
    probe.until(lambda: fleet.route('a') == ['t0', 'opens'])
    planned, stamp = fleet.lists['a'].tasks[1], fleet.lists['a'].header.stamp.sec
    assert stamp + planned.eta.sec + planned.wait.sec == pytest.approx(now + 600, abs=3)
    assert planned.finish.sec == pytest.approx(planned.eta.sec + planned.wait.sec + 5, abs=1)
    assert planned.task.earliest == Time(sec=now + 600)
    probe.until(lambda: fleet.status('opens').expected.sec == now + 600)
    assert fleet.status('far').state == S.REJECTED


def test_services_respond(start, probe, fleet):
    begin(start, fleet)
    fleet.uav('a', 0.0)
    fleet.uav('b', 50.0)

    def submit(*tasks):
        return probe.call(SubmitTasks, 'allocator/submit_tasks',
                          SubmitTasks.Request(announcement=add(*tasks)))

    north = task('t2', frame=m.Task.WGS84, latitude=47.398742, longitude=8.545594,
                 altitude=50.0)
    answer = submit(task('t1', 100), north, task('bad', math.nan))
    assert (answer.accepted, answer.rejected) == (['t1', 't2'], ['bad'])
    assert 'three finite coordinates' in answer.reasons[0]
    assert submit(task('t1', 100)).reasons == ['duplicate: announced before, unchanged']
    probe.until(lambda: len((fleet.route('a') or []) + (fleet.route('b') or [])) == 2)
    planned = next(p for each in fleet.lists.values() if each for p in each.tasks
                   if p.task.task_id == 't2')
    assert planned.task.position.y == pytest.approx(111.2, abs=0.2)

    def available(uav_id, value):
        return probe.call(SetAvailability, 'allocator/set_availability',
                          SetAvailability.Request(uav_id=uav_id, available=value))

    assert not available('z', False).success
    assert available('b', False).success
    probe.until(lambda: not fleet.route('b') and len(fleet.route('a') or ()) == 2)
    assert probe.call(Trigger, 'allocator/replan', Trigger.Request()).success
    probe.until(lambda: fleet.allocations[-1].trigger == 'replan service')


def test_the_tasks_of_a_uav_that_its_pilot_took_over_go_to_the_others_at_once(start, probe, fleet):
    begin(start, fleet, '-p', 'list_interval:=60.0', '-p', 'uav_timeout:=60.0')
    fleet.uav('a', 0.0, authority=m.UavState.HELD)
    fleet.uav('b', 5000.0, authority=m.UavState.HELD)
    fleet.tasks.publish(add(task('t1', 100), task('t2', 200)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2'])
    fleet.uav('a', 0.0, authority=m.UavState.LOST, available=False, active_task_id='t1',
              reason='authority LOST: AUTO -> LOITER')
    probe.until(lambda: fleet.route('a') == [], 5.0)
    probe.until(lambda: sorted(fleet.route('b') or ()) == ['t1', 't2'], 5.0)


def test_finding_19_diagnostics_name_uavs_without_a_safe_path_home(start, probe, fleet):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    node = start('allocator', '-p', 'route_end:=home')
    fleet.connected()
    fleet.uav('a', 500.0, home=Point())
    fleet.uav('b', 900.0, home=Point(x=900.0))
    fleet.tasks.publish(add(task('t1', 600, allowed_uavs=['a'])))
    probe.until(lambda: fleet.route('a') == ['t1'] and fleet.lists['a'].end == m.TaskList.
                RETURN_HOME)
    fleet.zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone(
        zone_id='base', shape=m.ThreatZone.CYLINDER, radius=100.0, z_max=80.0)]))
    probe.until(lambda: fleet.lists['a'].end == m.TaskList.HOLD)
    words = 'a has no safe path home (its home is inside zone base): its list ends with HOLD'
    probe.until(lambda: words in node.output())
    probe.until(lambda: any('a has no safe path home: its home is inside zone base' in each.message
                            for array in health for each in array.status))
    fleet.uav('b', 900.0, home=Point(), mode=m.UavState.STANDBY)
    probe.until(lambda: 'the home of b is inside zone base: it gets no tasks' in node.output())
    assert node.output().count(words) == 1


def test_a_killed_allocator_restores_its_world(start, probe, fleet, tmp_path):
    state = ('-p', f'state_dir:={tmp_path}/state')
    node = begin(start, fleet, *state)
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100), task('t2', 200), task('t3', 300)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2', 't3'])
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'a')
    fleet.event(m.TaskEvent.STARTED, 't2', 'a')
    fleet.until_state('t1', S.COMPLETED)
    probe.until(lambda: fleet.route('a') == ['t2', 't3'])
    probe.call(SubmitTasks, 'allocator/submit_tasks',
               SubmitTasks.Request(announcement=add(task('t4', 400))))
    node.stop(signal.SIGKILL)
    revision, plans = fleet.lists['a'].revision, fleet.allocations[-1].revision
    fleet.uav('a', 150.0, active_task_id='t2', list_revision=revision)
    fleet.statuses.clear()
    begin(start, fleet, *state)
    probe.until(lambda: fleet.allocations[-1].revision > plans)
    probe.until(lambda: fleet.route('a') == ['t2', 't3', 't4'])
    assert fleet.status('t1').state == S.COMPLETED
    assert fleet.revisions['a'] == sorted(set(fleet.revisions['a']))


def test_an_allocator_without_its_disk_goes_on_and_reports_it(start, probe, fleet, tmp_path):
    (tmp_path / 'file').touch()
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    node = begin(start, fleet, '-p', f'state_dir:={tmp_path}/file/state')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    assert 'cannot be opened' in node.output()
    probe.until(lambda: health and 'cannot be opened' in health[-1].status[0].message)


def test_simulated_time_is_in_the_stamps_and_stops_nothing(start, probe, fleet):
    begin(start, fleet, '-p', 'use_sim_time:=true')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])  # before there is any clock
    assert fleet.lists['a'].header.stamp.sec == 0
    clock = probe.publisher(Clock, 'clock', LATCHED)
    clock.publish(Clock(clock=Time(sec=5000)))
    fleet.tasks.publish(add(task('t2', 200)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2'])
    clock.publish(Clock(clock=Time(sec=70)))  # the simulation is restarted
    # the clock may arrive after the plan: an announcement repeated has the statuses published
    probe.until(lambda: (fleet.tasks.publish(add(task('t2', 200))),
                         fleet.statuses[-1].header.stamp.sec in (70, 5000))[1])
    fleet.event(m.TaskEvent.COMPLETED, 't1', 'a')
    probe.until(lambda: fleet.route('a') == ['t2'])
    probe.until(lambda: fleet.status('t1').stamp.sec == 70)
    del fleet.states['a']  # silence is counted in real seconds
    fleet.uav('b', 0.0)
    probe.until(lambda: fleet.route('b') == ['t2'])


def test_a_corrupt_journal_is_set_aside_and_reported(start, probe, fleet, tmp_path):
    (tmp_path / 'journal.sqlite3').write_bytes(b'no database at all ' * 50)
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    begin(start, fleet, '-p', f'state_dir:={tmp_path}')
    fleet.uav('a', 0.0)
    fleet.tasks.publish(add(task('t1', 100)))
    probe.until(lambda: fleet.route('a') == ['t1'])
    probe.until(lambda: health and 'set aside as' in health[-1].status[0].message)
    assert health[-1].status[0].level == DiagnosticStatus.WARN


def test_a_uav_that_starts_inside_a_zone_is_warned_of_and_gets_no_tasks(start, probe, fleet):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    node = begin(start, fleet)
    fleet.zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone(
        zone_id='base', shape=m.ThreatZone.CYLINDER, center=Point(), radius=50.0, z_max=100.0)]))
    fleet.uav('a', 0.0, home=Point(), mode=m.UavState.STANDBY)
    fleet.tasks.publish(add(task('t1', 500)))
    reason = 'a is on the ground inside zone base'
    probe.until(lambda: reason in fleet.status('t1').reason)
    assert fleet.status('t1').state == S.UNASSIGNED
    probe.until(lambda: any(
        (pair.key, pair.value) == ('warning of a', 'on the ground inside zone base: no tasks')
        for msg in health for row in msg.status for pair in row.values))
    [line] = [line for line in node.output().splitlines() if f'{reason}: it gets no tasks' in line]
    assert line.startswith('[WARN]')
