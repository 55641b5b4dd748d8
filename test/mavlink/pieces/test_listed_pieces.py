# SPDX-License-Identifier: Apache-2.0
"""What is left of the ways of a list, and which recent positions may be of a way."""
import pytest
from piece_bench import piece

from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import MissionStop
from uav_task_alloc.mavlink.mission.listed_pieces import ListedPieces
from uav_task_alloc.mavlink.mission.recent_positions import RecentPositions
from uav_task_alloc.model import Task

LINE = piece('L', (0, 0), (300, 0), (300, 300))
BACK = piece('L', (300, 300), (300, 0), (0, 0))


def listed(*stops, flown=()):
    pieces = ListedPieces()
    pieces.set_listed(stops, flown)
    return pieces


def left(pieces, stop):
    return [p[:2] for p in pieces.rest(stop).way]


def half_flown(stop=None):
    """The line, of which the first 400 m are flown."""
    pieces = listed(stop or MissionStop(LINE))
    pieces.get('L').flown = 400.0
    pieces.note_begun('L')
    pieces.commit('L')
    return pieces


def test_a_task_without_a_way_has_no_piece():
    stop = MissionStop(Task('P', (0.0, 0.0, 40.0)))
    pieces = listed(stop)
    assert pieces.get('P') is pieces.get(None) is None
    assert pieces.rest(stop) is stop
    assert pieces.begin_of_rest(stop) == 0.0


def test_a_flown_part_is_left_out_once_it_is_committed():
    stop = MissionStop(LINE)
    pieces = listed(stop)
    pieces.get('L').flown = 400.0
    before = pieces.version
    assert pieces.rest(stop) is stop
    pieces.commit('L')
    assert left(pieces, stop) == [(300.0, 100.0), (300.0, 300.0)]
    assert pieces.begin_of_rest(stop) == 400.0
    assert pieces.version == before + 1
    pieces.commit('L')  # nothing more was flown
    pieces.commit('other')
    assert pieces.version == before + 1


def test_a_later_list_keeps_what_was_flown_and_may_turn_it():
    pieces, turned = half_flown(), MissionStop(LINE, reversed=True)
    pieces.set_listed([turned], ())
    assert left(pieces, turned) == [(300.0, 300.0), (300.0, 100.0)]
    assert pieces.begin_of_rest(turned) == 0.0
    other_end = MissionStop(BACK)
    pieces.set_listed([other_end], ())
    assert left(pieces, other_end) == [(300.0, 300.0), (300.0, 100.0)]


def test_a_way_that_is_being_flown_is_not_turned():
    pieces = half_flown()
    pieces.set_listed([MissionStop(LINE, reversed=True)], ('L',))
    assert not pieces.get('L').reversed


def test_another_way_of_the_same_task_is_whole():
    pieces, longer = half_flown(), MissionStop(piece('L', (0, 0), (300, 0), (300, 310)))
    pieces.set_listed([longer], ())
    assert pieces.rest(longer) is longer
    assert pieces.marks((), lambda name, one: 0) == ()


def test_a_way_that_is_forgotten_is_flown_as_a_whole():
    pieces, stop = half_flown(), MissionStop(LINE)
    pieces.forget('L')
    assert pieces.rest(stop) is stop
    assert pieces.marks((), lambda name, one: 0) == ()


def test_the_latest_64_ways_that_no_list_has_are_kept():
    pieces = listed(*(MissionStop(piece(f'L{k}', (0, 0), (300, k))) for k in range(70)))
    pieces.set_listed([], ())
    assert [k for k in range(70) if pieces.get(f'L{k}') is not None] == list(range(6, 70))


def test_a_mark_restores_what_was_flown_of_the_same_way_only():
    mark, = half_flown().marks((), lambda name, one: 1)
    assert (mark.task, mark.low, mark.high, mark.flown, mark.state) == ('L', 400.0, 600.0, 0.0, 1)
    again, stop = listed(MissionStop(LINE)), MissionStop(LINE)
    assert again.restore(mark) is again.get('L')
    assert left(again, stop) == [(300.0, 100.0), (300.0, 300.0)]
    assert again.marks((), lambda name, one: 1) == (mark,)
    assert again.marks({'L'}, lambda name, one: 1) == ()
    assert listed(MissionStop(piece('L', (0, 0), (310, 0)))).restore(mark) is None


def sample(t, x):
    return PositionSample(t, (x, 0.0, 40.0), (0.0, 0.0, 0.0))


def recent(*rows):
    """Positions (t, x), each after the one before it."""
    positions, before = RecentPositions(), rows[0][0]
    for t, x in rows:
        positions.add(sample(t, x), before)
        before = t
    return positions


@pytest.mark.parametrize(('begin', 'first'), [(0.0, 5.0), (50.0, 49.0), (900.0, 18.0)])
def test_a_way_is_followed_from_its_begin_on_or_for_six_seconds(begin, first):
    positions = recent(*((0.2 * n, n) for n in range(50)))
    unseen, samples = positions.on_way_from((begin, 0.0, 40.0), 5.0)
    assert unseen is None
    assert samples[0].position[0] == first
    assert samples[-1].position[0] == 49.0


def test_a_gap_may_hide_that_it_came_to_the_way_unless_the_mission_was_replaced():
    positions, far = recent((0.0, 0.0), (20.0, 300.0)), (900.0, 0.0, 40.0)
    assert positions.on_way_from(far, 5.0) == (sample(0.0, 0.0), (sample(20.0, 300.0),))
    positions.note_replaced()
    assert positions.on_way_from(far, 5.0) == (None, (sample(20.0, 300.0),))
    positions.clear()
    assert positions.on_way_from(far, 5.0) == (None, ())
