# SPDX-License-Identifier: Apache-2.0
"""Flights that end by their batteries: what is left at the landing, and how many tasks are flown.

Run: `python benchmarks/endurance/energy.py --flights 500 --seed 1 --json`. Each flight has a wind
with gusts, a payload and a battery of its own age, which nobody states: stated is the range of the
new vehicle in calm air. Allocator, solver and the estimate of the bridge are the real ones; the
vehicle is the point mass of fleet_sim with a power curve of its own, and its battery reads whole
per cents. With `--charge counted` it counts the charge in mAh, too, and its capacity is set;
`wrong`: a capacity is set that is 0.7 to 1.4 times the true one; `per_cent`: there is no sensor.
Each flight is flown once more by an oracle: the same allocator with the true consumption instead
of the estimate. The status is 1 where a vehicle lands below half its reserve, or less than 95 % of
the tasks of the oracle are flown. The last line is one JSON object.
"""
from __future__ import annotations

import argparse
import json
import math
import random
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import (
    AnnouncementAction,
    TaskEvent,
    TaskEventKind,
    UavReport,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.gcs.battery_energy import BatteryEnergy
from uav_task_alloc.mavlink.gcs.energy_estimate import (
    EnergyLimits,
    FlownAmount,
    NominalEnergy,
    planned_amount,
)
from uav_task_alloc.mavlink.gcs.vehicle_energy import DEVIATIONS
from uav_task_alloc.model import Plan, Point, Task
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.dynamics import PointMass
from uav_task_alloc.sim.wind import Wind
from uav_task_alloc.solver.solve import plan

ORIGIN = Origin(47.397742, 8.545594, 488.0)
STEP, REPORT, ROUNDS = 0.25, 1.0, 60  # [s], [s], rounds of bees in one solve
CHARGES = ('counted', 'per_cent', 'wrong')
RESERVE, HEIGHT, TASKS = 0.2, 40.0, 30  # share, [m], in one flight
PERIOD = 10.0  # [s] between two searches of the allocator
LIMIT = 7200.0  # [s] after which a flight counts as lost
STOP, DESCENT = 2.5, 1.5  # [m/s2] of the planned stops, [m/s]
CAPACITY = 5000.0  # [mAh] of a new battery
CLIMB_ENERGY = 1.6  # metres of level flight that a climb of one metre costs more


@dataclass(frozen=True)
class Conditions:
    """What one flight has, and nobody states but `full_range` and `speed`."""

    speed: float  # [m/s]
    full_range: float  # [m] new, in calm air, without payload
    wind: Wind
    payload: float  # factor of the power
    health: float  # capacity of the battery, as a share of a new one
    sag: float  # by which the current is higher when it is empty, as a share
    tasks: tuple[Task, ...]
    wrong: float = 1.0  # a capacity that is set wrongly, as a share of the true one

    @classmethod
    def random(cls, rng: random.Random) -> Conditions:
        """Draw the conditions of a flight."""
        speed, towards = rng.uniform(10.0, 16.0), rng.uniform(0.0, 2.0 * math.pi)
        strength, full_range = rng.uniform(0.0, 0.5) * speed, rng.uniform(6000.0, 14000.0)
        side = 0.1 * full_range
        return cls(speed, full_range, Wind(
            strength * math.cos(towards), strength * math.sin(towards), rng.uniform(0.0, 2.0),
            rng.randrange(10**6)), rng.uniform(1.0, 1.3), rng.uniform(0.7, 1.0),
            rng.uniform(0.0, 0.2), tuple(Task(
                f't{k}', (rng.uniform(-side, side), rng.uniform(-side, side),
                          HEIGHT + rng.uniform(-20.0, 20.0)),
                service_time=rng.choice((0.0, 5.0, 20.0))) for k in range(TASKS)),
            rng.uniform(0.7, 1.4))

    def power(self, airspeed: float) -> float:
        """Power over that of level flight at cruise speed in calm air, new and empty."""
        def curve(share: float) -> float:  # induced power falls with the speed, drag rises
            return 0.75 + 0.25 * math.exp(-(share / 0.4) ** 2) + 0.35 * share**3
        return self.payload * curve(airspeed / self.speed) / curve(1.0)

    def drain(self, airspeed: float, climb: float, charge: float = 1.0) -> float:
        """Share of the battery in a second, `climb` in [m/s]."""
        power = self.power(airspeed) + self.payload * CLIMB_ENERGY * max(0.0, climb) / self.speed
        return power * self.speed / self.full_range / self.health * (
            1.0 + self.sag * (1.0 - charge))


class Body(PointMass):
    """The vehicle, with the power curve of the conditions."""

    def __init__(self, conditions: Conditions, config: VehicleConfig) -> None:
        super().__init__(config)
        self.conditions = conditions

    def _drain(self, dt: float) -> None:
        wx, wy = self._wind.velocity
        vx, vy, vz = self.velocity
        self.battery = max(0.0, self.battery - dt * self.conditions.drain(
            math.hypot(vx - wx, vy - wy), vz, self.battery))


class Oracle:
    """The true consumption, as linear terms of a flight; the gusts of the future are unknown."""

    def __init__(self, conditions: Conditions, body: Body) -> None:
        self.conditions, self.body = conditions, body
        rows, drains = [], []
        wind, speed = conditions.wind, conditions.speed
        for k in range(17):
            v = speed if k else 0.0
            vx, vy = v * math.cos(k * math.pi / 8.0), v * math.sin(k * math.pi / 8.0)
            rows.append((1.0, v, vx, vy))
            drains.append(conditions.drain(math.hypot(vx - wind.east, vy - wind.north), 0.0))
        self.time, self.metre, self.east, self.north = np.linalg.lstsq(
            np.array(rows), np.array(drains),
            rcond=None)[0]

    def limits(self, ahead: FlownAmount, speed: float, landing: float) -> EnergyLimits:
        """Range and endurance down to the reserve, and that for the reserve."""
        truth, charge = self.conditions, self.body.battery
        sag = truth.sag
        usable = charge - RESERVE if sag < 1e-6 else math.log(
            (1.0 + sag * (1.0 - RESERVE)) / (1.0 + sag * (1.0 - charge))) / sag
        climb = truth.drain(0.0, 1.0) - truth.drain(0.0, 0.0)
        usable -= climb * ahead.climb + self.east * ahead.east + self.north * ahead.north
        level, cruise = self.time / speed + self.metre, ahead.metres / speed
        share = 1.0 if ahead.seconds <= 0.0 else min(1.0, cruise / ahead.seconds)
        power, full = self.time + self.metre * speed * share, 1.0 / level
        metres = max(1.0, (usable - landing * self.time) / level)
        whole = metres + RESERVE * full
        seconds = max(1.0, usable / power)
        return EnergyLimits(whole, seconds * whole / metres, full)


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,  # type: ignore[arg-type]
                **{**how, 'budget': 60.0})  # type: ignore[arg-type]


class Flight:
    """One flight, by the estimate or by the oracle.

    Args:
        conditions: of the flight.
        oracle: with the true consumption.
        charge: one of CHARGES: how the battery is reported.
    """

    def __init__(self, conditions: Conditions, oracle: bool, charge: str = 'counted') -> None:
        self.conditions, self.now, self.completed = conditions, 0.0, 0
        config = VehicleConfig('uav_1', 1, ORIGIN, (0.0, 0.0, 0.0), climb_rate=2.5,
                               descent_rate=DESCENT, cruise_speed=conditions.speed,
                               wind=conditions.wind)
        self.body = Body(conditions, config)
        self.battery = BatteryEnergy(NominalEnergy(conditions.full_range, 0.0, conditions.speed))
        self.estimate = self.battery.estimate
        self.capacity = CAPACITY * conditions.health  # [mAh]
        self.set_to = math.nan if charge == 'per_cent' else self.capacity * (
            conditions.wrong if charge == 'wrong' else 1.0)  # [mAh]
        self.oracle = Oracle(conditions, self.body) if oracle else None
        self.speed, self.least = conditions.speed, 1.0  # [m/s] over ground; charge
        params = AllocatorParams(route_end='home', battery_reserve=RESERVE,
                                 background_period=PERIOD)
        self.params, self.core = params, Allocator(params, 0.0)
        self.core.set_kernels_ready()
        self.core.world.announce(AnnouncementAction.ADD, conditions.tasks, 0.0, 0.0)
        self.list: UavList | None = None
        self.way: list[Point] = []  # [m] to the next stop
        self.serving = math.nan  # [s] since when
        self.airborne = self.landing = False

    def fly(self) -> Flight:
        """Fly until it has landed."""
        report_at = 0.0
        while self.now < LIMIT:
            if self.now >= report_at:
                report_at = self.now + REPORT
                self.report()
            self.now += STEP
            if self.move():
                break
        return self

    def ahead(self) -> tuple[FlownAmount, float]:
        """The rest of the list, the way home and the landing, and the time of that [s]."""
        points, hover = [self.body.position], 0.0
        for stop in self.list.stops if self.list else ():
            points += [*stop.leg.via, stop.task.position]
            hover += stop.task.service_time + self.speed / STOP
        landing = points[-1][2] / DESCENT
        return planned_amount([*points, (0.0, 0.0, 0.0)], self.speed, hover + landing), landing

    def limits(self) -> EnergyLimits | None:
        """The limits to report; None: stated ones."""
        if self.oracle:
            ahead, landing = self.ahead()
            return self.oracle.limits(ahead, self.speed, landing)
        if not self.estimate.known:
            return None
        ahead, landing = self.ahead()
        return self.estimate.limits(ahead, self.speed, DEVIATIONS, landing)

    def report(self) -> None:
        """Read the battery, report to the allocator, and let it plan."""
        body, stated = self.body, self.conditions.full_range
        charge = math.floor(100.0 * body.battery) / 100.0
        used = math.nan if math.isnan(self.set_to) else math.floor(
            (1.0 - body.battery) * self.capacity)
        self.battery.read(charge, used, self.set_to, self.now)
        found, world = self.limits(), self.core.world
        world.update_uav(UavReport(
            'uav_1', body.position, (0.0, 0.0, 0.0), velocity=body.velocity,
            range=max(1.0, found.range) if found else stated * charge,
            endurance=max(1.0, found.endurance) if found else None,
            full_range=found.full_range if found else stated, battery=charge,
            cruise_speed=self.conditions.speed, climb_speed=2.5, descent_speed=DESCENT,
            active_task=self.list.stops[0].task.id if self.airborne and self.list and (
                self.list.stops) else '', standby=not self.airborne), self.now, self.now)
        self.core.tick(self.now, self.now)
        problem = self.core.due(self.now, self.now)
        if problem is not None:
            self.core.adopt(planning.solve_problem(solve, problem, self.params, lambda: False),
                            self.now, self.now)
        for each in self.core.collect().lists.values():
            first = self.list.stops[0] if self.list and self.list.stops else None
            self.list = each
            if not (first and each.stops and each.stops[0].task == first.task):
                self.serving, self.way = math.nan, []

    def move(self) -> bool:
        """Fly one step; returns whether it has landed."""
        body, stops = self.body, self.list.stops if self.list else ()
        if not self.airborne:
            if not stops:
                return self.now > 30.0
            self.airborne = True
            self.battery.took_off()
            self.way = [(0.0, 0.0, HEIGHT)]
        if not self.way and math.isnan(self.serving):
            self.way = self.next_way()
        speed = self.conditions.speed
        body.step(STEP, self.way[0] if self.way else body.position, speed, 0.0)
        vx, vy, vz = body.velocity
        ground = math.hypot(vx, vy)
        if ground > max(0.75 * self.speed, 2.0 * abs(vz)):
            self.speed += STEP / 30.0 * (ground - self.speed)
        self.estimate.flew(FlownAmount(STEP, ground * STEP, max(0.0, vz) * STEP, vx * STEP,
                                       vy * STEP))
        if self.way and math.dist(body.position, self.way[0]) < 2.0:
            self.way.pop(0)
            if not self.way:
                if self.landing:
                    return True
                self.serving = self.now if body.position[2] > 1.0 and stops and math.dist(
                    body.position, stops[0].task.position) < 3.0 else math.nan
        if stops and self.now - self.serving >= stops[0].task.service_time:
            self.complete(stops[0].task.id)
        return body.battery <= 0.0

    def next_way(self) -> list[Point]:
        """The points to the first task, or home and down."""
        stops = self.list.stops if self.list else ()
        self.landing = not stops
        if stops:
            return [*stops[0].leg.via, stops[0].task.position]
        height = max(HEIGHT, self.body.position[2])
        return [*(self.list.end_via if self.list else ()), (0.0, 0.0, height), (0.0, 0.0, 0.0)]

    def complete(self, task_id: str) -> None:
        """Report a task as flown; the rest of the list goes on."""
        assert self.list is not None
        self.serving = math.nan
        self.core.world.event(TaskEvent(task_id, 'uav_1', self.list.revision,
                                        TaskEventKind.COMPLETED), self.now, self.now)
        self.completed += 1
        self.list = replace(self.list, stops=self.list.stops[1:])
        self.way = self.next_way()


def main() -> int:
    """Fly, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--flights', type=int, default=500)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--first', type=int, default=0, help='number of the first flight')
    parser.add_argument('--charge', choices=CHARGES, default='counted')
    parser.add_argument('--json', action='store_true', help='the last line only')
    args = parser.parse_args()
    began, left, flown, best = time.process_time(), [], 0, 0
    for number in range(args.first, args.first + args.flights):
        conditions = Conditions.random(random.Random(f'{args.seed}/{number}'))
        flight = Flight(conditions, False, args.charge).fly()
        oracle = Flight(conditions, True).fly()
        left.append(flight.body.battery if flight.now < LIMIT else 0.0)
        flown, best = flown + flight.completed, best + oracle.completed
        if not args.json:
            wind = math.hypot(conditions.wind.east, conditions.wind.north)
            print(f'flight {number}: lands with {100.0 * left[-1]:.1f} %, oracle '
                  f'{100.0 * oracle.body.battery:.1f} %; tasks {flight.completed} of '
                  f'{oracle.completed}; {flight.now:.0f} s, wind {wind:.1f} of '
                  f'{conditions.speed:.1f} m/s, health {conditions.health:.2f}, payload '
                  f'{conditions.payload:.2f}')
    low = sum(share < 0.5 * RESERVE for share in left)
    share = flown / best if best else 0.0
    print(json.dumps({
        'flights': args.flights, 'seed': args.seed, 'charge': args.charge, 'reserve': RESERVE,
        'below_half_reserve': low, 'least_charge': round(min(left), 4),
        'median_charge': round(sorted(left)[len(left) // 2], 4), 'tasks': flown,
        'tasks_of_oracle': best, 'share_of_oracle': round(share, 4),
        'cpu_s': round(time.process_time() - began, 1)}))
    return int(low > 0 or share < 0.95)


if __name__ == '__main__':
    sys.exit(main())
