# SPDX-License-Identifier: Apache-2.0
"""Findings 10 and 24: no message ends the bridge, is too long, or is logged too often."""
import math

import pytest
from findings_bench import BOTH
from flight_bench import FlightBench, flying
from link_bench import heartbeat, receive
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.mission.download import DownloadState
from uav_task_alloc.mavlink.mission.items import Item, MissionStop, TaskList, all_alike
from uav_task_alloc.model import Task

NAN, INF = math.nan, math.inf


def read_back(kind):
    """A bench during a readback, and the seq of the requested item."""
    bench = FlightBench(kind, delay=(0.15, 0.15)).discover()
    bench.assign(task_list('ABC'))
    upload = bench.onboard().upload
    assert bench.run(lambda: upload._readback is not None and upload._mission is not None
                     and upload._readback.state is DownloadState.GETTING)
    return bench, len(upload._readback.items)


def old_item(seq, x=47.4, y=8.5, z=500.0, param1=0.0):
    """MISSION_ITEM, which holds degrees as floats."""
    return d.MAVLink_mission_item_message(245, 190, seq, 3, 16, 0, 1, param1, 0, 0, 0, x, y, z, 0)


def new_item(seq, z, param1=0.0):
    return d.MAVLink_mission_item_int_message(
        245, 190, seq, 6, 16, 0, 1, param1, 0, 0, 0, 474000000, 85000000, z, 0)


@BOTH
@pytest.mark.parametrize(('make', 'words'), [
    (lambda n: old_item(n, x=NAN), 'x = nan: expected a finite number'),
    (lambda n: old_item(n, x=INF), 'x = inf: expected a finite number'),
    (lambda n: old_item(n, y=-INF), 'y = -inf: expected a finite number'),
    (lambda n: old_item(n, z=NAN), 'z = nan: expected a finite number'),
    (lambda n: old_item(n, param1=INF), 'param1 = inf: expected a finite number'),
    (lambda n: new_item(n, INF), 'z = inf: expected a finite number'),
    (lambda n: new_item(n, 500.0, -INF), 'param1 = -inf: expected a finite number'),
], ids=['x nan', 'x inf', 'y', 'z nan', 'param1', 'int z', 'int param1'])
def test_finding_10_an_item_without_a_valid_position_is_dropped_and_logged_once(kind, make, words):
    bench, seq = read_back(kind)
    for _ in range(3):
        bench.from_vehicle(make(seq))
    refusals = bench.ground_station.refusals
    assert refusals.count == 3
    assert len(refusals.notes) == 1
    assert words in refusals.notes[0].text
    assert 'system 1, component 1' in refusals.last
    assert bench.run(lambda: bench.completed() == list('ABC'))
    assert refusals.count == 3


@BOTH
@pytest.mark.parametrize(('other', 'autopilot'), [
    (d.MAV_TYPE_ONBOARD_CONTROLLER, d.MAV_AUTOPILOT_INVALID),
    (d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_GENERIC)], ids=['companion', 'station'])
def test_a_heartbeat_of_no_autopilot_says_nothing_of_the_vehicle(kind, other, autopilot):
    bench = flying(kind)
    for _ in range(3):
        bench.from_vehicle(d.MAVLink_heartbeat_message(other, autopilot, 0, 0, 4, 3))
    assert bench.run(lambda: bench.completed() == list('ABC'))
    assert bench.authority() is AuthorityState.HELD
    assert (f'HEARTBEAT (system 1, component 1): type = {other}, autopilot = {autopilot}: '
            'expected an autopilot') in bench.ground_station.refusals.notes[0].text


@BOTH
def test_a_home_at_0_0_is_none(kind):
    bench = FlightBench(kind).discover()
    assert bench.run(lambda: bench.state().home is not None, 10.0)
    before = bench.state().home
    bench.from_vehicle(d.MAVLink_home_position_message(
        0, 0, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    assert bench.state().home == before


@pytest.mark.parametrize(('message', 'words'), [
    (d.MAVLink_global_position_int_message(0, 2**31 - 1, 0, 0, 0, 0, 0, 0, 0),
     'lat = 2147483647: expected a number in [-900000000, 900000000]'),
    (d.MAVLink_home_position_message(0, -2**31, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
     'longitude = -2147483648: expected a number in [-1800000000, 1800000000]'),
    (d.MAVLink_global_position_int_message(0, 47 * 10**7, 8 * 10**7, 2**31 - 1, 0, 0, 0, 0, 0),
     'alt = 2147483647: expected a number in [-100000000, 100000000]'),
    (d.MAVLink_global_position_int_message(0, 47 * 10**7, 8 * 10**7, 0, 2**31 - 1, 0, 0, 0, 0),
     'relative_alt = 2147483647: expected a number in [-100000000, 100000000]'),
    (d.MAVLink_home_position_message(
        47 * 10**7, 8 * 10**7, 2**31 - 1, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
     'altitude = 2147483647: expected a number in [-100000000, 100000000]'),
    (d.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 127, 0, 0, 0, 0, 0, 0),
     'battery_remaining = 127: expected a number in [-128, 100]'),
], ids=['latitude', 'longitude', 'altitude', 'height', 'altitude of home', 'battery'])
def test_finding_10_a_field_out_of_range_changes_nothing(message, words):
    bench = FlightBench('px4').discover()
    bench.run(limit=10.0)
    before = bench.state()
    bench.from_vehicle(message)
    after = bench.state()
    assert (after.position, after.home, after.battery) == (
        before.position, before.home, before.battery)
    assert words in bench.ground_station.refusals.last


def test_finding_10_an_infinite_hold_on_board_equals_no_other():
    sent, held = (Item(16, params=(hold, 0.0, 0.0, 0.0)) for hold in (INF, 3.0))
    assert not all_alike((sent,), (held,))
    assert not all_alike((held,), (sent,))


def test_finding_10_an_unexpected_error_drops_the_message_only(monkeypatch):
    bench = FlightBench('px4', 'px4').discover()
    bench.assign(task_list('AB'), 2)
    original = bench.executor(1).receive

    def failing(message, now):
        raise ValueError('never\nseen')
    monkeypatch.setattr(bench.executor(1), 'receive', failing)
    assert bench.run(lambda: bench.completed(2) == list('AB'))
    refusals = bench.ground_station.refusals
    assert refusals.count > 10
    assert 'ValueError: never seen (at test_findings_messages.py:' in refusals.last
    texts = [note.text for note in refusals.notes]
    assert len({text.split(':')[0] for text in texts}) == len(texts)
    monkeypatch.setattr(bench.executor(1), 'receive', original)
    bench.assign(task_list('AB'), 1)
    assert bench.run(lambda: bench.completed(1) == list('AB'))


@pytest.mark.parametrize('what', ['step', 'assign'])
def test_finding_10_a_vehicle_that_cannot_be_served_is_not_available_while_that_lasts(
        monkeypatch, what):
    bench = FlightBench('px4', 'px4').discover()
    assert bench.run(lambda: bench.state(1).available)

    def failing(*_):
        raise KeyError('x')
    original = getattr(bench.executor(1), what)
    monkeypatch.setattr(bench.executor(1), what, failing)
    if what == 'step':
        bench.run(limit=1.0)
    else:
        bench.assign(task_list('AB'), 1)
    assert "KeyError: 'x'" in bench.state(1).reason
    assert diagnostics_of(bench.ground_station.sessions[1], bench.now).level == 2
    assert [note.level for note in bench.ground_station.refusals.notes] == ['error']
    monkeypatch.setattr(bench.executor(1), what, original)
    bench.assign(task_list('AB'), 2)
    assert bench.run(lambda: bench.completed(2) == list('AB'))
    assert bench.state(1).available


def test_finding_10_a_flood_of_kinds_and_senders_does_not_flood_the_log(monkeypatch):
    bench = FlightBench('px4').discover()
    for kind in range(1000):
        bench.ground_station.refusals.add(f'system {kind % 250}', f'KIND_{kind}', 'x' * 10_000)
    assert bench.ground_station.refusals.count == 1000
    assert len(bench.ground_station.refusals.notes) == 101
    assert max(len(note.text) for note in bench.ground_station.refusals.notes) < 400


def test_finding_10_bytes_that_cannot_be_decoded_drop_one_datagram(
        make_connections, make_remote, monkeypatch):
    connections = make_connections()
    remote = make_remote(connections)
    remote.send(heartbeat())
    assert len(receive(connections)) == 1
    parser, = connections._parsers.values()
    original = parser.parse

    def failing(data):
        monkeypatch.setattr(parser, 'parse', original)
        raise IndexError('x')
    monkeypatch.setattr(parser, 'parse', failing)
    remote.send(heartbeat())
    remote.send(heartbeat())
    assert len(receive(connections)) == 1
    assert 'IndexError: x' in connections.refusals.last


def test_finding_10_a_message_that_cannot_be_encoded_leaves_the_others(
        make_connections, make_remote):
    connections = make_connections()
    remote = make_remote(connections)
    remote.send(heartbeat())
    (address, _), = receive(connections)
    count = d.MAVLink_mission_count_message(1, 1, 66_000, 0)
    connections.send([(address, count), (address, heartbeat())])
    assert remote.receive()[0].get_type() == 'HEARTBEAT'
    assert connections.refusals.count == 1
    assert connections.refusals.notes[0].text.startswith('MISSION_COUNT (to ')


def distant_positions(count):
    """`count` positions [m], 60 m apart, none more than 5 km from the next or the origin."""
    return [(60.0 * (n % 50), 60.0 * (n // 50 % 50), 50.0 + n // 2500) for n in range(count)]


@BOTH
def test_finding_24_of_more_items_than_a_mission_holds_the_first_tasks_are_flown(kind):
    bench = FlightBench(kind).discover()
    places, room = distant_positions(66_000), 65535 - (kind == 'ardupilot')
    bench.assign(TaskList(1, tuple(
        MissionStop(Task(f't{n}', places[1000 * n + 999]), tuple(places[1000 * n:1000 * n + 999]))
        for n in range(66))))
    assert bench.run(lambda: bench.line.sent('MISSION_COUNT'))
    assert (f'the list takes 66000 mission items: expected at most {room}: flying the first 65 '
            'tasks, the others follow') in bench.notes
    assert bench.line.sent('MISSION_COUNT')[0].count == 65_000 + (kind == 'ardupilot')
    assert bench.failed() == []
    assert bench.ground_station.refusals.count == 0


@BOTH
def test_finding_24_a_task_after_more_points_than_a_mission_holds_fails_in_words(kind):
    bench = FlightBench(kind).discover()
    room = 65535 - (kind == 'ardupilot')
    long = MissionStop(Task('long', (0.0, 90.0, 50.0)), tuple(distant_positions(66_000)))
    bench.assign(TaskList(1, (long, *task_list('AB').stops)))
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    failed, = (event for _, event in bench.events if event.event == 'FAILED')
    assert (failed.task, failed.reason) == (
        'long', f'task long: 66003 mission items: expected at most {room}, which is what a '
        'mission holds')
    assert bench.ground_station.refusals.count == 0


def test_finding_24_a_flood_of_texts_does_not_flood_the_log():
    bench = FlightBench('px4').discover()
    before = len(bench.notes)
    for n in range(1000):
        bench.from_vehicle(d.MAVLink_statustext_message(6, f'text {n}'.encode()))
    assert len(bench.notes) - before <= 200
    bench.now += 61.0
    bench.from_vehicle(d.MAVLink_statustext_message(6, b'another'))
    assert 'another' in bench.notes
