# SPDX-License-Identifier: Apache-2.0
"""Planned times of services with actions against those of both simulated autopilots."""
from dataclasses import replace
from itertools import pairwise

import pytest
from flight_bench import FlightBench
from piece_bench import TRIGGER, list_of, strip

from uav_task_alloc.actions import LASTING, Action
from uav_task_alloc.allocator.list_records import ListStop
from uav_task_alloc.allocator.state.flight_pace import FlightPace, UavFlight
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.mavlink.action_commands import ARDUCOPTER_ACTIONS, PX4_ACTIONS
from uav_task_alloc.model import Leg, Task, Uav

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
SLOW, VIDEO = Action('speed', {'speed': 5.0}), Action('video')
GIMBAL, WAIT = Action('gimbal', {'pitch': -1.0}), Action('wait', {'seconds': 4.0})


def flown_times(kind, tasks, turned=()):
    """When each task is completed [s]."""
    bench, times = FlightBench(kind).discover(), []
    bench.assign(list_of(*tasks, turned=turned))

    def all_done():
        if len(bench.completed()) > len(times):
            times.append(bench.now)
        return len(times) == len(tasks)
    assert bench.run(all_done, 600.0)
    return times


def planned_times(tasks, turned=()):
    """When each is planned to end [s], with what a stop costs a copter."""
    pace = FlightPace(10.0, 2.5, 1.5)
    flight = UavFlight.of(Uav('a', (0.0, 0.0, 40.0), cruise_speed=10.0, home=(0.0, 0.0, 0.0)))
    flight = replace(flight, pace=replace(pace, stop_time=pace.usual_stop))
    stops = [ListStop(each, Leg((), 0.0), 0.0, reversed=each.id in turned) for each in tasks]
    return [stop.finish for stop in timed_stops(stops, flight)]


def spans(times):
    return [b - a for a, b in pairwise(times)]


@BOTH
@pytest.mark.parametrize('actions', [(), (TRIGGER,), (VIDEO,), (SLOW,), (TRIGGER, SLOW)])
def test_strips_take_as_long_as_planned(kind, actions):
    tasks = [strip(k, actions=actions) for k in range(4)]
    turned = ('F#1', 'F#3')
    planned, flown = (spans(times) for times in (planned_times(tasks, turned),
                                                 flown_times(kind, tasks, turned)))
    assert planned == pytest.approx(flown, abs=3.0)
    assert sum(planned) == pytest.approx(sum(flown), abs=6.0)


def points(actions, service_times):
    return [Task(f'P{k}', (80.0 * k, 60.0, 40.0), service_time=seconds, actions=actions)
            for k, seconds in enumerate(service_times)]


@BOTH
@pytest.mark.parametrize('actions', [(GIMBAL,), (VIDEO,), (GIMBAL, WAIT)])
def test_actions_at_points_add_what_is_planned(kind, actions):
    given, plain = (0.0, 5.0, 0.0, 5.0), (1.0, 5.0, 1.0, 5.0)
    tasks, others = points(actions, given), points((), plain)
    planned = [with_actions - without for with_actions, without in zip(
        spans(planned_times(tasks)), spans(planned_times(others)), strict=True)]
    flown = [with_actions - without for with_actions, without in zip(
        spans(flown_times(kind, tasks)), spans(flown_times(kind, others)), strict=True)]
    assert planned == pytest.approx(flown, abs=1.0)


@pytest.mark.parametrize('rows', [ARDUCOPTER_ACTIONS, PX4_ACTIONS])
def test_the_actions_that_are_ended_are_those_of_the_profiles(rows):
    assert {name for name, row in rows.items() if row.end is not None} == LASTING
