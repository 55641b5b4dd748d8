# SPDX-License-Identifier: Apache-2.0
"""Finding 32: long legs are flown at the height of the plan, and the points in between cost no
upload, count as no task, and keep to what a mission holds."""
import math
from dataclasses import replace

import pytest
from findings_bench import BOTH
from flight_bench import FlightBench
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.mission.first_leg import FirstLeg, LegStart
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.long_legs import MAX_LEG_LENGTH
from uav_task_alloc.model import Task

FAST = {'cruise_speed': 300.0, 'acceleration': 100.0, 'climb_rate': 40.0}
# no farther from home than PX4 takes a first item
PLACES = {'A': (0.0, 300.0, 50.0), 'B': (9_000.0, 300.0, 80.0), 'C': (-9_000.0, 300.0, 60.0),
          'D': (-9_000.0, 900.0, 60.0)}


def far_list(names, revision=1, **fields):
    return TaskList(
        revision, tuple(MissionStop(Task(name, PLACES[name])) for name in names), **fields
    )


def bench_of(kind, **config):
    bench = FlightBench(kind, configs={1: {**FAST, **config}}).discover()
    assert bench.run(lambda: bench.state().available)
    return bench


def on_board(bench):
    """Places of the items in the vehicle's own memory, with a task or ''."""
    own = bench.onboard().own
    assert len(bench.vehicles[1].mission.items) == len(bench.onboard().held) + own
    return [(item.position, item.task if item.completes else '')
            for item in bench.onboard().held if item.command != d.MAV_CMD_NAV_RETURN_TO_LAUNCH]


def is_verified(bench):
    return bench.onboard().state is MissionState.VERIFIED


@BOTH
def test_finding_32_long_legs_have_points_in_between_on_board(kind):
    bench = bench_of(kind)
    bench.assign(far_list('ABC', returns=True))
    assert bench.run(lambda: is_verified(bench))
    items = on_board(bench)
    assert [task for _, task in items if task] == list('ABC')
    places = [place for place, _ in items]
    assert [round(x) for x, _, _ in places] == [
        0, 4_500, 9_000, 4_500, 0, -4_500, -9_000]
    assert max(map(math.dist, places, places[1:])) <= MAX_LEG_LENGTH
    assert [round(z, 3) for _, _, z in places] == [50, 65, 80, 75, 70, 65, 60]


@BOTH
def test_finding_32_points_in_between_cost_no_upload_and_are_no_tasks(kind):
    bench = bench_of(kind)
    bench.assign(far_list('BCD'))
    assert bench.run(lambda: bench.started() == ['B'])
    uploads = bench.onboard().upload.uploads

    def renewed(names, revision):  # the list begins with the leg that is flown
        bench.assign(far_list(names, revision))
        assert bench.run(lambda: bench.state().list_revision == revision, 5.0)

    for revision, place in enumerate((1_000.0, 4_400.0, 4_600.0, 6_000.0), 2):
        assert bench.run(lambda place=place: bench.state().position[0] > place)
        renewed('BCD', revision)
    assert bench.run(lambda: bench.completed() == ['B'])
    for revision, place in enumerate((8_000.0, 4_000.0, 0.0, -3_000.0, -6_000.0), 7):
        assert bench.run(lambda place=place: bench.state().position[0] < place)
        renewed('CD', revision)
    assert bench.run(lambda: bench.completed() == ['B', 'C', 'D'])
    assert bench.onboard().upload.uploads == uploads
    assert (bench.started(), bench.failed()) == (['B', 'C', 'D'], [])
    assert bench.executor().telemetry.mode.value in ('mission', 'hold')


@BOTH
def test_finding_32_a_list_that_changes_in_mid_leg_does_not_fly_back(kind):
    bench = bench_of(kind)
    bench.assign(far_list('BCD'))
    assert bench.run(lambda: bench.state().position[0] > 6_000.0)
    bench.assign(far_list('BD', 2))
    east = []
    assert bench.run(lambda: east.append(bench.state().position[0]) or bench.completed())
    assert min(east) > 6_000.0 - 10.0
    assert bench.run(lambda: bench.completed() == ['B', 'D'])
    assert bench.ground_station.refusals.count == 0


@BOTH
def test_finding_32_a_horizon_counts_tasks_and_not_points_in_between(kind):
    bench = bench_of(kind, capacity=9)
    bench.assign(far_list('ABCD'))  # 8 items with those in between, and home on ArduPilot
    assert bench.run(lambda: bench.completed() == list('ABCD'), 600.0)
    assert bench.failed() == []
    smaller = bench_of(kind, capacity=7)
    smaller.assign(far_list('ABCD'))
    assert smaller.run(lambda: smaller.completed() == list('ABCD'), 600.0)
    assert smaller.failed() == []
    assert any('flying the first 2 tasks of 4' in note for note in smaller.notes)


@BOTH
def test_finding_32_a_first_leg_from_the_ground_begins_where_the_take_off_ends(kind):
    bench = bench_of(kind)
    bench.assign(far_list('B'))
    assert bench.run(lambda: is_verified(bench))
    assert bench.state().position[2] < 1.0
    heights = [place[2] for place, _ in on_board(bench)]
    assert heights == pytest.approx([65.0, 80.0], abs=0.1)


def test_finding_32_what_px4_refuses_as_too_far_it_refuses_still():
    bench = bench_of('px4')
    bench.assign(TaskList(1, (MissionStop(Task('far', (30_000.0, 300.0, 50.0))),)))
    assert bench.run(lambda: bench.failed() == ['far'], 120.0)
    assert any('First waypoint too far: 10' in note for note in bench.notes)


@BOTH
def test_finding_32_a_leg_home_has_points_in_between(kind):
    bench = bench_of(kind)
    bench.assign(far_list('A', returns=True, end_via=((0.0, 12_300.0, 50.0),)))
    assert bench.run(lambda: is_verified(bench))
    assert [place for place, _ in on_board(bench)] == [
        pytest.approx(p) for p in (PLACES['A'], (0.0, 4_300.0, 50.0), (0.0, 8_300.0, 50.0),
                                   (0.0, 12_300.0, 50.0))]


# The start of the first leg


START, END = (0.0, 0.0, 50.0), (20_000.0, 0.0, 50.0)
TASKS = TaskList(1, (MissionStop(Task('t', END)),))


class Somewhere:
    """A first leg of a vehicle that is put where a test wants it."""

    def __init__(self, plane=False):
        self.leg = FirstLeg(plane)
        self.at(*START)
        self.leg.begin(TASKS)

    def at(self, x, y, z, flying=True):
        self.leg.locate = lambda: LegStart((x, y, z), START, flying)
        return self

    def ahead(self):
        if self.leg.is_off:
            self.leg.begin(TASKS)
        return [point[0] for point in self.leg.points_ahead(END)]


def test_finding_32_points_are_left_out_once_they_are_well_passed():
    one = Somewhere()
    assert one.ahead() == [5_000.0, 10_000.0, 15_000.0]
    assert one.at(5_150.0, 20.0, 50.0).ahead() == [5_000.0, 10_000.0, 15_000.0]
    assert one.at(5_250.0, 20.0, 50.0).ahead() == [10_000.0, 15_000.0]
    one.leg.locate = lambda: None  # its position is unknown for a moment
    assert one.ahead() == [10_000.0, 15_000.0]
    assert one.at(19_000.0, 20.0, 50.0).ahead() == []


@pytest.mark.parametrize(('plane', 'beside', 'stays'), [
    (False, 40.0, True), (False, 60.0, False), (True, 250.0, True), (True, 350.0, False)])
def test_finding_32_a_new_list_begins_where_the_vehicle_is_if_it_has_left_the_leg(
        plane, beside, stays):
    one = Somewhere(plane)
    one.at(7_500.0, beside, 50.0).leg.begin(replace(TASKS, revision=2))
    assert (one.leg.points_ahead(END)[0][1] == 0.0) is stays


def test_finding_32_a_vehicle_that_flies_its_mission_keeps_its_points():
    one = Somewhere()
    one.at(7_500.0, 900.0, 90.0)
    assert not one.leg.is_off
    one.at(7_500.0, 900.0, 90.0, flying=False)  # flown by a pilot
    assert one.leg.is_off
    assert len(one.ahead()) == 2
    assert not one.leg.is_off
    assert one.at(7_500.0, 900.0, 130.0, flying=False).leg.is_off  # and climbs


def test_finding_32_a_vehicle_whose_place_is_not_known_has_no_points_until_it_is():
    leg = FirstLeg()
    leg.begin(TASKS)
    assert not leg.is_off
    assert leg.points_ahead(END) == ()
    leg.locate = lambda: LegStart(START, START)
    assert leg.is_off
    leg.begin(TASKS)
    assert len(leg.points_ahead(END)) == 3
