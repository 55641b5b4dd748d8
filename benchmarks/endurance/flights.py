# SPDX-License-Identifier: Apache-2.0
"""Random flights with pilots, failsafes, reboots, second stations, restarts and new lists.

    python benchmarks/endurance/flights.py --flights 2000 --seed 1 [--lossy] [--json]

Each flight is one simulated ArduCopter or PX4, of which every other one reports its
mission_state, and one bridge over a link in virtual time; --lossy
loses up to 20 % of the frames and delays some by up to 5 s, out of order. Judged by the records
of the simulator and the link. `flyable` counts the tasks of flights at whose end the bridge
controls the aircraft, `completed` those of them that it reported. `flown_twice` counts the tasks
flown again though a frame was delivered that shows that they were flown (see `flight_evidence`);
`flown_again_unknowable` those of which no such frame was delivered; `flown_again_killed` those
that others let a killed vehicle fly again before it was handed back, `flown_again_for_pilot`
those of a complete mission that another began again (see `flight_judge`). --ways 0.5 gives half
of the tasks a way: reported without having been flown from end to end it is `false_completed`;
`way_points_again` counts points of ways that were flown again, as after a doubt. `errors` are
those that the bridge has caught, with which it has dropped a message or a list.
--without-authority disables the table, to show that the check can fail. --json: the last line is
one object. The status is 1 where a flight has a fault.
"""
from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from flight_events import HOLD, MISSION, QUIET, STICK, FlightEvents
from flight_judge import Judge
from flight_ways import WayJudge, random_ways
from flight_world import World

from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

LIMIT = 600.0  # [s] of a flight
SIDE = 70.0  # [m] of the grid of tasks
GIVEN_BACK = 0.85  # share of flights in which an operator hands the aircraft back
WRONG = ('false_completed', 'flown_twice', 'overridden', 'held_forever')


class Flight:
    """One flight, its random events, and the operator who hands the aircraft back."""

    def __init__(self, seed: int, number: int, lossy: bool, ways: float = 0.0) -> None:
        self.rng = rng = random.Random(f'{seed}/{number}/{lossy}')
        self.kind = rng.choice(['ardupilot', 'px4'])
        boots = rng.random() < 0.3
        self.world = World(
            self.kind, rng, lossy,
            Policy(takeoff=True, cruise_altitude=30.0,
                   relaunch=rng.choice(['operator', 'automatic'])),
            arming_delay=rng.uniform(0.0, 5.0) + 10.0 * boots,
            boot_delay=None if boots else 0.0, settling_time=None if boots else 0.0,
            batteries=rng.choice([1, 2]),
            reports_mission_state=random.Random(f'{seed}/{number}/state').random() < 0.5)
        self.places = {f't{k}': (SIDE * (k % 5) + rng.uniform(-9.0, 9.0),
                                 SIDE * (1 + k // 5) + rng.uniform(-9.0, 9.0),
                                 rng.uniform(25.0, 45.0)) for k in range(20)}
        self.ways = random_ways(random.Random(f'{seed}/{number}/ways'), self.places, ways)
        self.judge = Judge(self.world, self.kind, {
            name: place for name, place in self.places.items() if name not in self.ways})
        self.way_judge = WayJudge(self.world, self.ways)
        self.fresh = list(self.places)
        self.listed: list[str] = []
        self.revision = 0
        self.service = rng.choice([0.0, 0.0, 2.0])
        self.gives_back = rng.random() < GIVEN_BACK
        self.shorten_at = 0.0  # [s]
        self.events = FlightEvents(rng, self.kind, self.world, self.judge, self.new_list)

    def new_list(self) -> None:
        """List the open tasks in another order, less one that is not next, and new ones."""
        left = [name for name in self.listed if name not in self.judge.completed]
        if len(left) > 3 and self.rng.random() < 0.4:
            left.remove(self.rng.choice(left[2:]))
        count = 3 if not self.listed else self.rng.randint(0, 2)
        left += [self.fresh.pop() for _ in range(min(count, len(self.fresh)))]
        self.rng.shuffle(left)
        self._assign(left)

    def _assign(self, names: list[str]) -> None:
        self.listed, self.revision = names, self.revision + 1
        self.world.assign(
            TaskList(
                self.revision,
                tuple(
                    MissionStop(Task(
                        name, self.places[name], service_time=self.service,
                        path=self.ways.get(name, ()), reversible=True),
                        reversed=name in self.ways and name[-1] in '13579')
                    for name in names
                ),
            )
        )

    def shorten(self) -> None:
        """Remove the completed tasks from the list, as an allocator does."""
        left = [name for name in self.listed if name not in self.judge.completed]
        if len(left) < len(self.listed) and self.world.now >= self.shorten_at:
            self.shorten_at = self.world.now + 1.0
            self._assign(left)

    def operate(self) -> None:
        """Hand the aircraft back where the bridge reports that it does not hold it."""
        world = self.world
        if not self.gives_back or world.now < max(
                min(self.events.back_at, QUIET + 20.0), world.link.cut_until + 4.0):
            return
        state = world.state
        if state is None:
            return
        self.events.back_at = world.now + 3.0
        if (
            state.authority is AuthorityState.HELD
            or state.authority is AuthorityState.UNKNOWN
            or state.available
        ):
            return
        flight, choice = self.events.vehicle.flight, self.rng.random()
        if not self.events.airborne or choice < 0.6 or flight.failsafes or self.judge.stubborn:
            if world.hand_over() == '':
                self.judge.handed_back(by_service=True)
        elif choice < 0.8:
            self.events.vehicle.rc_mode(MISSION[self.kind])
            self.judge.stubborn = True  # the next try is by the service
        else:
            self.events.vehicle.rc_mode(STICK[self.kind][-1])
            self.events.at(world.now + 4.0, self._hold)
            self.events.back_at = world.now + 20.0
            self.judge.stubborn = True

    def _hold(self) -> None:
        """From a stick mode to HOLD, unless the mode was changed since."""
        if self.events.vehicle.flight.custom_mode == STICK[self.kind][-1]:
            self.events.vehicle.rc_mode(HOLD[self.kind])

    def fly(self) -> None:
        """Fly until all is completed, or LIMIT."""
        world = self.world
        self.new_list()
        while world.now < LIMIT:
            world.step()
            self.judge.step()
            self.way_judge.step(self.judge.completed)
            self.events.happen()
            self.operate()
            self.shorten()
            if world.now > QUIET and not self.events.later and (
                    set(self.listed) <= self.judge.completed or not self.gives_back):
                break

    def result(self) -> tuple[Counter[str], list[str]]:
        counts = self.events.counts + self.judge.counts + self.way_judge.counts
        counts['flights'], counts['errors'] = 1, len(self.world.errors)
        counts[self.kind] = 1
        if self.gives_back:
            counts['flyable'] = len(set(self.listed) | self.judge.completed)
            counts['completed'] = len(self.judge.completed)
        faults = self.judge.faults + self.way_judge.faults + self.world.errors
        return counts, faults + self.judge.notes


def switch_authority_off() -> None:
    """Disable the authority table of the bridge."""
    Authority.allows = lambda self, action: True  # type: ignore[method-assign]
    Authority.held = property(lambda self: True)  # type: ignore[assignment, method-assign]


def fly(job: tuple[int, int, bool, bool, float]) -> tuple[int, Counter[str], list[str], list[str]]:
    """One flight in a process of its own."""
    seed, number, lossy, without, ways = job
    if without:
        switch_authority_off()
    flight = Flight(seed, number, lossy, ways)
    flight.fly()
    counts, faults = flight.result()
    unfinished = flight.gives_back and not set(flight.listed) <= flight.judge.completed
    if unfinished:
        counts['unfinished_flights'] = 1
    return number, counts, faults, flight.world.notes if faults or unfinished else []


def main() -> int:
    """Fly all, print, judge."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--flights', type=int, default=2000)
    parser.add_argument('--first', type=int, default=0, help='number of the first flight')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--lossy', action='store_true')
    parser.add_argument('--ways', type=float, default=0.0, help='share of tasks with a way')
    parser.add_argument('--without-authority', action='store_true')
    parser.add_argument('--processes', type=int, default=os.cpu_count() or 1)
    parser.add_argument('--verbose', action='store_true', help='notes of flights with faults')
    parser.add_argument('--json', action='store_true')
    args = parser.parse_args()
    jobs = [(args.seed, number, args.lossy, args.without_authority, args.ways)
            for number in range(args.first, args.first + args.flights)]
    total: Counter[str] = Counter()
    with multiprocessing.Pool(args.processes) as pool:
        for done, (number, counts, faults, notes) in enumerate(
                pool.imap_unordered(fly, jobs, chunksize=4), 1):
            total += counts
            for fault in faults:
                print(f'\nflight {number} of seed {args.seed}: {fault}', file=sys.stderr)
            if args.verbose and notes:
                print(f'\nflight {number}:\n  ' + '\n  '.join(notes), file=sys.stderr)
            print(f'\r{done}/{args.flights} flights ', end='', file=sys.stderr)
    print(file=sys.stderr)
    names = ('flights', 'takeovers', 'failsafes', 'reboots', 'restarts', 'handed_back',
             'completed', 'flyable', *WRONG, 'errors', 'flown_again_unknowable',
             'flown_again_killed', 'flown_again_for_pilot')
    result = {name: total[name] for name in (*names, *sorted(set(total) - set(names)))}
    result |= {'seed': args.seed, 'lossy': args.lossy}
    for name, value in result.items():
        print(f'{name:20} {value}', file=sys.stderr if args.json else sys.stdout)
    if args.json:
        print(json.dumps(result))
    return int(any(total[name] for name in (*WRONG, 'errors'))
               or total['completed'] < 0.95 * total['flyable'])


if __name__ == '__main__':
    sys.exit(main())
