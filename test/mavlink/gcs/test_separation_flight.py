# SPDX-License-Identifier: Apache-2.0
"""Allocator, monitor and bridge keep simulated autopilots apart, by their true positions."""
import math

import pytest
from allocation import greedy
from flight_bench import FlightBench
from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning, separated_lists
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.status import UavMode
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.mission.verified_mission import MissionState
from uav_task_alloc.model import Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.monitor import AlertAction
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.separation_judge import SeparationJudge, TrueState

PAIRS = pytest.mark.parametrize('kinds', [('ardupilot', 'px4'), ('px4', 'ardupilot')], ids=str)
WEST, EAST, SOUTH, NORTH = (-250.0, 0.0), (250.0, 0.0), (0.0, -250.0), (0.0, 250.0)


@pytest.fixture
def monitor_alone(monkeypatch):
    """Plans as without separation."""
    monkeypatch.setattr(separated_lists, 'with_separation', lambda world, built, stamp: built)


class Sky(FlightBench):
    """UAVs that fly from one place to another by an allocator with its monitor."""

    def __init__(self, kinds, ways, horizontal=10.0, height=50.0, tick=0.1, **params):
        places = {n: (*way[0], 0.0) for n, way in enumerate(ways, 1)}
        super().__init__(*kinds, configs={n: {'position': place} for n, place in places.items()},
                         cruise_altitude=height, tick=tick)
        self.core = Allocator(AllocatorParams(
            **{'separation__horizontal': horizontal, 'background_budget': 0.0,
               'route_end': 'hold', **params}), 0.0)
        self.core.set_kernels_ready()
        self.judge, self.losses = SeparationJudge(10.0, 5.0), []
        self.alerts, self.held, self.allocated, self.taken = [], set(), 0.0, 0
        self.discover()
        assert self.run(lambda: all(v.flight.positioned for v in self.vehicles.values()), 60.0)
        for n, way in enumerate(ways, 1):
            self.core.world.announce(AnnouncementAction.ADD, [Task(
                f't{n}{k}', (*place, height), allowed_uavs=frozenset({f'uav_{n}'}))
                for k, place in enumerate(way)], self.now, self.now)

    def _move(self):
        super()._move()
        begun, _ = self.judge.step(self.now, {
            str(n): TrueState(v.flight.body.position, v.flight.home, not v.flight.landed)
            for n, v in self.vehicles.items()})
        self.losses += begun
        if hasattr(self, 'core') and self.now >= self.allocated:
            self.allocated = self.now + 0.5
            self.allocate()

    def allocate(self):
        """Pass reports and events on, plan, and publish: holds before lists."""
        world = self.core.world
        for uav_id, event in self.events[self.taken:]:
            world.event(TaskEvent(event.task, uav_id, event.revision, TaskEventKind[event.event]),
                        self.now, self.now)
        self.taken = len(self.events)
        for n in self.vehicles:
            status = self.state(n)
            if self.executor(n).telemetry.position_at < 0.0:
                continue
            world.update_uav(UavReport(
                status.uav_id, status.position, status.home, cruise_speed=15.0,
                available=status.available, active_task=status.active_task,
                list_revision=status.list_revision, standby=status.mode is UavMode.STANDBY,
                velocity=status.velocity, mode=status.mode.name, authority=status.authority.name,
                foreign=status.mission_state is MissionState.FOREIGN,
                return_height=status.return_height, takeoff_height=status.takeoff_height,
            ), self.now, self.now)
        self.core.tick(self.now, self.now)
        problem = self.core.due(self.now, self.now)
        if problem is not None:
            self.core.adopt(planning.solve_problem(
                greedy, problem, world.params, lambda: False), self.now, self.now)
        step = self.core.separate(self.now, self.now)
        self.alerts += step.alerts
        for hold in step.holds:
            self.held |= {hold.uav} if hold.hold else set()
            self.ground_station.hold(hold.uav, HoldRequest('separation', hold.hold, hold.reason),
                                     self.now)
        for each in self.core.collect().lists.values():
            stops = tuple(MissionStop(stop.task, stop.leg.via, stop.wait,
                                      self.now + stop.eta + stop.wait) for stop in each.stops)
            self.assign(TaskList(each.revision, stops, each.returns, each.end_via),
                        int(each.uav[4:]))

    def done(self, *numbers):
        return all(len(self.completed(n)) == 2 for n in numbers)

    def home(self):
        return all(v.flight.landed and not v.flight.armed and self.completed(n)
                   for n, v in self.vehicles.items())

    def stop(self, n, mode):
        """A pilot sets a mode."""
        vehicle = self.vehicles[n]
        vehicle.rc_mode(vehicle.flight.custom_modes[mode])

    def crossed(self, n):
        """Whether a UAV is under way to its second task, and half a minute from the middle."""
        x, y, _ = self.vehicles[n].flight.body.position
        return len(self.completed(n)) == 1 and 60.0 < abs(x + y) < 190.0


@PAIRS
def test_without_separation_two_that_cross_lose_it(kinds):
    sky = Sky(kinds, [(WEST, EAST), (SOUTH, NORTH)], horizontal=0.0)
    assert sky.run(lambda: sky.done(1, 2), 200.0)
    assert sky.losses
    assert not sky.held


@PAIRS
@pytest.mark.usefixtures('monitor_alone')
def test_of_two_that_cross_one_holds_and_both_fly_all_tasks(kinds):
    sky = Sky(kinds, [(WEST, EAST), (SOUTH, NORTH)])
    assert sky.run(lambda: sky.done(1, 2), 300.0)
    assert not sky.losses
    assert len(sky.held) == 1
    assert [alert.action for alert in sky.alerts][-1] is AlertAction.RELEASE


@PAIRS
@pytest.mark.usefixtures('monitor_alone')
def test_one_that_a_pilot_stops_in_mid_leg_is_not_run_into(kinds):
    sky = Sky(kinds, [(WEST, EAST), (SOUTH, NORTH)])
    assert sky.run(lambda: sky.crossed(1), 200.0)
    assert sky.run(lambda: abs(sky.vehicles[1].flight.body.position[0]) < 45.0, 60.0)
    sky.stop(1, FlightMode.HOLD)
    sky.run(limit=60.0)
    assert not sky.losses
    assert 'uav_1' not in {alert.holder for alert in sky.alerts if alert.stamp > sky.now - 55.0}


@PAIRS
@pytest.mark.usefixtures('monitor_alone')
def test_one_that_returns_by_a_failsafe_keeps_its_way(kinds):
    sky = Sky(kinds, [(WEST, EAST), (SOUTH, NORTH)])
    assert sky.run(lambda: sky.crossed(1), 200.0)
    home = sky.vehicles[1].flight.custom_modes[FlightMode.RETURN]
    sky.vehicles[1].failsafe('radio', home)
    assert sky.run(lambda: sky.done(2), 200.0)
    assert sky.run(lambda: sky.vehicles[1].flight.landed, 200.0)
    assert not sky.losses


@PAIRS
@pytest.mark.usefixtures('monitor_alone')
def test_head_on_both_stop_which_is_said_as_unresolved_and_plans_are_asked_for(kinds):
    sky = Sky(kinds, [(WEST, EAST), (EAST, WEST)])
    assert sky.run(lambda: any(alert.action is AlertAction.UNRESOLVED for alert in sky.alerts),
                   200.0)
    sky.run(limit=60.0)
    assert not sky.losses
    assert sky.held == {'uav_1', 'uav_2'}
    assert all(sky.state(n).mode is UavMode.HOLD for n in (1, 2))


@PAIRS
@pytest.mark.parametrize('ways', [[(WEST, EAST), (EAST, WEST)], [(WEST, EAST), (SOUTH, NORTH)]],
                         ids=['head-on', 'crossing'])
def test_with_plans_and_monitor_all_tasks_are_flown_apart(kinds, ways):
    sky = Sky(kinds, ways)
    assert sky.run(lambda: sky.done(1, 2), 300.0)
    assert not sky.losses


@pytest.mark.parametrize('ways', [
    [((-150.0, 0.0), EAST), ((-250.0, 0.0), (200.0, 3.0))],
    [(WEST, (3.0, 0.0)), (SOUTH, (0.0, 3.0))]], ids=['overtaking', 'to one place'])
def test_uavs_that_fly_the_same_way_or_to_one_place_stay_apart(ways):
    sky = Sky(('ardupilot', 'px4'), ways)
    sky.run(lambda: sky.done(1, 2), 150.0)
    assert not sky.losses
    assert sky.done(1) or sky.done(2)


def test_ten_uavs_of_one_base_take_off_and_land_apart_by_items_that_land():
    ways = [[(12.0 * (n % 5), 12.0 * (n // 5)),
             (120.0 * math.cos(0.6 * n), 120.0 * math.sin(0.6 * n))] for n in range(10)]
    sky = Sky(('ardupilot', 'px4') * 5, ways, height=20.0, tick=0.4, route_end='home')
    for n in range(1, 11):  # only the task away from the base
        sky.core.world.cancel([f't{n}0'], sky.now, sky.now)
    assert sky.run(sky.home, 500.0)
    assert not sky.losses
    for vehicle in sky.vehicles.values():
        assert vehicle.flight.items[-1].command == dialect.MAV_CMD_NAV_LAND
