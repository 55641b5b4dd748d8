# SPDX-License-Identifier: Apache-2.0
"""Hours of service with battery changes: allocator, bridge and autopilots over virtual time.

Run: `python benchmarks/endurance/batteries.py --hours 8 --kills 50`. Allocator, solver, journal,
ground station and simulated ArduPilot and PX4 vehicles are the real ones, only their clock is
virtual and their links lose nothing. Tasks arrive at random; a crew changes the battery after each
landing at home. At random moments, half of them before the next row is on disk, the allocator or
the bridge loses all that it has in memory, and starts again from its files after up to DOWN. The
last line is JSON; the status is 1 where a battery was emptied in flight, a vehicle landed away
from home, a UAV was not available within LATEST_BACK of its change (or of the restart of the
bridge), or a task was lost, opened again after its end, flown twice, or has neither end nor
reason. battery_kills.py does the same with nodes as processes.
"""
from __future__ import annotations

import argparse
import contextlib
import json
import math
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    TaskState,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore
from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation, VehicleSession
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.status import UavMode, state_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.model import Plan, Point, Task
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
AT_HOME, VISIT = 5.0, 0.3  # [m]
DOWN = 20.0  # [s] at most between a kill and the restart


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,  # type: ignore[arg-type]
                **{**how, 'budget': 60.0})  # type: ignore[arg-type]


class Killed(Exception):
    """The allocator was killed before its rows were on disk."""


class Fleet:
    """Vehicles, their bridge and their allocator; `step` lets a tick pass."""

    def __init__(self, seed: int, folder: str) -> None:
        self.rng, self.now, self.report_at, self.folder = random.Random(seed), 0.0, 0.0, folder
        self.vehicles = {n: Vehicle(VehicleConfig(
            f'uav_{n}', n, ORIGIN, (300.0 * n, 0.0, 0.0), floods=False, range=RANGE,
            endurance=ENDURANCE, turnaround=TURNAROUND, climb_rate=2.5,
            descent_rate=1.5), AUTOPILOTS[kind])
            for n, kind in enumerate(KINDS, 1)}
        self.params = AllocatorParams(route_end='home', trips=2, default_range=RANGE,
                                      battery_reserve=0.2, background_period=60.0)
        self.changed_at: dict[int, float] = {}  # [s] battery out, and not available since
        self.late: set[int] = set()
        self.places: dict[str, Point] = {}  # [m] of the tasks that were acknowledged
        self.ended: set[str] = set()  # on disk
        self.visits = Counter[str]()
        self.lists: dict[str, TaskList] = {}  # the latched ones
        self.restart_at = dict.fromkeys(('allocator', 'bridge'), math.inf)  # [s]; while it is down
        self.dies_unsaved = False  # the allocator, before its next rows are on disk
        self.figures = dict.fromkeys(('tasks', 'changes', 'back', 'late', 'emptied', 'away',
                                      'died', 'lost', 'reopened', 'kills_allocator',
                                      'kills_bridge', 'kills_unsaved'), 0)
        self.start_allocator()
        self.start_bridge()

    # the nodes

    def start_allocator(self) -> None:
        """Start it from its journal."""
        self.persistence = Persistence(self.folder, print)
        self.core: Allocator | None = Allocator(self.params, self.now, self.persistence.saved)
        self.core.set_kernels_ready()
        records = self.core.world.tasks.records
        self.figures['lost'] += len(self.places.keys() - records.keys())
        self.figures['reopened'] += sum(
            records[task].open for task in self.ended & records.keys())

    def start_bridge(self) -> None:
        """Start it with its files; it receives the latched lists once a vehicle is known."""
        policy = Policy(takeoff=True, relaunch='automatic', cruise_altitude=40.0)
        self.ground_station: GroundStation | None = GroundStation(
            GcsConfig(origin=ORIGIN, policy=policy), random.Random(self.rng.random()),
            AuthorityFileStore(self.folder, print))
        self.up = {n: (Codec(245, 190), Codec(n, 1)) for n in self.vehicles}
        self.down = {n: (Codec(n, 1), Codec(245, 190)) for n in self.vehicles}
        self.delivered: dict[str, int] = {}  # revisions, by UAV
        for n in self.changed_at:
            self.changed_at[n] = max(self.changed_at[n], self.now)

    def kill(self) -> None:
        """Kill one of both now, or the allocator before its next rows are on disk."""
        name = self.rng.choice(('allocator', 'bridge'))
        if name == 'bridge' and self.ground_station is not None:
            self.figures['kills_bridge'] += 1
            self.ground_station = None
            self.restart_at[name] = self.now + self.rng.uniform(0.0, DOWN)
        elif self.core is not None and self.rng.random() < 0.5:
            self.dies_unsaved = True
        elif self.core is not None:
            self.kill_allocator()

    def kill_allocator(self) -> None:
        self.figures['kills_allocator'] += 1
        self.core, self.dies_unsaved = None, False
        self.persistence.close()
        self.restart_at['allocator'] = self.now + self.rng.uniform(0.0, DOWN)

    def restart(self) -> None:
        """Start what has been down for long enough."""
        if self.now >= self.restart_at['allocator']:
            self.restart_at['allocator'] = math.inf
            self.start_allocator()
        if self.now >= self.restart_at['bridge']:
            self.restart_at['bridge'] = math.inf
            self.start_bridge()

    def save(self) -> None:
        """Write to disk what has changed. Raises Killed where it dies before."""
        assert self.core is not None
        if self.dies_unsaved and self.core.rows(1):
            self.figures['kills_unsaved'] += 1
            self.kill_allocator()
            raise Killed
        self.persistence.save(self.core, self.now)
        self.ended |= {task for task, record in self.core.world.tasks.records.items()
                       if not record.open}

    def step(self, arrivals: bool) -> None:
        """Let one TICK pass."""
        self.now += TICK
        self.restart()
        for n, vehicle in self.vehicles.items():
            self.to_bridge(n, vehicle.step(self.now))
            self.judge(n, vehicle)
        if self.ground_station is not None:
            self.to_vehicles(self.ground_station.step(self.now))
        with contextlib.suppress(Killed):
            if arrivals and self.rng.random() < TICK / ARRIVAL and self.core is not None:
                self.announce()
            if self.now >= self.report_at:
                self.report_at = self.now + REPORT
                self.report_and_allocate()

    def report_and_allocate(self) -> None:
        """What the nodes tell each other."""
        if self.ground_station is not None:
            for session in self.ground_station.sessions.values():
                self.report(session)
        if self.core is not None:
            self.allocate()
        self.deliver()

    def to_bridge(self, n: int, messages: list) -> None:
        pack, parse = self.down[n]
        for message in messages if self.ground_station is not None else ():
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
            if event.name == 'item_reached':
                self.visits.update(task for task, place in self.places.items()
                                   if math.dist(place, event.point) < VISIT)
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
        self.save()
        self.places[task.id] = task.position  # acknowledged

    def report(self, session: VehicleSession) -> None:
        """Pass the events and the state of a UAV to the allocator, as both nodes do."""
        executor = session.executor
        while executor.events:
            event = executor.events.popleft()  # lost while no allocator runs
            if self.core is not None:
                self.core.world.event(TaskEvent(event.task, session.uav_id, event.revision,
                                                TaskEventKind[event.event], event.reason),
                                      self.now, self.now)
                self.save()
        executor.notes.clear()
        executor.energy.nominal = NominalEnergy(RANGE, ENDURANCE, 15.0)
        status, n = state_of(session, self.now), int(session.uav_id[4:])
        if status.available and n in self.changed_at and not self.vehicles[n].silent:
            del self.changed_at[n]
            self.late.discard(n)
            self.figures['back'] += 1
        if self.core is None:
            return
        if executor.telemetry.link.stale(self.now) or executor.telemetry.position_at < 0.0:
            return
        known = not math.isnan(status.battery)
        self.core.world.update_uav(UavReport(
            session.uav_id, status.position, status.home, cruise_speed=15.0,
            range=status.range_remaining if known else None,
            battery=status.battery if known else None,
            endurance=status.endurance or None if known else None,
            available=status.available and status.mode is not UavMode.FAULT,
            active_task=status.active_task, list_revision=status.list_revision,
            standby=status.mode is UavMode.STANDBY, full_range=status.full_range,
            turnaround=TURNAROUND, climb_speed=2.5, descent_speed=1.5), self.now, self.now)

    def allocate(self) -> None:
        """What the allocator does in a tick, with the solve at once."""
        assert self.core is not None
        self.core.tick(self.now, self.now)
        problem = self.core.due(self.now, self.now)
        if problem is not None:
            self.core.adopt(planning.solve_problem(solve, problem, self.params, lambda: False),
                            self.now, self.now)
        self.save()
        for uav_list in self.core.collect().lists.values():
            self.publish(uav_list)

    def publish(self, uav_list: UavList) -> None:
        stops = tuple(MissionStop(stop.task, stop.leg.via, stop.wait,
                                  self.now + stop.eta + stop.wait) for stop in uav_list.stops)
        self.lists[uav_list.uav] = TaskList(uav_list.revision, stops, uav_list.returns,
                                            uav_list.end_via, uav_list.stamp or self.now)

    def deliver(self) -> None:
        """Pass on the lists that the bridge has not received."""
        known = {} if self.ground_station is None else self.ground_station.sessions
        for session in known.values():
            uav, tasks = session.uav_id, self.lists.get(session.uav_id)
            if tasks is not None and self.delivered.get(uav) != tasks.revision:
                self.delivered[uav] = tasks.revision
                self.to_vehicles(self.ground_station.assign(uav, tasks, self.now))


def main() -> int:
    """Soak, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=8.0)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--kills', type=int, default=0)
    args = parser.parse_args()
    began, end = time.process_time(), 3600.0 * args.hours
    rng = random.Random(args.seed)
    moments = sorted(rng.uniform(0.0, end) for _ in range(args.kills))
    with tempfile.TemporaryDirectory() as folder:
        fleet = Fleet(args.seed, folder)
        while fleet.now < end + DRAIN:
            fleet.step(arrivals=fleet.now < end)
            if moments and fleet.now >= moments[0]:
                moments.pop(0)
                fleet.kill()
        figures = {'hours': args.hours, 'seed': args.seed, **judged(fleet),
                   'cpu_s': round(time.process_time() - began, 1)}
        fleet.persistence.close()
    print(json.dumps(figures))
    bad = ('late', 'emptied', 'away', 'died', 'lost', 'reopened', 'flown_twice',
           'without_end_or_reason')
    return int(any(figures[name] for name in bad))


def judged(fleet: Fleet) -> dict[str, object]:
    """The figures at the end."""
    assert fleet.core is not None
    records = fleet.core.world.tasks.records
    lost = fleet.places.keys() - records.keys()
    still = [records[task] for task in fleet.places.keys() & records.keys() if records[task].open]
    return {**fleet.figures, 'lost': fleet.figures['lost'] + len(lost),
            'completed': sum(each.state is TaskState.COMPLETED for each in records.values()),
            'flown_twice': sorted(task for task, n in fleet.visits.items() if n > 1),
            'still_open': len(still),
            'without_end_or_reason': sum(not (each.uav or each.reason) for each in still),
            'out': len(fleet.changed_at)}


if __name__ == '__main__':
    sys.exit(main())
