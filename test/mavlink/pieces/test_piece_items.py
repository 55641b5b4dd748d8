# SPDX-License-Identifier: Apache-2.0
"""The items of ways, and how much of a way is flown, by written down positions."""
import math
from itertools import pairwise

import pytest
from mission_bench import ORIGIN, PROFILES
from piece_bench import TRIGGER, list_of, piece, strip

from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.item import Item, leg_count
from uav_task_alloc.mavlink.mission.items import MissionStop, mission_items
from uav_task_alloc.mavlink.mission.long_legs import with_points_between
from uav_task_alloc.mavlink.mission.piece_coverage import PieceCoverage
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.model import Task

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
SPEED = 15.0  # [m/s]
ALONG = Item(16, task='L', along=True)
LINE = piece('L', (0, 0), (300, 0), (300, 300))


def items(kind, *stops):
    return mission_items(list_of(*stops), PROFILES[kind].rules, ORIGIN)


class Flown:
    """A coverage that is given positions every 0.2 s along points, in mission mode."""

    def __init__(self, turned=False, task=LINE):
        self.coverage, self.t, self.task = PieceCoverage(), 0.0, task
        self.stop = MissionStop(task, reversed=turned)
        self.coverage.set_listed([self.stop])

    def fly(self, *points, step=0.2, item=ALONG):
        for a, b in pairwise(points):
            count = max(1, round(math.dist(a, b) / (SPEED * step)))
            for k in range(count + 1):
                place = tuple(p + (q - p) * k / count for p, q in zip(a, b, strict=True))
                self.t += step
                self.coverage.note_active(item, item is not None)
                self.coverage.add_position(PositionSample(self.t, place, (0.0, 0.0, 0.0)), SPEED)
        return self

    def leave(self):
        self.coverage.note_active(None, False)
        return self

    def rest(self):
        return [tuple(round(c) for c in p[:2]) for p in self.coverage.rest(self.stop).way]

    @property
    def covered(self):
        return self.coverage.covers('L', self.t, SPEED)


def at(x, y):
    return (float(x), float(y), 40.0)


def test_a_way_that_was_followed_is_covered():
    assert Flown().fly(at(0, 0), at(300, 0), at(300, 300)).covered
    assert Flown(turned=True).fly(at(300, 300), at(300, 0), at(0, 0)).covered


@pytest.mark.parametrize(('beside', 'covered'), [(8.0, True), (12.0, False)])
def test_a_way_is_followed_within_10_m(beside, covered):
    assert Flown().fly(at(0, beside), at(300, beside), at(300, 300)).covered is covered


def test_a_way_that_was_cut_short_is_not_covered():
    flown = Flown().fly(at(0, 0), at(200, 0), at(300, 300))
    assert not flown.covered
    flown.leave()
    first = flown.rest()[0]
    assert 190 <= first[0] <= 225
    assert flown.rest()[1:] == [(300, 0), (300, 300)]


def test_a_way_is_continued_from_where_it_was_left():
    flown = Flown().fly(at(0, 0), at(300, 0), at(300, 90)).leave()
    assert flown.rest() == [(300, 90), (300, 300)]
    flown.fly(at(300, 90), at(300, 300))
    assert flown.covered


def test_what_is_left_is_the_same_from_the_other_end():
    flown = Flown().fly(at(0, 0), at(200, 0)).leave()
    flown.stop = MissionStop(LINE, reversed=True)
    flown.coverage.set_listed([flown.stop])
    assert flown.rest() == [(300, 300), (300, 0), (200, 0)]


def test_positions_outside_of_the_mission_mode_count_for_nothing():
    flown = Flown().fly(at(0, 0), at(300, 0), at(300, 300), item=None)
    assert not flown.covered
    assert flown.rest() == [(0, 0), (300, 0), (300, 300)]


def test_a_way_whose_end_was_reached_from_elsewhere_is_not_covered():
    flown = Flown(task=piece('L', (0, 0), (60, 0))).fly(at(60, -100), at(60, 0))
    assert not flown.covered
    assert flown.leave().rest() == [(0, 0), (60, 0)]


def test_silence_after_a_position_elsewhere_covers_no_way_that_begins_elsewhere():
    flown = Flown(task=piece('L', (0, 0), (60, 0))).fly(at(100, 60), at(95, 55))
    flown.t += 3.5
    flown.fly(at(60, 0), at(60, 0))
    assert not flown.covered


def test_a_way_that_is_resumed_further_on_is_not_covered():
    flown = Flown().fly(at(50, 60), at(50, 0), item=None).fly(at(50, 0), at(300, 0), at(300, 300))
    assert not flown.covered
    assert flown.leave().rest() == [(0, 0), (300, 0), (300, 300)]


def test_a_way_left_for_a_while_is_not_covered():
    flown = Flown().fly(at(0, 0), at(100, 0), at(140, 30), at(180, 30), at(220, 0), at(300, 0),
                        at(300, 300))
    assert not flown.covered


def test_a_way_that_was_begun_before_the_report_of_its_item_is_covered():
    flown = Flown().fly(at(-60, 0), at(0, 0), at(70, 0), item=Item(16, task='X'))
    assert flown.fly(at(73, 0), at(300, 0), at(300, 300)).covered


def test_a_gap_that_the_speed_explains_is_flown():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.t += 300.0 / SPEED
    flown.fly(at(300, 100), at(300, 300))
    assert flown.covered


def test_a_gap_while_another_mission_may_be_on_board_is_not_flown():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.coverage.mission_known = False
    flown.t += 400.0 / SPEED
    assert not flown.coverage.covers('L', flown.t, SPEED)
    flown.fly(at(300, 200), at(300, 300))
    assert not flown.covered
    assert flown.leave().rest() == [(100, 0), (300, 0), (300, 300)]


def test_a_gap_after_the_mission_was_replaced_is_not_flown():
    flown = Flown().fly(at(0, 0), at(100, 0))
    version = flown.coverage.pieces.version
    flown.coverage.note_replaced(Item(16, task='X'))
    flown.fly(at(102, 2), at(104, 5), item=Item(16, task='X'))
    flown.t += 400.0 / SPEED
    flown.fly(at(300, 200), at(300, 300), item=Item(16, task='X'))
    assert not flown.covered
    # else the mission on board is another one at once
    assert flown.coverage.pieces.version == version
    assert flown.rest() == [(100, 0), (300, 0), (300, 300)]


def test_a_mission_that_continues_a_way_leaves_nothing():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.coverage.note_replaced(ALONG)
    assert flown.fly(at(100, 0), at(300, 0), at(300, 300)).covered
    assert not flown.coverage.left


def test_a_way_of_a_replaced_mission_that_is_begun_again_is_followed():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.coverage.note_replaced(Item(16, task='X'))
    flown.fly(at(100, 0), at(0, -60), at(0, 0), item=Item(16, task='X'))
    assert flown.fly(at(0, 0), at(300, 0), at(300, 300)).covered


def test_silence_after_a_position_off_a_way_that_is_current_covers_nothing():
    flown = Flown(task=piece('L', (0, 0), (60, 0))).fly(at(30, -100), at(33, -90))
    flown.t += 20.0
    flown.fly(at(60, 10), at(60, 60), item=Item(16, task='X'))
    assert not flown.covered


def test_silence_in_which_the_mission_was_left_flies_no_way_on():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.t += 600.0 / SPEED
    flown.fly(at(100, 300), at(100, 310)).leave()
    assert flown.rest() == [(100, 0), (300, 0), (300, 300)]


def test_a_gap_that_is_too_short_for_the_way_is_not_flown():
    flown = Flown().fly(at(0, 0), at(100, 0))
    flown.t += 4.0
    flown.fly(at(300, 100), at(300, 300))
    assert not flown.covered


def test_a_way_that_ended_in_silence_is_covered_once_there_was_the_time():
    flown = Flown().fly(at(0, 0), at(300, 0), at(300, 100))
    assert not flown.covered
    assert flown.coverage.covers('L', flown.t + 200.0 / SPEED, SPEED)


def test_a_restarted_bridge_knows_the_rest():
    flown = Flown().fly(at(0, 0), at(300, 0), at(300, 90)).leave()
    again = Flown()
    again.coverage.restore(flown.coverage.marks(()), [again.stop], (), SPEED)
    assert again.rest() == [(300, 90), (300, 300)]
    assert flown.coverage.marks({'L'}) == ()


def test_a_mark_of_another_way_of_that_id_is_ignored():
    flown = Flown().fly(at(0, 0), at(300, 0)).leave()
    again = Flown(task=piece('L', (0, 0), (300, 0), (300, 310)))
    again.coverage.restore(flown.coverage.marks(()), [again.stop], (), SPEED)
    assert again.rest()[0] == (0, 0)


def test_many_ways_of_a_list_are_all_kept():
    coverage = PieceCoverage()
    stops = [MissionStop(strip(k)) for k in range(200)]
    coverage.set_listed(stops)
    assert not coverage.covers('F#0', 0.0, SPEED) or math.isinf(coverage._sampled)
    coverage.add_position(PositionSample(1.0, at(0, 0), (0.0, 0.0, 0.0)), SPEED)
    assert not any(coverage.covers(f'F#{k}', 1.0, SPEED) for k in range(200))


def test_a_way_is_the_same_place_from_either_end():
    back = piece('L', (300, 300), (300, 0), (0, 0))
    assert place_of(LINE) == place_of(back)
    assert place_of(LINE) != place_of(piece('L', (0, 0), (300, 0), (300, 301)))
    assert place_of(Task('P', at(1, 2))) == at(1, 2)


@BOTH
def test_only_the_last_item_of_a_way_completes(kind):
    made = items(kind, strip(0), strip(1))
    assert [n for n, item in enumerate(made) if item.completes] == [4, 9]
    assert made[4].params[0] == 1.0  # after the end of the trigger it stays a second
    assert [item.task for item in made] == ['F#0'] * 5 + ['F#1'] * 5


@BOTH
def test_a_closed_way_ends_unlike_it_begins(kind):
    made = items(kind, piece('O', (0, 0), (50, 0), (50, 50), (0, 0)))
    assert (made[0].params[0], made[-1].params[0]) == (0.0, 1.0)


def test_the_points_of_one_way_are_one_leg():
    made = items('px4', strip(0, [TRIGGER]), strip(1, [TRIGGER]))
    assert leg_count(made) == 4  # to each strip, and along it
    assert leg_count(made[1:5]) == 1


def test_a_long_way_is_divided_like_other_long_legs():
    way = piece('W', (0, 0), (12000, 0))
    divided = with_points_between(list_of(way))
    made = mission_items(divided, PROFILES['px4'].rules, ORIGIN)
    assert [round(item.position[0]) for item in made] == [0, 4000, 8000, 12000]
    assert [item.completes for item in made] == [False, False, False, True]
    assert not any(stop.begun for stop in divided.stops)
