# SPDX-License-Identifier: Apache-2.0
"""Random flights with pilots, failsafes, reboots, second stations, restarts and new lists.

    python benchmarks/endurance/flights.py --flights 2000 --seed 1 [--lossy] [--json]

Each flight is one simulated ArduCopter or PX4 and one bridge over a link in virtual time; --lossy
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
import math
import multiprocessing
import os
import random
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from flight_judge import Judge
from flight_ways import WayJudge, random_ways
from flight_world import World
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task
from uav_task_alloc.sim.modes import px4_mode

LIMIT = 600.0  # [s] of a flight
QUIET = 150.0  # [s] no random events from then on
SIDE = 70.0  # [m] of the grid of tasks
GIVEN_BACK = 0.85  # share of flights in which an operator hands the aircraft back
WRONG = ('false_completed', 'flown_twice', 'overridden', 'held_forever')
HOLD = {'ardupilot': 4, 'px4': px4_mode(4, 3)}
MISSION = {'ardupilot': 3, 'px4': px4_mode(4, 4)}
RETURN = {'ardupilot': 6, 'px4': px4_mode(4, 5)}
LAND = {'ardupilot': 9, 'px4': px4_mode(4, 6)}
STICK = {'ardupilot': (0, 2, 5, 16), 'px4': (px4_mode(2), px4_mode(3))}
OWN = {'ardupilot': (6, 7, 9, 17, 21, 23), 'px4': (px4_mode(4, 5), px4_mode(4, 6), px4_mode(4, 8))}


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
            batteries=rng.choice([1, 2]))
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
        self.back_at = math.inf  # [s] the operator acts
        self.shorten_at = 0.0  # [s]
        self.counts: Counter[str] = Counter()
        self.later: list[tuple[float, Callable[[], object]]] = []
        self._schedule()

    def _schedule(self) -> None:
        rng = self.rng
        kinds: list[Callable[[], None]] = []
        for share, make in ((0.30, self.pilot), (0.25, self.station), (0.40, self.failsafe),
                            (0.40, self.reboot), (0.45, self.restart), (0.15, self.skip),
                            (0.25, self.cut), (0.04, self.kill), (0.06, self.avoid)):
            kinds += [make] * (rng.random() < share)
        self.later += [(rng.uniform(2.0, QUIET), make) for make in kinds]
        self.later += [(rng.uniform(5.0, QUIET), self.new_list)
                       for _ in range(rng.randint(1, 5))]
        self.later.sort(key=lambda each: each[0])

    @property
    def vehicle(self):
        return self.world.vehicle

    @property
    def airborne(self) -> bool:
        return not self.vehicle.flight.landed

    # random events

    def _back_later(self) -> None:
        self.back_at = self.world.now + self.rng.uniform(5.0, 30.0)

    def pilot(self) -> None:
        """The pilot takes over by radio control."""
        self.counts['takeovers'] += 1
        if not self.airborne and self.rng.random() < 0.3:
            self.vehicle.rc_arm(not self.vehicle.flight.armed)
        else:
            modes = STICK[self.kind] + OWN[self.kind]
            self.vehicle.rc_mode(self.rng.choice(modes))
        self._back_later()

    def station(self) -> None:
        """Another ground station commands a mode."""
        self.counts['takeovers'] += 1
        modes = [RETURN[self.kind], LAND[self.kind]]
        in_mission = self.vehicle.flight.custom_mode == MISSION[self.kind]
        modes.append(HOLD['px4'] if self.kind == 'px4' and in_mission else STICK[self.kind][-1])
        self._command(self.rng.choice(modes))
        self._back_later()

    def _command(self, mode: int) -> None:
        main, sub = (mode >> 16 & 0xff, mode >> 24) if self.kind == 'px4' else (mode, 0)
        self.world.station(d.MAVLink_command_long_message(
            1, 1, d.MAV_CMD_DO_SET_MODE, 0, 1, main, sub, 0, 0, 0, 0))

    def skip(self) -> None:
        """Another ground station sets the current item ahead."""
        self.counts['skips'] += 1
        ahead = self.vehicle.flight.seq + self.rng.randint(1, 3)
        self.world.station(d.MAVLink_mission_set_current_message(1, 1, ahead))

    def failsafe(self) -> None:
        self.counts['failsafes'] += 1
        mode = self.rng.choice([None, RETURN[self.kind], LAND[self.kind]])
        self.vehicle.failsafe(self.rng.choice(['radio', 'gcs', 'battery', 'ekf', 'fence']), mode)
        over = self.world.now + self.rng.uniform(3.0, 20.0)
        self._at(over, self.vehicle.failsafe_over)
        self.back_at = over + self.rng.uniform(2.0, 10.0)

    def kill(self) -> None:
        self.counts['kills'] += 1
        self.vehicle.kill_switch()
        over = self.world.now + self.rng.uniform(3.0, 10.0)
        self._at(over, self.vehicle.kill_switch_off)
        self.back_at = over + 5.0

    def avoid(self) -> None:
        if self.airborne and self.vehicle.flight.custom_mode == MISSION[self.kind]:
            self.counts['avoidances'] += 1
            self.vehicle.avoid(True)
            self._at(self.world.now + self.rng.uniform(3.0, 10.0),
                     lambda: self.vehicle.avoid(False))

    def reboot(self) -> None:
        """Reboot the vehicle; in the air rarely."""
        cut = self.world.link.cut_until > self.world.now - 8.0
        if cut or (self.airborne and self.world.now < QUIET and self.rng.random() < 0.9):
            # never right after a cut: what it flew then is unknown
            self._at(self.world.now + 5.0, self.reboot)
            return
        self.counts['reboots'] += 1
        self.vehicle.reboot(self.world.now)
        self.judge.rebooted()
        self._back_later()

    def restart(self) -> None:
        """Restart the bridge, mostly with its state_dir."""
        self.counts['restarts'] += 1
        # without a file the tasks skipped by another station are unknown
        keep = self.rng.random() < 0.8 or self.counts['skips'] > 0
        self.world.start(keep)
        if not keep:
            self.judge.forgotten()
            self._back_later()

    def cut(self) -> None:
        self.counts['cuts'] += 1
        self.world.link.cut_until = self.world.now + self.rng.uniform(1.0, 15.0)
        self._back_later()

    def _at(self, when: float, action: Callable[[], object]) -> None:
        self.later.append((when, action))
        self.later.sort(key=lambda each: each[0])

    # the allocator and the operator

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
                min(self.back_at, QUIET + 20.0), world.link.cut_until + 4.0):
            return
        state = world.state
        if state is None:
            return
        self.back_at = world.now + 3.0
        if (
            state.authority is AuthorityState.HELD
            or state.authority is AuthorityState.UNKNOWN
            or state.available
        ):
            return
        flight, choice = self.vehicle.flight, self.rng.random()
        if not self.airborne or choice < 0.6 or flight.failsafes or self.judge.stubborn:
            if world.hand_over() == '':
                self.judge.handed_back(by_service=True)
        elif choice < 0.8:
            self.vehicle.rc_mode(MISSION[self.kind])
            self.judge.stubborn = True  # the next try is by the service
        else:
            self.vehicle.rc_mode(STICK[self.kind][-1])
            self._at(world.now + 4.0, self._hold)
            self.back_at = world.now + 20.0
            self.judge.stubborn = True

    def _hold(self) -> None:
        """From a stick mode to HOLD, unless the mode was changed since."""
        if self.vehicle.flight.custom_mode == STICK[self.kind][-1]:
            self.vehicle.rc_mode(HOLD[self.kind])

    def fly(self) -> None:
        """Fly until all is completed, or LIMIT."""
        world = self.world
        self.new_list()
        while world.now < LIMIT:
            world.step()
            self.judge.step()
            self.way_judge.step(self.judge.completed)
            while self.later and self.later[0][0] <= world.now:
                self.later.pop(0)[1]()
            self.operate()
            self.shorten()
            if world.now > QUIET and not self.later and (
                    set(self.listed) <= self.judge.completed or not self.gives_back):
                break

    def result(self) -> tuple[Counter[str], list[str]]:
        counts = self.counts + self.judge.counts + self.way_judge.counts
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
