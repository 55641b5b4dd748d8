# SPDX-License-Identifier: Apache-2.0
"""Ways along which no position came for a while: flown once, and never left out."""
import math

import pytest
from piece_bench import (
    flown_in_mission,
    halfway,
    list_of,
    piece,
    places,
    strip,
    surveying,
)

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState

RETURN = {'ardupilot': 6, 'px4': 0x05040000}
HOLD = {'ardupilot': 5, 'px4': 0x03040000}
BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def test_a_way_left_in_silence_for_a_list_that_is_not_confirmed_is_flown_later():
    line = piece('L', (0, 60), (200, 60))
    other = piece('M', (150, 80), (300, 80))
    bench, track = surveying('px4', list_of(line, other))
    halfway(bench, line, 20.0)
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'down' and m.get_type() == 'MISSION_ACK') else None)
    bench.assign(list_of(other, line, revision=2))
    assert bench.run(lambda: bench.onboard().upload.may_be_stored, 10.0)
    bench.run(limit=0.3)
    bench.line.cut = True
    bench.run(limit=14.0)
    bench.line.cut = False
    bench.line.tampers.clear()
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    assert min(track.times_flown(line)) == 1


def test_a_way_left_in_silence_for_another_list_is_flown_later():
    line = piece('L', (0, 60), (200, 60))
    other = piece('M', (150, 80), (300, 80))
    bench, track = surveying('px4', list_of(line, other))
    halfway(bench, line, 20.0)
    bench.assign(list_of(other, line, revision=2))
    assert bench.run(lambda: bench.onboard().verified(), 20.0)
    bench.line.cut = True
    bench.run(limit=14.0)
    bench.line.cut = False
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    assert min(track.times_flown(line)) == 1


@BOTH
@pytest.mark.parametrize(('silence', 'late'), [(6.0, 6.0), (6.0, 6.5), (0.0, 16.0)])
def test_a_strip_whose_begin_is_known_late_is_flown_once(kind, silence, late):
    strips, lost = [strip(k, actions=()) for k in range(3)], {}
    bench, track = surveying(kind, list_of(*strips, turned=('F#1',)))
    bench.line.tampers.append(lambda direction, m, now: [] if direction == 'down' and (
        now < lost.get(m.get_type(), -math.inf)) else None)
    assert bench.run(lambda: bench.completed() == ['F#0'])
    x, y, _ = strips[1].path[-1]
    assert bench.run(lambda: math.dist(bench.vehicles[1].flight.body.position[:2], (x, y)) < 25.0)
    lost['GLOBAL_POSITION_INT'] = bench.now + silence
    lost['MISSION_CURRENT'] = lost['MISSION_ITEM_REACHED'] = bench.now + late
    assert bench.run(lambda: len(bench.completed()) == 3, 300.0)
    for each in strips:
        assert set(track.times_flown(each)) == {1}


def test_a_strip_along_which_the_vehicle_was_held_unseen_is_flown_from_its_first_point():
    line, unseen = piece('L', (0, 60), (200, 60)), [False]
    west, other = piece('W', (-300, 60), (-150, 60)), piece('X', (0, 260), (60, 260))
    bench, track = surveying('ardupilot', list_of(west, line, other), delay=(0.1, 0.1))
    bench.line.tampers.append(lambda direction, m, now: [] if (
        unseen[0] and m.get_type() == 'GLOBAL_POSITION_INT') else None)
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: bench.completed() == ['W'] and body.position[0] > -8.0)
    unseen[0] = True
    assert bench.run(lambda: bench.onboard().progress.coverage.latest == 'L')
    bench.run(limit=1.0)
    bench.assign(list_of(line, piece('M', (200, 160), (0, 160)), other, revision=2))
    bench.run(limit=1.5)
    unseen[0] = False
    assert bench.run(lambda: set(bench.completed()) == {'W', 'L', 'M', 'X'}, 300.0)
    assert not [note for note in bench.notes if 'was not flown' in note]
    assert track.times_flown(line)[-1] == 1


@BOTH
def test_a_silence_in_an_upload_is_flown_along_the_way(kind):
    line, other = piece('L', (0, 60), (300, 60)), piece('M', (300, 100), (0, 100))
    bench, track = surveying(kind, list_of(line))
    lost = [0.0]
    bench.line.tampers.append(lambda direction, m, now: [] if now < lost[0] and m.get_type() in (
        'GLOBAL_POSITION_INT', 'MISSION_REQUEST_INT', 'MISSION_REQUEST') else None)
    halfway(bench, line, 100.0)
    lost[0] = bench.now + 4.0
    bench.assign(list_of(line, other, revision=2))
    assert bench.run(lambda: len(bench.completed()) == 2, 300.0)
    for each in (line, other):
        assert set(track.times_flown(each)) == {1}


@BOTH
@pytest.mark.parametrize('flown', [True, False])
def test_a_strip_is_completed_where_the_vehicle_is_lost_at_its_end(kind, flown):
    task = strip(0)
    bench, _ = surveying(kind, list_of(task, strip(1)), tick=0.05)
    body = bench.vehicles[1].flight.body
    if flown:
        assert bench.run(lambda: [e for e in bench.truth[1] if e.name == 'item_reached'
                                  and math.dist(e.point, task.path[-1]) < 5.0], 200.0)
        bench.run(limit=0.4)
    else:
        assert bench.run(lambda: body.position[0] > 150.0 and body.position[1] > 58.0, 200.0)
    bench.line.cut = True
    assert not bench.completed()
    bench.run(limit=4.0)
    assert bench.completed() == ['F#0'] * flown


@BOTH
@pytest.mark.parametrize('lost', [True, False])
def test_what_follows_a_way_in_another_mode_is_flown_again(kind, lost):
    task = strip(0, length=300.0)
    bench, _ = surveying(kind, list_of(task), tick=0.05)
    vehicle, shown, in_mission = bench.vehicles[1], [False], flown_in_mission(bench)
    halfway(bench, task, 100.0)
    if lost:
        bench.line.tampers.append(lambda direction, m, now: [] if (
            not shown[0] and m.get_type() in ('HEARTBEAT', 'MISSION_CURRENT')) else None)
    bench.run(limit=0.5)
    vehicle.rc_mode(RETURN[kind])
    bench.run(limit=2.5)  # it slows down along the way
    shown[0] = True
    assert bench.run(lambda: bench.authority() is AuthorityState.LOST, 5.0)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['F#0'], 300.0)
    assert all(min(math.dist(place, p) for p in in_mission) < 10.0 for place in places(task, 5.0))


@BOTH
def test_a_restarted_bridge_counts_nothing_that_follows_a_way_in_another_mode(kind):
    task = strip(0, length=300.0)
    bench, _ = surveying(kind, list_of(task))
    body, in_mission = bench.vehicles[1].flight.body, flown_in_mission(bench)
    halfway(bench, task, 100.0)
    bench.vehicles[1].rc_mode(HOLD[kind])
    bench.start()
    bench.run(lambda: len(bench.ground_station.sessions) == 1, 30.0)
    bench.assign(list_of(task, revision=2))
    for _ in range(12):  # carried along the strip by hand, 5 m a second
        bench.run(limit=1.0)
        x, y, z = body.position
        body.position = (x + 5.0, y, z)
    assert bench.hand_over() == ''
    assert bench.run(lambda: bench.completed() == ['F#0'], 300.0)
    assert all(min(math.dist(place, p) for p in in_mission) < 12.0 for place in places(task, 5.0))
