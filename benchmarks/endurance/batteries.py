# SPDX-License-Identifier: Apache-2.0
"""Hours of service with battery changes: allocator, bridge and autopilots over virtual time.

Run: `python benchmarks/endurance/batteries.py --hours 8`. Allocator, solver, ground station and
simulated ArduPilot and PX4 vehicles are the real ones, only their clock is virtual and their links
lose nothing. Tasks arrive at random; a crew changes the battery after each landing at home. The
last line is JSON; the status is 1 where a battery was emptied in flight, a vehicle landed away
from home, a UAV was not available within LATEST_BACK of its change, or a task has neither end nor
reason.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavList,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation, VehicleSession
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import UavMode, state_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Plan, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle
from uav_task_alloc.solver.solve import plan

ORIGIN = Origin(47.397742, 8.545594, 488.0)
KINDS = ('ardupilot', 'px4', 'ardupilot')
TICK, REPORT, ROUNDS = 0.1, 0.5, 100  # [s], [s], rounds of bees in one solve
RANGE, TURNAROUND, SIDE = 6000.0, 120.0, 1500.0  # [m], [s], [m]
ENDURANCE = RANGE / 15.0  # [s] in the air with a full battery: hovering uses as much as cruising
ARRIVAL, DRAIN = 40.0, 1800.0  # [s] between two tasks on average; [s] without new ones at the end
LATEST_BACK = TURNAROUND + 60.0  # [s]
AT_HOME = 5.0  # [m]


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,  # type: ignore[arg-type]
                **{**how, 'budget': 60.0})  # type: ignore[arg-type]


class Fleet:
    """Vehicles, their bridge and their allocator; `step` lets a tick pass."""

    def __init__(self, seed: int) -> None:
        self.rng, self.now, self.report_at, self.number = random.Random(seed), 0.0, 0.0, 0
        policy = Policy(takeoff=True, relaunch='automatic', cruise_altitude=40.0)
        self.ground_station = GroundStation(GcsConfig(origin=ORIGIN, policy=policy),
                                            random.Random(seed))
        self.vehicles = {n: Vehicle(VehicleConfig(
            f'uav_{n}', n, ORIGIN, (300.0 * n, 0.0, 0.0), floods=False, range=RANGE,
            endurance=ENDURANCE, turnaround=TURNAROUND, climb_rate=2.5,
            descent_rate=1.5), AUTOPILOTS[kind])
            for n, kind in enumerate(KINDS, 1)}
        self.up = {n: (Codec(245, 190), Codec(n, 1)) for n in self.vehicles}
        self.down = {n: (Codec(n, 1), Codec(245, 190)) for n in self.vehicles}
        self.params = AllocatorParams(route_end='home', trips=2, default_range=RANGE,
                                      battery_reserve=0.2, background_period=60.0)
        self.core = Allocator(self.params, 0.0)
        self.core.set_kernels_ready()
        self.changed_at: dict[int, float] = {}  # [s] battery out, and not available since
        self.late: set[int] = set()
        self.open: set[str] = set()
        self.figures = dict.fromkeys(('tasks', 'completed', 'changes', 'back', 'late', 'emptied',
                                      'away', 'died'), 0)

    def step(self, arrivals: bool) -> None:
        """Let one TICK pass."""
        self.now += TICK
        for n, vehicle in self.vehicles.items():
            self.to_bridge(n, vehicle.step(self.now))
            self.judge(n, vehicle)
        self.to_vehicles(self.ground_station.step(self.now))
        if arrivals and self.rng.random() < TICK / ARRIVAL:
            self.announce()
        if self.now >= self.report_at:
            self.report_at = self.now + REPORT
            for session in self.ground_station.sessions.values():
                self.report(session)
            self.allocate()

    def to_bridge(self, n: int, messages: list) -> None:
        pack, parse = self.down[n]
        for message in messages:
            for received in parse.parse(pack.pack(message)):
                self.to_vehicles(self.ground_station.receive(n, received, self.now))

    def to_vehicles(self, outgoing: list) -> None:
        for n, message in outgoing:
            pack, parse = self.up[n]
            for received in parse.parse(pack.pack(message)):
                self.to_bridge(n, self.vehicles[n].receive(received, self.now))

    def judge(self, n: int, vehicle: Vehicle) -> None:
        """Count changes, batteries emptied in flight, and landings away from home."""
        flight = vehicle.flight
        for event in vehicle.take_events():
            if event.name == 'power_off':
                self.figures['changes'] += 1
                self.changed_at[n] = self.now
            if event.name == 'disarmed' and math.dist(event.point, flight.home) > AT_HOME:
                self.figures['away'] += 1
            self.figures['died'] += event.name in ('died', 'crashed')
        if not flight.landed and flight.body.battery <= 0.0:
            self.figures['emptied'] += 1
        if n in self.changed_at and n not in self.late and (
                self.now - self.changed_at[n] > LATEST_BACK):
            self.figures['late'] += 1
            self.late.add(n)

    def announce(self) -> None:
        self.figures['tasks'] += 1
        task = Task(f't{self.figures["tasks"]}', (
            self.rng.uniform(0.0, SIDE), self.rng.uniform(0.0, SIDE), 40.0), service_time=3.0)
        verdict, = self.core.world.announce(AnnouncementAction.ADD, [task], self.now, self.now)
        assert verdict.accepted, verdict
        self.open.add(task.id)

    def report(self, session: VehicleSession) -> None:
        """Pass the events and the state of a UAV to the allocator, as both nodes do."""
        executor, world = session.executor, self.core.world
        while executor.events:
            event = executor.events.popleft()
            refused = world.event(TaskEvent(event.task, session.uav_id, event.revision,
                                            TaskEventKind[event.event], event.reason),
                                  self.now, self.now)
            if event.event == 'COMPLETED' and not refused:
                self.figures['completed'] += event.task in self.open
                self.open.discard(event.task)
        executor.notes.clear()
        status, n = state_of(session, self.now), int(session.uav_id[4:])
        if status.available and n in self.changed_at and not self.vehicles[n].silent:
            del self.changed_at[n]
            self.late.discard(n)
            self.figures['back'] += 1
        if executor.telemetry.stale(self.now) or executor.telemetry.position_at < 0.0:
            return
        known = not math.isnan(status.battery)
        world.update_uav(UavReport(
            session.uav_id, status.position, status.home, cruise_speed=15.0,
            range=status.range_remaining if known else None,
            battery=status.battery if known else None,
            endurance=ENDURANCE * status.battery or None if known else None,
            available=status.available and status.mode is not UavMode.FAULT,
            active_task=status.active_task, list_revision=status.list_revision,
            standby=status.mode is UavMode.STANDBY, full_range=RANGE, turnaround=TURNAROUND,
            climb_speed=2.5, descent_speed=1.5), self.now, self.now)

    def allocate(self) -> None:
        """What the allocator does in a tick, with the solve at once."""
        self.core.tick(self.now, self.now)
        problem = self.core.due(self.now, self.now)
        if problem is not None:
            self.core.adopt(planning.solve_problem(solve, problem, self.params, lambda: False),
                            self.now, self.now)
        for uav_list in self.core.collect().lists.values():
            self.publish(uav_list)

    def publish(self, uav_list: UavList) -> None:
        stops = tuple(MissionStop(stop.task, stop.leg.via, stop.wait,
                                  self.now + stop.eta + stop.wait) for stop in uav_list.stops)
        tasks = TaskList(uav_list.revision, stops, uav_list.returns, uav_list.end_via,
                         uav_list.stamp or self.now)
        self.to_vehicles(self.ground_station.assign(uav_list.uav, tasks, self.now))


def main() -> int:
    """Soak, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=8.0)
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    began, end = time.process_time(), 3600.0 * args.hours
    fleet = Fleet(args.seed)
    while fleet.now < end + DRAIN:
        fleet.step(arrivals=fleet.now < end)
    records = fleet.core.world.tasks.records
    lost = [task for task in fleet.open
            if task not in records or not (records[task].uav or records[task].reason)]
    figures = {'hours': args.hours, 'seed': args.seed, **fleet.figures,
               'still_open': len(fleet.open), 'without_end_or_reason': len(lost),
               'out': len(fleet.changed_at), 'cpu_s': round(time.process_time() - began, 1)}
    print(json.dumps(figures))
    bad = ('late', 'emptied', 'away', 'died', 'without_end_or_reason')
    return int(any(figures[name] for name in bad))


if __name__ == '__main__':
    sys.exit(main())
