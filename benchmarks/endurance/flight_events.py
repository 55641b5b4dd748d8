# SPDX-License-Identifier: Apache-2.0
"""What happens to a random flight: pilots, other stations, failsafes, reboots, restarts, cuts."""
from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable

from flight_judge import Judge
from flight_world import World
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.sim.modes import px4_mode

QUIET = 150.0  # [s] no random events from then on
HOLD = {'ardupilot': 4, 'px4': px4_mode(4, 3)}
MISSION = {'ardupilot': 3, 'px4': px4_mode(4, 4)}
RETURN = {'ardupilot': 6, 'px4': px4_mode(4, 5)}
LAND = {'ardupilot': 9, 'px4': px4_mode(4, 6)}
STICK = {'ardupilot': (0, 2, 5, 16), 'px4': (px4_mode(2), px4_mode(3))}
OWN = {'ardupilot': (6, 7, 9, 17, 21, 23), 'px4': (px4_mode(4, 5), px4_mode(4, 6), px4_mode(4, 8))}


class FlightEvents:
    """The random events of one flight, by time, and when its operator acts.

    Args:
        rng: random numbers of the flight.
        kind: of autopilot.
        world: where they happen.
        judge: is notified of reboots and of restarts without stored state.
        new_list: gives the bridge another list.
    """

    def __init__(self, rng: random.Random, kind: str, world: World, judge: Judge,
                 new_list: Callable[[], None]) -> None:
        self.rng, self.kind, self.world, self.judge = rng, kind, world, judge
        self.back_at = math.inf  # [s] the operator acts
        self.counts: Counter[str] = Counter()
        self.later: list[tuple[float, Callable[[], object]]] = []
        self._schedule(new_list)

    def _schedule(self, new_list: Callable[[], None]) -> None:
        rng = self.rng
        kinds: list[Callable[[], None]] = []
        for share, make in ((0.30, self.pilot), (0.25, self.station), (0.40, self.failsafe),
                            (0.40, self.reboot), (0.45, self.restart), (0.15, self.skip),
                            (0.25, self.cut), (0.04, self.kill), (0.06, self.avoid)):
            kinds += [make] * (rng.random() < share)
        self.later += [(rng.uniform(2.0, QUIET), make) for make in kinds]
        self.later += [(rng.uniform(5.0, QUIET), new_list)
                       for _ in range(rng.randint(1, 5))]
        self.later.sort(key=lambda each: each[0])

    @property
    def vehicle(self):
        return self.world.vehicle

    @property
    def airborne(self) -> bool:
        return not self.vehicle.flight.landed

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
        self.at(over, self.vehicle.failsafe_over)
        self.back_at = over + self.rng.uniform(2.0, 10.0)

    def kill(self) -> None:
        self.counts['kills'] += 1
        self.vehicle.kill_switch()
        over = self.world.now + self.rng.uniform(3.0, 10.0)
        self.at(over, self.vehicle.kill_switch_off)
        self.back_at = over + 5.0

    def avoid(self) -> None:
        if self.airborne and self.vehicle.flight.custom_mode == MISSION[self.kind]:
            self.counts['avoidances'] += 1
            self.vehicle.avoid(True)
            self.at(self.world.now + self.rng.uniform(3.0, 10.0),
                     lambda: self.vehicle.avoid(False))

    def reboot(self) -> None:
        """Reboot the vehicle; in the air rarely."""
        cut = self.world.link.cut_until > self.world.now - 8.0
        if cut or (self.airborne and self.world.now < QUIET and self.rng.random() < 0.9):
            # never right after a cut: what it flew then is unknown
            self.at(self.world.now + 5.0, self.reboot)
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

    def at(self, when: float, action: Callable[[], object]) -> None:
        """Let something happen later."""
        self.later.append((when, action))
        self.later.sort(key=lambda each: each[0])

    def happen(self) -> None:
        """Let all happen that is due."""
        while self.later and self.later[0][0] <= self.world.now:
            self.later.pop(0)[1]()
