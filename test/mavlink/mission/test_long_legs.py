# SPDX-License-Identifier: Apache-2.0
"""Finding 32: what is flown from item to item against what is planned, straight in ENU."""
import math
from itertools import pairwise

import numpy as np
import pytest

from uav_task_alloc.geometry.frames import Origin, to_enu_batch, to_geodetic_batch
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.long_legs import (
    MAX_LEG_LENGTH,
    first_point,
    first_points,
    legs,
    points_between,
    with_points_between,
)
from uav_task_alloc.model import Task

ORIGINS = {'equator': Origin(0.0, 0.0), 'zurich': Origin(47.4, 8.5, 488.0),
           'south': Origin(-33.9, 18.4, 120.0), 'north': Origin(78.2, 15.6, 30.0)}


def too_high(origin, points, start, end):
    """By how much [m], at most, a flight over points is above or below the straight line.

    As an autopilot flies: along a great circle, with an altitude that changes evenly.
    """
    rows = to_geodetic_batch(origin, points)
    start, end = np.array(start), np.array(end)
    worst = 0.0
    for one, two in pairwise(rows):
        a, b = map(unit, (one, two))
        angle = math.acos(min(1.0, a @ b))
        share = np.linspace(0.0, 1.0, 41)
        path = (np.outer(np.sin((1 - share) * angle), a) + np.outer(np.sin(share * angle), b)
               ) / math.sin(angle)
        flown = to_enu_batch(origin, np.column_stack([
            np.degrees(np.arcsin(path[:, 2])), np.degrees(np.arctan2(path[:, 1], path[:, 0])),
            one[2] + (two[2] - one[2]) * share]))
        ahead = (end - start)[:2]
        along = (flown - start)[:, :2] @ ahead / (ahead @ ahead)
        worst = max(worst, np.abs(flown[:, 2] - start[2] - along * (end[2] - start[2])).max())
    return worst


def unit(row):
    latitude, longitude = np.radians(row[:2])
    return np.array([math.cos(latitude) * math.cos(longitude),
                     math.cos(latitude) * math.sin(longitude), math.sin(latitude)])


@pytest.mark.parametrize('origin', ORIGINS.values(), ids=ORIGINS)
@pytest.mark.parametrize('length', [4_999.0, 5_001.0, 20_000.0, 50_000.0, 120_000.0])
def test_finding_32_a_leg_is_flown_within_half_a_metre_of_its_height(origin, length):
    for heading in np.radians(range(0, 360, 30)):
        start = (200.0, -300.0, 50.0)
        end = (start[0] + length * math.sin(heading), start[1] + length * math.cos(heading), 90.0)
        assert too_high(origin, [start, *points_between(start, end), end], start, end) < 0.5


def test_finding_32_without_points_in_between_50_km_are_49_m_off():
    start, end = (0.0, 0.0, 50.0), (50_000.0, 0.0, 50.0)
    assert too_high(ORIGINS['zurich'], [start, end], start, end) == pytest.approx(49.0, abs=0.5)
    assert len(points_between(start, end)) == 9


@pytest.mark.parametrize('far', [30_000.0, 50_000.0])
def test_finding_32_a_first_item_that_is_too_far_stays_too_far(far):
    start, end = (0.0, 0.0, 50.0), (far, 0.0, 50.0)
    points = first_points(start, end, (0.0, 0.0, 0.0), 10_000.0)
    assert 10_050.0 < points[0][0] <= 11_100.0
    path = [start, *points, end]
    assert max(map(math.dist, path[1:], path[2:])) <= MAX_LEG_LENGTH
    assert too_high(ORIGINS['zurich'], path, start, end) < 2.5
    assert too_high(ORIGINS['zurich'], path[1:], start, end) < 0.5
    assert first_points(start, end, (0.0, 0.0, 0.0), math.inf) == points_between(start, end)
    assert first_points((20_000.0, 0.0, 50.0), end, (0.0, 0.0, 0.0), 10_000.0) == points_between(
        (20_000.0, 0.0, 50.0), end)


def lists(end_via=(), returns=True):
    via = ((1_000.0, 0.0, 60.0), (14_000.0, 0.0, 60.0))
    return TaskList(
        7,
        (
            MissionStop(Task('a', (0.0, 0.0, 50.0))),
            MissionStop(Task('b', (15_000.0, 0.0, 50.0)), via),
        ),
        returns,
        end_via,
    )


def test_finding_32_points_in_between_are_detour_points_and_no_tasks():
    before = lists(end_via=((15_000.0, 9_000.0, 50.0),))
    after = with_points_between(before, ((-9.0, 0.0, 50.0),))
    assert [stop.task for stop in after.stops] == [stop.task for stop in before.stops]
    assert (after.revision, after.returns) == (7, True)
    assert after.stops[0].via == ((-9.0, 0.0, 50.0),)
    assert set(before.stops[1].via) < set(after.stops[1].via)
    assert after.end_via == ((15_000.0, 4_500.0, 50.0), (15_000.0, 9_000.0, 50.0))
    assert all(math.dist(one, two) <= MAX_LEG_LENGTH for one, two in legs(after, None))


def test_finding_32_short_legs_stay_as_they_are():
    short = TaskList(1, (MissionStop(Task('a', (0.0, 0.0, 50.0))),
                         MissionStop(Task('b', (4_000.0, 0.0, 50.0)), ((2_000.0, 0.0, 70.0),))))
    assert with_points_between(short) == short
    assert points_between((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == ()


def test_the_first_point_of_a_list_is_a_detour_point_a_task_or_the_leg_home():
    assert first_point(lists()) == (0.0, 0.0, 50.0)
    home = TaskList(1, (), True, ((9.0, 9.0, 9.0),))
    assert first_point(home) == (9.0, 9.0, 9.0)
    assert first_point(TaskList(1, (), True)) is None
    assert with_points_between(home, ((1.0, 1.0, 1.0),)).end_via == (
        (1.0, 1.0, 1.0), (9.0, 9.0, 9.0))
