# SPDX-License-Identifier: Apache-2.0
"""Hostile messages are refused with a reason, and the allocator goes on planning.

`pytest test/nodes/test_hostile.py --hostile 20000` sends that many; the seeds are fixed.
"""
import math

import hostile
import pytest
import rclpy
from geometry_msgs.msg import Point
from hypothesis import HealthCheck, Phase, given, seed, settings, strategies as st
from rclpy.executors import SingleThreadedExecutor
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

from uav_task_alloc.allocator.core import make_safe_paths
from uav_task_alloc.allocator.records import SavedState
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.nodes.allocator import AllocatorNode
from uav_task_alloc.nodes.conversions import messages
from uav_task_alloc.nodes.conversions.announcements import announce, to_work
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, EVENTS, LATCHED, STATES
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.zone_codec import decode_zone_message

pytestmark = pytest.mark.ros
SEED, BATCH = 20_261_121, 10  # messages in one example
ORIGIN = Origin(47.397742, 8.545594, 488.0)
QUICK = ('-p', 'solve_budget:=0.02', '-p', 'background_budget:=0.0', '--log-level', 'error')
RULES = {'phases': [Phase.generate], 'database': None,  # to shrink takes minutes
         'deadline': None, 'print_blob': True,
         'suppress_health_check': list(HealthCheck)}
GOOD = {
    'task': (lambda: m.Task(task_id='t1', value=1.0), lambda msg: messages.to_task(msg, ORIGIN)),
    'state': (lambda: m.UavState(uav_id='u1', battery=0.5, range_remaining=9.0, cruise_speed=9.0),
              messages.to_report),
    'event': (lambda: m.TaskEvent(task_id='t1', uav_id='u1'), messages.to_event),
    'zone': (lambda: m.ThreatZone(zone_id='z1', radius=9.0), decode_zone_message)}


def bombard(test, count):
    """Run `test` on `count` hostile messages."""
    batches = st.lists(hostile.message, min_size=BATCH, max_size=BATCH)
    given(batches)(seed(SEED)(settings(max_examples=count // BATCH, **RULES)(test)))()


@pytest.mark.parametrize('what', GOOD)
def test_the_messages_are_valid_before_a_field_is_spoiled(what):
    make, convert = GOOD[what]
    assert convert(make())


def test_a_value_of_a_megabyte_is_truncated_in_the_error():
    with pytest.raises(InvalidValue) as refused:
        messages.to_task(m.Task(task_id='x' * 1_000_000), ORIGIN)
    assert '(1000002 characters)' in str(refused.value)
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize('field', [
    {'kind': 77}, {'vertical': 9}, {'kind': m.Task.LINE, 'path': [Point(x=math.nan)]},
    {'holes': [m.Ring()] * 500}], ids=lambda field: list(field)[-1])
def test_another_bad_field_repeats_no_id_of_a_megabyte(field):
    with pytest.raises(InvalidValue) as refused:
        to_work(m.Task(task_id='x' * 1_000_000, value=1.0, **field), ORIGIN)
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize(('action', 'count', 'why'), [
    (m.TaskAnnouncement.ADD, 10_001, 'tasks: number = 10001: expected at most 10000'),
    (77, 3000, 'action = 77: expected ADD (0), UPDATE (1) or CANCEL (2)')])
def test_a_refused_message_of_many_tasks_names_some_and_how_many_more(action, count, why):
    world = World(AllocatorParams(), SavedState(), make_safe_paths, lambda *_: None)
    world.refuse('before', 'why', 1.0)
    verdicts = announce(world, m.TaskAnnouncement(
        action=action, tasks=[m.Task(task_id=f't{k}') for k in range(count)]), ORIGIN, 1.0, 1.0)
    assert [verdict.task_id for verdict in verdicts] == [f't{k}' for k in range(20)]
    assert {verdict.reason for verdict in verdicts} == {
        f'{why}; refused with {count - 20} more tasks of the message'}
    assert [*world.tasks.rejected] == ['before', *(verdict.task_id for verdict in verdicts)]
    assert len(world.outbox.notes) == 21


@pytest.fixture
def number(request):
    return request.config.getoption('--hostile')


def test_a_spoiled_field_is_refused_by_name_and_value_in_a_short_line(number):
    @given(hostile.spoiled)
    @seed(SEED)
    @settings(max_examples=number // 2, **RULES)
    def judge(given_one):
        what, field, value = given_one
        make, convert = GOOD[what]
        message = make()
        setattr(message, field, value)
        if field == 'vertices':
            message.shape = m.ThreatZone.POLYGON
        with pytest.raises(InvalidValue) as refused:
            convert(message)
        text = str(refused.value)
        assert field in text
        assert ' = ' in text
        assert ': expected ' in text
        assert len(text) < 700
        assert text.isprintable()

    judge()


class Good:
    """Valid tasks, and a UAV that can fly them all."""

    def __init__(self):
        self.ids = []

    def state(self):
        return m.UavState(uav_id='good', position=Point(z=50.0), home=Point(x=math.nan),
                          battery=1.0, range_remaining=1e7, cruise_speed=15.0, available=True)

    def task(self):
        self.ids.append(f'good_{len(self.ids)}')
        k = len(self.ids)
        return m.TaskAnnouncement(tasks=[m.Task(
            task_id=self.ids[-1], position=Point(x=50.0 * (k % 40), y=50.0 * (k // 40), z=50.0),
            value=1.0, allowed_uavs=['good'])])


@pytest.fixture
def node(domain):
    rclpy.init(args=['--ros-args', *QUICK])
    node = AllocatorNode()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    yield node, executor
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()


def callbacks_of(node):
    """The callback for each message type."""
    return {m.UavState: node.on_state, m.TaskAnnouncement: node.on_tasks,
            m.ThreatZoneArray: node.on_zones, m.TaskEvent: node.on_event,
            SubmitTasks.Request: lambda msg: node.requests.submit_tasks(
                msg, SubmitTasks.Response()),
            SetAvailability.Request: lambda msg: node.requests.set_availability(
                msg, SetAvailability.Response())}


def test_a_node_that_receives_hostile_messages_plans_all_valid_tasks(node, number):
    node, executor = node
    good, callbacks = Good(), callbacks_of(node)

    def round_of(batch):
        for message in batch:
            callbacks[type(message)](message)
        node.on_state(good.state())
        node.on_tasks(good.task())
        executor.spin_once(timeout_sec=0.0)

    bombard(round_of, number // 2)
    node.on_zones(m.ThreatZoneArray())
    records = node.world.tasks.records
    for _ in range(600):
        node.on_state(good.state())
        executor.spin_once(timeout_sec=0.05)
        if all(records[task_id].uav == 'good' for task_id in good.ids):
            break
    assert [i for i in good.ids if records[i].uav != 'good'] == []


def test_a_node_whose_callbacks_always_take_long_does_step(node, monkeypatch):
    node, steps = node[0], []
    pacing = node.pacing
    monkeypatch.setattr(node, 'leads', lambda: True)
    monkeypatch.setattr(node, 'waits_for_subscribers', lambda _: False)
    monkeypatch.setattr(node.core, 'tick', lambda *_: steps.append(1))
    for _ in range(4):
        for name in ('_ticked_at', '_reads_until', '_pause_until'):  # 2 s pass
            setattr(pacing, name, getattr(pacing, name) - 2.0)
        node.on_step()
    assert len(steps) == 2


def test_hostile_topics_do_not_end_a_running_node(start, probe):
    process = start('allocator')
    good = Good()
    out = {kind: probe.publisher(kind, topic, qos) for kind, topic, qos in (
        (m.UavState, 'uav_states', STATES), (m.TaskEvent, 'task_events', EVENTS),
        (m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS),
        (m.ThreatZoneArray, 'threat_zones', LATCHED))}
    arrays = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)

    def round_of(batch):
        for message in batch:
            if type(message) in out:
                out[type(message)].publish(message)
        out[m.TaskAnnouncement].publish(good.task())

    bombard(round_of, 300)
    out[m.ThreatZoneArray].publish(m.ThreatZoneArray())
    probe.node.create_timer(0.1, lambda: out[m.UavState].publish(good.state()))
    probe.until(lambda: arrays and {s.task_id for s in arrays[-1].statuses if s.uav_id == 'good'}
                >= set(good.ids), 60.0,  # tasks among the hostile ones may be good as well
                lambda: (len(good.ids), [(each.task_id, each.state, each.uav_id, each.reason)
                                         for last in arrays[-1:] for each in last.statuses
                                         if each.task_id.startswith('good')],
                         process.output()[-2000:]))
    code, text = process.stop()
    assert (code, 'Traceback' in text) == (0, False)
