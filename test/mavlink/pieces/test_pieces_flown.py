# SPDX-License-Identifier: Apache-2.0
"""Ways flown by both simulated autopilots: once, from either end, without a gap, with pictures."""
import math
from dataclasses import replace
from itertools import pairwise

import pytest
from flight_bench import FlightBench, Store
from piece_bench import (
    Track,
    halfway,
    list_of,
    payload,
    photos,
    pictures_of,
    piece,
    strip,
    surveying,
)
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


@BOTH
def test_strips_are_flown_once_and_photographed_once(kind):
    strips = [strip(k) for k in range(3)]
    bench, track = surveying(kind, list_of(*strips, turned=('F#1',)))
    assert bench.run(lambda: len(bench.completed()) == 3, 400.0)
    bench.run(limit=10.0)
    assert bench.completed() == bench.started() == ['F#0', 'F#1', 'F#2']
    for each in strips:
        assert set(track.times_flown(each)) == {1}
        taken = pictures_of(bench, each)
        assert 10 <= len(taken) <= 12  # 200 m at 20 m, the first at once
        gaps = [b - a for a, b in pairwise(taken)]
        assert max(gaps) <= 23.0
    assert len(photos(bench)) == sum(len(pictures_of(bench, each)) for each in strips)
    assert bench.onboard().upload.uploads == 1


@BOTH
def test_a_line_with_corners_is_flown_from_its_last_point(kind):
    line = piece('L', (0, 60), (100, 60), (100, 160), (200, 160))
    stop = MissionStop(line, ((250.0, 0.0, 40.0),), reversed=True)
    bench, track = surveying(kind, TaskList(1, (stop,)))
    assert bench.run(lambda: bench.completed() == ['L'], 300.0)
    assert bench.flown()[1:] == [(200, 160, 40), (100, 160, 40), (100, 60, 40), (0, 60, 40)]
    assert set(track.times_flown(line)) == {1}


@BOTH
def test_only_the_last_point_completes_a_way(kind):
    line = piece('L', (0, 60), (100, 60), (100, 160), (200, 160))
    bench, _ = surveying(kind, list_of(line))
    assert bench.run(lambda: len(bench.flown()) == 3, 200.0)
    assert bench.completed() == []
    assert bench.started() == ['L']


@BOTH
def test_nothing_is_left_running_after_the_last_strip(kind):
    bench, _ = surveying(kind, list_of(strip(0), strip(1)))
    assert bench.run(lambda: len(bench.completed()) == 2, 300.0)
    assert payload(bench) == [('trigger', '20'), ('trigger', '0')] * 2


def set_mode(bench, mode):
    """Another station or a pilot's switch sets the mode."""
    bench.from_station(d.MAVLink_command_long_message(
        1, 1, d.MAV_CMD_DO_SET_MODE, 0, 1, *mode, 0, 0, 0, 0))


MODES = {'ardupilot': ((5, 0), (3, 0)), 'px4': ((4, 3), (4, 4))}  # hold, mission


@BOTH
def test_a_list_replaced_in_mid_strip_goes_on_along_it(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1)))
    halfway(bench, strip(0))
    bench.assign(list_of(strip(0), strip(2), revision=2))
    assert bench.run(lambda: len(bench.completed()) == 2, 300.0)
    assert bench.completed() == ['F#0', 'F#2']
    for each in (strip(0), strip(2)):
        assert set(track.times_flown(each)) == {1}
        taken = pictures_of(bench, each)
        assert max(b - a for a, b in pairwise(taken)) <= 23.0
        assert taken[0] <= 5.0
        assert taken[-1] >= 175.0
    bench.run(limit=10.0)
    assert payload(bench)[-1] == ('trigger', '0')


@BOTH
def test_a_strip_that_was_left_is_continued_where_it_was_left(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1)))
    halfway(bench, strip(0))
    bench.assign(list_of(strip(1), strip(0), revision=2))
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    assert bench.completed() == ['F#1', 'F#0']
    assert set(track.times_flown(strip(1))) == {1}
    passes = track.times_flown(strip(0))
    assert min(passes) == 1
    assert passes.count(1) >= len(passes) - 6  # where it turned and came back
    strays = len(photos(bench)) - len(pictures_of(bench, strip(0))) - len(
        pictures_of(bench, strip(1)))
    assert strays <= 2  # until the command to end the trigger has arrived


@BOTH
def test_a_strip_that_is_left_for_good_takes_no_more_pictures(kind):
    bench, _ = surveying(kind, list_of(strip(0), returns=True))
    halfway(bench, strip(0))
    bench.assign(TaskList(2, (), returns=True))
    bench.run(limit=60.0)
    assert payload(bench)[-1] == ('trigger', '0')
    assert len(photos(bench)) - len(pictures_of(bench, strip(0))) <= 3
    assert bench.completed() == []


@BOTH
def test_what_a_pilot_flew_past_is_flown_afterwards(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1)))
    halfway(bench, strip(0), 60.0)
    hold, mission = MODES[kind]
    set_mode(bench, hold)
    bench.run(limit=4.0)
    bench.vehicles[1].flight.body.position = (180.0, 62.0, 40.0)  # carried along by hand
    bench.run(limit=4.0)
    set_mode(bench, mission)
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    assert bench.completed() == ['F#0', 'F#1']
    assert min(track.times_flown(strip(0))) == 1
    taken = pictures_of(bench, strip(0))
    assert max(b - a for a, b in pairwise(taken)) <= 25.0


@BOTH
def test_a_skipped_strip_is_not_completed(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1)))
    halfway(bench, strip(0), 60.0)
    seq = next(n for n, item in enumerate(bench.vehicles[1].mission.items)
               if item.x and n > bench.vehicles[1].flight.seq + 1)
    bench.from_station(d.MAVLink_mission_set_current_message(1, 1, seq + 1))
    assert bench.run(lambda: len(bench.completed()) == 2, 500.0)
    for each in (strip(0), strip(1)):
        assert min(track.times_flown(each)) == 1


@BOTH
@pytest.mark.parametrize('store', [True, False])
def test_a_restarted_bridge_continues_in_mid_strip(kind, store):
    bench, track = surveying(kind, list_of(strip(0), strip(1), turned=('F#1',)))
    halfway(bench, strip(0), 60.0)
    if not store:
        bench.store = Store()
    bench.start()
    bench.run(lambda: len(bench.ground_station.sessions) == 1, 30.0)
    bench.assign(list_of(strip(0), strip(1), revision=2, turned=('F#1',)))
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    assert bench.completed() == ['F#0', 'F#1']
    for each in (strip(0), strip(1)):
        assert set(track.times_flown(each)) == {1}
        assert max(b - a for a, b in pairwise(pictures_of(bench, each))) <= 23.0


@BOTH
def test_a_restarted_bridge_continues_a_rest(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1)))
    halfway(bench, strip(0), 100.0)
    bench.assign(list_of(strip(1), strip(0), revision=2))
    assert bench.run(lambda: bench.completed() == ['F#1'], 300.0)
    bench.start()
    bench.run(lambda: len(bench.ground_station.sessions) == 1, 30.0)
    bench.assign(list_of(strip(0), revision=3))
    assert bench.run(lambda: 'F#0' in bench.completed(), 300.0)
    passes = track.times_flown(strip(0))
    assert min(passes) == 1
    assert passes.count(1) >= len(passes) - 6


@BOTH
def test_more_strips_than_the_vehicle_stores_are_flown_in_parts(kind):
    strips = [strip(k, length=120.0) for k in range(6)]
    bench, track = surveying(kind, list_of(*strips), configs={1: {'capacity': 13}})
    assert bench.run(lambda: len(bench.completed()) == 6, 900.0)
    for each in strips:
        assert set(track.times_flown(each)) == {1}
    assert bench.failed() == []


@BOTH
def test_a_vehicle_that_reboots_in_mid_strip_flies_the_rest_after_a_hand_over(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1), turned=('F#1',)))
    halfway(bench, strip(0))
    bench.vehicles[1].reboot(bench.now)  # it falls to the ground where it is
    bench.run(limit=80.0)
    assert bench.completed() == []
    assert bench.vehicles[1].flight.body.position[2] < 1.0
    bench.hand_over()
    assert bench.run(lambda: len(bench.completed()) == 2, 500.0)
    assert bench.completed() == ['F#0', 'F#1']
    assert min(track.times_flown(strip(0))) >= 1
    assert set(track.times_flown(strip(1))) == {1}
    taken = pictures_of(bench, strip(0))
    assert max(b - a for a, b in pairwise(taken)) <= 25.0
    assert payload(bench)[-1] == ('trigger', '0')


def clocked(bench):
    """Let ROS time pass with the bench, from 1000 s on; returns it."""
    bench.executor().policy = replace(bench.policy, clock=1000.0 + bench.now)
    return 1000.0 + bench.now


@BOTH
@pytest.mark.parametrize('waiting', [0, 1])
def test_a_wait_before_a_way_is_kept_and_the_way_flown_once(kind, waiting):
    bench = FlightBench(kind).discover()
    track, start, begun = Track(bench), clocked(bench), []
    stops = list_of(strip(0), strip(1), turned=('F#1',)).stops
    begins = [start + (63.0 if waiting == 0 else 40.0), start + (130.0 if waiting == 0 else 95.0)]
    bench.assign(TaskList(1, tuple(
        replace(stop, wait=40.0 * (k == waiting), begin=begins[k])
        for k, stop in enumerate(stops)), stamp=start))
    waited = strip(waiting)
    entry = waited.path[-1 if waiting else 0]

    def done():
        clocked(bench)
        off = math.dist(track.points[-1], entry)
        if not begun and 20.0 < off < 40.0 and abs(track.points[-1][1] - entry[1]) < 3.0:
            begun.append(1000.0 + bench.now - start)
        return len(bench.completed()) == 2
    assert bench.run(done, 500.0)
    assert bench.completed() == ['F#0', 'F#1']
    assert begun[0] == pytest.approx(begins[waiting] - start, abs=10.0)
    for each in (strip(0), strip(1)):
        assert set(track.times_flown(each)) == {1}
        assert max(b - a for a, b in pairwise(pictures_of(bench, each))) <= 23.0


@BOTH
@pytest.mark.parametrize(('store', 'early'), [
    (True, True), (True, False), (False, True), (False, False)])
def test_a_strip_whose_end_another_station_sets_before_a_kill_is_flown(kind, store, early):
    strips = [strip(k, actions=()) for k in range(3)]
    bench, track = surveying(kind, list_of(*strips))
    assert bench.run(lambda: bench.started() == ['F#0'])
    bench.run(limit=1.0)
    end = d.MAVLink_mission_set_current_message(1, 1, bench.onboard().own + 1)
    if early:
        bench.from_station(end)
        bench.run(limit=1.5)
    if not store:
        bench.store = Store()
    bench.line.cut = True
    bench.from_station(end)
    bench.run(limit=15.0)
    bench.line.cut = False
    bench.start()
    bench.discover()
    bench.assign(list_of(*strips, revision=2))
    assert bench.run(lambda: len(bench.completed()) == 3, 300.0)
    assert min(track.times_flown(strip(0))) == 1


@BOTH
def test_a_strip_whose_end_another_station_sets_before_a_silence_is_flown(kind):
    strips = [strip(k, actions=()) for k in range(3)]
    bench, track = surveying(kind, list_of(*strips))
    assert bench.run(lambda: bench.started() == ['F#0'])
    bench.run(limit=1.0)
    bench.from_station(d.MAVLink_mission_set_current_message(1, 1, bench.onboard().own + 1))
    bench.run(limit=1.5)
    bench.line.cut = True
    bench.run(limit=16.0)
    bench.line.cut = False
    assert bench.run(lambda: len(bench.completed()) == 3, 300.0)
    assert min(track.times_flown(strip(0))) == 1


@BOTH
def test_a_strip_that_ends_while_no_bridge_runs_is_flown_once(kind):
    bench, track = surveying(kind, list_of(strip(0), strip(1), turned=('F#1',)))
    halfway(bench, strip(0), 120.0)
    bench.line.cut = True
    bench.run(limit=12.0)
    bench.line.cut = False
    bench.start()
    bench.discover()
    bench.assign(list_of(strip(0), strip(1), revision=2, turned=('F#1',)))
    assert bench.run(lambda: len(bench.completed()) == 2, 300.0)
    for each in (strip(0), strip(1)):
        assert set(track.times_flown(each)) == {1}


@pytest.mark.parametrize('turned_at', [2.0, 30.0])  # [s] before its way is begun, and on it
@pytest.mark.parametrize('closed', [False, True])
def test_a_way_that_a_list_turns_during_a_long_upload_counts_as_it_is_flown(turned_at, closed):
    corners = (0, 100), (100, 160), (200, 160), (300, 60)
    line = piece('L', *corners, *corners[:closed])
    bench, _ = surveying('px4', list_of(line, strip(0)))
    assert bench.run(lambda: bench.executor().telemetry.in_mission, 60.0)
    bench.run(limit=turned_at)
    bench.line.tampers.append(lambda direction, m, now: [] if (
        direction == 'up' and m.get_type() == 'MISSION_ITEM_INT'
        and len(bench.flown()) < 4 + closed) else None)
    bench.assign(list_of(line, strip(0), revision=2, turned=('L',)))
    assert bench.run(lambda: len(bench.completed()) == 2, 400.0)
    bench.run(limit=10.0)
    assert [bench.flown().count(point) for point in line.path[1:-1]] == [1] * (2 + closed)


def test_the_rest_of_a_strip_along_which_the_vehicle_was_held_unseen_is_flown_from_its_begin():
    line, unseen = piece('L', (0, 60), (400, 60)), [False]
    other = piece('X', (0, 260), (60, 260))
    bench, track = surveying('ardupilot', list_of(line, other), delay=(0.1, 0.1))
    bench.line.tampers.append(lambda direction, m, now: [] if (
        unseen[0] and m.get_type() == 'GLOBAL_POSITION_INT') else None)
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: body.position[0] > 60.0)
    bench.assign(list_of(line, piece('M', (400, 160), (0, 160)), other, revision=2))
    assert bench.run(lambda: bench.onboard().revision == 2)
    assert bench.run(lambda: bench.onboard().progress.coverage.latest == 'L')
    begin = body.position[0]
    unseen[0] = True
    assert bench.run(lambda: body.position[0] > begin + 30.0)
    bench.assign(list_of(line, piece('N', (400, 210), (0, 210)), other, revision=3))
    bench.run(limit=1.5)
    unseen[0] = False
    assert bench.run(lambda: set(bench.completed()) == {'L', 'N', 'X'}, 300.0)
    assert not [note for note in bench.notes if 'was not flown' in note]
    assert track.times_flown(line)[-1] == 1
