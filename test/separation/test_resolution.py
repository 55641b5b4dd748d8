# SPDX-License-Identifier: Apache-2.0
"""Resolution: head-on, crossing, overtaking, converging, and ten UAVs of one base."""
import math
from dataclasses import replace
from itertools import pairwise

import pytest

from uav_task_alloc import Separation
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.separation.conflicts import find_conflicts
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, leg_times
from uav_task_alloc.separation.leg_changes import TransitLimits
from uav_task_alloc.separation.resolution import flight_seconds, resolve
from uav_task_alloc.separation.volumes import flight_volumes

RULE = Separation(10.0, 5.0, 2.0)
FAR = 400.0  # [m]


def flight(name, *points, begin=0.0, cruise=10.0, service=5.0, **leg):
    legs = (FlightLeg(points, f't{name}', service, **leg),)
    return Flight(name, legs, points[0], cruise, 2.5, 1.5, begin)


def round_trip(name, pad, task, service=5.0):
    """From the ground to a task and back."""
    return Flight(name, (FlightLeg((pad, task), f't{name}', service, takes_off=True),
                         FlightLeg((task, pad), lands=True)), pad, 10.0, 2.5, 1.5, in_air=False)


def checked(*flights, rule=RULE, limits=None):
    """Resolved flights, which are apart now and were not."""
    assert find_conflicts(flight_volumes(flights, rule), rule)
    result = resolve(flights, rule, limits, places=True)
    assert result.left == []
    assert find_conflicts(flight_volumes(result.flights, rule), rule) == []
    assert all(each.resolution and each.detail for each in result.conflicts)
    for each in result.conflicts:  # on the way of one of both
        assert min(segment_distance(each.position, *ends) for flight in flights
                   if flight.uav in each.uavs for leg in flight.legs
                   for ends in pairwise(leg.flown())) < 1e-6
    return result


def extra_percent(before, after):
    planned = sum(map(flight_seconds, before))
    return 100.0 * (sum(map(flight_seconds, after)) - planned) / planned


ENCOUNTERS = {
    'head-on': (flight('a', (0, 0, 30), (FAR, 0, 30)), flight('b', (FAR, 50, 30), (0, -50, 30))),
    'crossing': (flight('a', (0, 200, 30), (FAR, 200, 30)),
                 flight('b', (200, 0, 30), (200, FAR, 30))),
    'overtaking': (flight('a', (50, 0, 30), (FAR, 0, 30), cruise=5.0),
                   flight('b', (0, 0, 30), (FAR + 100, 0, 30), cruise=15.0)),
}


@pytest.mark.parametrize('name', ENCOUNTERS)
@pytest.mark.parametrize('rule', [RULE, Separation(30.0, 10.0, 2.0)])
def test_an_encounter_is_resolved_by_heights_at_almost_no_time(name, rule):
    flights = ENCOUNTERS[name]
    result = checked(*flights, rule=rule)
    assert {each.resolution for each in result.conflicts} == {'height'}
    assert extra_percent(flights, result.flights) <= (3.0 if rule is RULE else 10.0)
    for before, after in zip(flights, result.flights, strict=True):
        for old, new in zip(before.legs, after.legs, strict=True):  # tasks keep their heights
            assert (old.points[0], old.points[-1]) == (new.points[0], new.points[-1])


def test_a_uav_without_a_conflict_keeps_its_flight():
    alone = flight('c', (0, 9000, 30), (FAR, 9000, 30))
    result = checked(*ENCOUNTERS['head-on'], alone)
    assert result.flights[2] is alone


def test_where_heights_are_not_allowed_one_waits():
    a = Flight('a', (FlightLeg(((0, 200, 30), (FAR, 200, 30)), 'ta', 5.0),
                     FlightLeg(((FAR, 200, 30), (900, 200, 30)), 'tc', 5.0)),
               (0, 200, 30), 10.0, 2.5, 1.5)
    b = Flight('b', (FlightLeg(((200, -100, 30), (200, -90, 30)), 'ts', 1.0),
                     FlightLeg(((200, -90, 30), (200, FAR, 30)), 'tb', 5.0)),
               (200, -100, 30), 10.0, 2.5, 1.5, begin=-10.0)
    result = checked(a, b, limits=TransitLimits(altitude_max=30.0))
    assert {each.resolution for each in result.conflicts} == {'hold'}


def test_two_that_converge_at_one_place_serve_it_one_after_the_other():
    a, b = (Flight(name, (FlightLeg((start, near), f's{name}', 1.0),
                          FlightLeg((near, task), f't{name}', 5.0),
                          FlightLeg((task, end), f'e{name}', 1.0)), start, 10.0, 2.5, 1.5)
            for name, start, near, task, end in (
                ('a', (0, 0, 30), (10, 0, 30), (200, 0, 30), (200, 300, 30)),
                ('b', (400, 0, 30), (390, 0, 30), (203, 0, 30), (203, -300, 30))))
    result = checked(a, b)
    assert any(leg.hold_until > 0.0 for leg in result.flights[1].legs)


def test_the_leg_under_way_stays_and_the_other_uav_gives_way():
    a, b = ENCOUNTERS['head-on']
    moving = Flight('b', (FlightLeg(b.legs[0].points, 'tb', 5.0, movable=False),), b.position,
                    10.0, 2.5, 1.5)
    result = checked(a, moving)
    assert result.flights[1] == moving
    assert result.flights[0] != a


def test_two_legs_under_way_are_left_to_others():
    a, b = (Flight(each.uav, (FlightLeg(each.legs[0].points, 't', movable=False),),
                   each.position, 10.0) for each in ENCOUNTERS['head-on'])
    result = resolve((a, b), RULE)
    assert result.left
    assert [each.resolution for each in result.conflicts] == ['']


@pytest.mark.parametrize('tried', [0, 1, 3])
def test_a_search_that_is_stopped_says_so_and_tries_no_more(tried):
    polls = iter(range(tried, -10**6, -1))
    flights = [flight(f'u{k}', (0, 5.0 * k, 30), (FAR, 5.0 * k, 30)) for k in range(6)]
    result = resolve(flights, RULE, TransitLimits(stop=lambda: next(polls) <= 0))
    assert next(polls) == -1  # no poll after that which ended it
    assert {each.detail for each in result.conflicts if not each.resolution} == {
        'no change was found in time'}


def test_a_height_that_a_zone_forbids_is_not_used():
    flights = ENCOUNTERS['crossing']
    limits = TransitLimits(is_clear=lambda points: max(z for _, _, z in points) < 38.0)
    result = checked(*flights, limits=limits)
    assert max(z for each in result.flights for leg in each.legs
               for _, _, z in leg.points) < 38.0


def test_a_deadline_is_not_broken_by_a_wait():
    limits = TransitLimits(altitude_max=30.0)
    late = flight('b', (200, 0, 0), (200, FAR, 30), takes_off=True, latest=53.0)
    late = Flight('b', late.legs, (200, 0, 0), 10.0, 2.5, 1.5, in_air=False)
    a = flight('a', (0, 200, 30), (FAR, 200, 30))
    assert resolve((a, late), RULE, limits).left
    free = Flight('b', (FlightLeg(late.legs[0].points, 'tb', 5.0, takes_off=True),), (200, 0, 0),
                  10.0, 2.5, 1.5, in_air=False)
    assert not resolve((a, free), RULE, limits).left


@pytest.mark.parametrize('rule', [RULE, Separation(30.0, 10.0, 2.0)])
@pytest.mark.parametrize('pads', [3.0, 15.0, 40.0])
def test_ten_uavs_of_one_base_take_off_and_land_apart(rule, pads):
    flights = []
    for k in range(10):
        angle = 2.4 * k  # tasks around the base
        flights.append(round_trip(f'u{k}', (pads * (k % 5), pads * (k // 5), 0.0), (
            500.0 * math.cos(angle), 500.0 * math.sin(angle), 30.0)))
    found = find_conflicts(flight_volumes(flights, rule), rule)
    result = resolve(flights, rule)
    assert found
    assert result.left == []
    # pads nearer than the distance: some have to wait in the air before they land
    most = 10.0 if pads >= rule.horizontal else 20.0
    assert extra_percent(flights, result.flights) <= most


def returning(name, x, pad, hold_until=-math.inf):
    """In the air, to a task and home; its way home cannot wait."""
    task = (x, 0.0, 30.0)
    return Flight(name, (
        FlightLeg(((x, -100.0, 30.0), task), f't{name}', 5.0),
        FlightLeg((task, (x, 200.0, 30.0)), f'T{name}', 5.0, hold_until=hold_until),
        FlightLeg(((x, 200.0, 30.0), pad), lands=True, may_wait=False)),
        (x, -100.0, 30.0), 10.0, 2.5, 1.5)


def test_a_return_that_would_cost_too_much_is_left_to_the_flight():
    rule = Separation(30.0, 10.0, 2.0)
    flights = [returning(f'u{k}', 60.0 * k, (90.0 + 8.0 * k, 400.0, 0.0)) for k in range(4)]
    free = resolve(flights, rule)
    cheap = resolve(flights, rule, TransitLimits(max_price=15.0))
    assert free.left == []
    extra, bounded = ([flight_seconds(after) - flight_seconds(before) for before, after in zip(
        flights, result.flights, strict=True)] for result in (free, cheap))
    assert max(extra) > 40.0
    assert max(bounded) <= 15.0
    assert cheap.left
    for each in cheap.left:  # nothing but ways home
        assert {flights[k].legs[n].task for k, n in zip(each.flights, each.legs, strict=True)
                } == {''}


@pytest.mark.parametrize('other', [True, False])
def test_a_wait_of_an_earlier_plan_ends_when_less_is_enough(other):
    a = flight('a', (0, 200, 30), (FAR, 200, 30), begin=30.0)
    b = returning('b', 200.0, (200.0, 300.0, 0.0), hold_until=90.0)
    limits = TransitLimits(altitude_max=31.0)
    after = resolve((a, b) if other else (b,), RULE, limits)
    assert after.left == []
    held = after.flights[-1].legs[1].hold_until
    assert (30.0 < held < 87.0) if other else held == -math.inf


@pytest.mark.parametrize('other', [True, False])
def test_a_return_at_the_height_of_an_earlier_plan_comes_down_when_the_way_is_free(other):
    a = flight('a', (0, 250, 30), (FAR, 250, 30), begin=10.0, service=60.0)
    b = returning('b', 200.0, (200.0, 500.0, 0.0))
    home = b.legs[-1]
    x, y, _ = home.points[0]
    high = replace(home, points=((x, y, 30.0), (x, y + 100.0, 70.0), (x, 500.0, 70.0),
                                 home.points[-1]))
    b = replace(b, legs=(*b.legs[:-1], high))
    assert not find_conflicts(flight_volumes((a, b), RULE), RULE)
    after = resolve((a, b) if other else (b,), RULE)
    assert after.left == []
    top = max(point[2] for point in after.flights[-1].legs[-1].points)
    assert top == (35.5 if other else 30.0)
    # a height that costs little stays
    small = replace(home, points=((x, y, 30.0), (x, y + 100.0, 31.0), (x, 500.0, 31.0),
                                  home.points[-1]))
    kept = replace(b, legs=(*b.legs[:-1], small))
    assert resolve((kept,), RULE).flights[0].legs[-1].points == small.points


def test_a_take_off_ends_at_its_own_height_and_the_leg_goes_on_from_there():
    leg = FlightLeg(((0, 0, 0), (200, 0, 30)), 't', takes_off=True, top=50.0)
    assert leg.flown() == ((0, 0, 0), (0, 0, 50.0), (200, 0, 30))
    low = Flight('low', (leg,), (0, 0, 0), 10.0, 2.5, 1.5, in_air=False)
    over = flight('over', (-100, 0, 50), (100, 0, 50), begin=12.0)
    found = find_conflicts(flight_volumes((over, low), RULE), RULE)
    assert found
    assert checked(over, low).flights[1].legs[0] != leg


class Slow:
    """A pace with a stop of 6 s and a take-off of 4 s."""

    takeoff = 4.0

    def seconds(self, points):
        return math.dist(points[0], points[-1]) / 10.0

    def from_stop(self, points, share=0.0):
        return self.seconds(points) + 6.0 * (1.0 - 0.5 * share)


def test_the_measured_pace_counts_stops_and_take_offs():
    leg = FlightLeg(((0, 0, 0), (100, 0, 40)), 't', takes_off=True, top=40.0)
    planned = Flight('u', (leg,), (0, 0, 0), 10.0, in_air=False, pace=Slow())
    times = leg_times(planned, leg, 0.0, True)
    assert (times.begin, times.arrival) == (4.0, 4.0 + 4.0 + 16.0)
    assert [seconds for seconds, _ in planned.parts(leg)] == [4.0, 16.0]
    way = FlightLeg(((0, 0, 40), (100, 0, 40)), 't')
    flying = Flight('u', (way,), (0, 0, 40), 10.0, pace=Slow(), share=1.0)
    assert flying.leg_seconds(way, first=True) == 13.0
    assert flying.leg_seconds(way) == 16.0


def test_the_error_measured_of_a_uav_is_that_of_its_times():
    flights = [Flight('u', (), (0, 0, 40), speed_error=share, late=late)
               for share, late in ((None, 0.0), (0.05, 0.0), (0.05, 2.0))]
    assert [each.uncertainty(40.0, RULE) for each in flights] == pytest.approx([8.0, 2.0, 4.0])


def climbing(name, x, z, goal):
    """In its take-off above its pad, on the way to a task."""
    pad = (x, 0.0, z)
    return Flight(name, (FlightLeg((pad, goal), f't{name}', 5.0, top=50.0),), pad, 10.0, 2.5, 1.5)


@pytest.mark.parametrize(('gap', 'rule'), [(10.5, RULE), (39.0, Separation(30.0, 10.0, 2.0))])
def test_one_in_its_take_off_leaves_above_another_that_climbs_beside_it(gap, rule):
    east, north = climbing('a', 0.0, 15.0, (200.0, 0.0, 50.0)), climbing(
        'b', gap, 5.0, (gap, 200.0, 50.0))
    first, second = checked(east, north, rule=rule).flights
    assert max(point[2] for point in first.legs[0].points) == 50.0 + rule.vertical + 0.5
    assert second is north


def test_what_crosses_a_climb_leaves_the_leg_after_it_to_be_changed():
    east, north = climbing('a', 0.0, 15.0, (200.0, 0.0, 50.0)), climbing(
        'b', 10.5, 5.0, (10.5, 200.0, 50.0))
    through = flight('c', (0, -30, 32), (-100, 400, 32), movable=False)
    after = resolve((east, north, through), RULE)
    assert [each.flights for each in after.left] == [(0, 2)]
    assert max(point[2] for point in after.flights[0].legs[0].points) == 55.5


@pytest.mark.parametrize('first', [True, False])
def test_one_that_stays_in_the_air_without_a_leg_is_flown_around(first):
    pair = (flight('a', (0, 0, 30), (FAR, 0, 30)), Flight('b', (), (200, 0, 30), 10.0, 2.5, 1.5))
    result = checked(*(pair if first else pair[::-1]))
    assert [each.resolution for each in result.conflicts] == ['height']


@pytest.mark.parametrize('name', ['crossing', 'head-on'])
def test_between_limits_that_leave_room_for_one_more_layer_exactly_that_is_used(name):
    result = checked(*ENCOUNTERS[name], limits=TransitLimits(30.0, 35.0))
    assert {each.resolution for each in result.conflicts} == {'height'}
    assert all(leg.hold_until == -math.inf for each in result.flights for leg in each.legs)
