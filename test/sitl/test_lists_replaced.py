# SPDX-License-Identifier: Apache-2.0
"""Four vehicles whose lists are replaced ten times in flight, on fleet_sim and on real SITL."""
import math
import os
import random
import time
from collections import Counter

import pytest
from worlds import HOMES, ORIGIN, SYSTEMS, ArduCopter, FleetSim, Px4

from uav_task_alloc.mavlink.ground import Ground, Station
from uav_task_alloc.mavlink.policy import Policy
from uav_task_alloc.mavlink.radio import Radio
from uav_task_alloc.mavlink.status import Mode, state_of
from uav_task_alloc.mission import Stop, TaskList
from uav_task_alloc.model import Task

REPLACED = 10  # times, each vehicle
LIMIT = 240.0  # [s] wall, until the fleet has ended
SITL = {'ARDUCOPTER_SITL': ArduCopter, 'PX4_SITL': Px4}


@pytest.fixture(params=['ardupilot', 'px4', *SITL])
def world(request, tmp_path):
    """Each kind of four vehicles; real ones where a variable names the binary."""
    if request.param not in SITL:
        made = FleetSim(request.param)
    elif not os.environ.get(request.param):
        pytest.skip(f'{request.param} is not set: expected the path of a SITL binary; '
                    'only simulated vehicles are flown')
    else:
        made = SITL[request.param](os.environ[request.param], tmp_path)
    yield made
    made.close()


class Visits:
    """Where a vehicle came to rest, by its own positions: what a service looks like from afar."""

    def __init__(self, places):
        self.places, self.made, self._at = places, [], None

    def see(self, position, velocity):
        if self._at is not None and math.dist(position, self.places[self._at]) > 10.0:
            self._at = None
        if math.hypot(*velocity) > 1.0:
            return
        for name, place in self.places.items():
            if name != self._at and math.dist(position, place) < 5.0:
                self.made.append(name)
                self._at = name


class Course:
    """The changing list of one vehicle."""

    def __init__(self, system, rng):
        self.system, self.rng = system, rng
        x, y, _ = HOMES[system]
        self.places = {f'u{system}_{k}': (x + 60.0 * (k % 5) + rng.uniform(-9.0, 9.0),
                                          y + 50.0 * (1 + k // 5) + rng.uniform(-9.0, 9.0),
                                          rng.uniform(40.0, 60.0)) for k in range(30)}
        self.fresh = list(self.places)
        self.visits = Visits(self.places)
        self.listed, self.done, self.withdrawn = [], [], set()
        self.revision, self._seen = 0, -1

    @property
    def ended(self):
        return self.revision > REPLACED and set(self.listed) <= set(self.done)

    def next(self):
        """A list in another order, with two new tasks and less one that is not next."""
        left = [name for name in self.listed if name not in self.done]
        self._seen = len(self.done)
        keep = left[:2]
        self.withdrawn |= set(left[2:][-1:]) if len(left) > 3 else set()
        names = [name for name in left if name not in self.withdrawn]
        names += [self.fresh.pop() for _ in range(4 if not self.listed else 2)]
        self.rng.shuffle(names)
        assert not self.withdrawn & {*names, *keep}
        self.listed, self.revision = names, self.revision + 1
        return TaskList(self.revision, tuple(
            Stop(Task(name, self.places[name], service_time=2.0)) for name in names))

    def is_due(self, mode):
        """Another list after each task, or where the last one is flown."""
        return self.revision == 0 or (self.revision <= REPLACED and len(self.done) > self._seen
                                      and mode in (Mode.ON_MISSION, Mode.HOLD))


class Bridge:
    """The core of the bridge on the links of a world."""

    def __init__(self, world):
        self.radio = Radio(world.links, 245, 190, wall=time.time)
        self.ground = Ground(Station(origin=ORIGIN, system_ids=SYSTEMS, policy=Policy(
            takeoff=True, cruise_altitude=30.0)), random.Random(1))
        self.courses = {n: Course(n, random.Random(n)) for n in SYSTEMS}
        self.events, self.notes = [], []

    def serve(self):
        """Take what comes, let time pass, hand out lists that are due."""
        now, out = time.monotonic(), []
        for address, message in self.radio.receive(0.01):
            out += self.ground.receive(address, message, now)
            if message.get_type() == 'GLOBAL_POSITION_INT':
                self.see(message.get_srcSystem())
        out += self.ground.step(now)
        self.radio.step(now)
        for system, served in self.ground.served.items():
            self.note(served)
            if self.courses[system].is_due(state_of(served, now).mode):
                out += self.ground.assign(served.uav_id, self.courses[system].next(), now)
        self.radio.send(out)

    def see(self, system):
        served = self.ground.served.get(system)
        if served and served.pilot.telemetry.airborne:
            telemetry = served.pilot.telemetry
            self.courses[system].visits.see(telemetry.position, telemetry.velocity)

    def note(self, served):
        system = int(served.uav_id.removeprefix('uav_'))
        while served.pilot.events:
            event = served.pilot.events.popleft()
            self.events.append((system, event))
            if event.event == 'COMPLETED':
                self.courses[system].done.append(event.task)
        while served.pilot.notes:
            self.notes.append(f'uav_{system}: {served.pilot.notes.popleft().text}')

    def fly(self):
        """Until every vehicle has flown its last list."""
        end = time.monotonic() + LIMIT
        while not (len(self.ground.served) == len(SYSTEMS)
                   and all(course.ended for course in self.courses.values())):
            assert time.monotonic() < end, '\n'.join(
                ['timed out', *self.notes, *(f'{c.system}: {c.revision} lists, done {c.done}'
                                             for c in self.courses.values())])
            self.serve()


def test_each_task_is_reached_once_and_none_that_was_withdrawn(world):
    bridge = Bridge(world)
    try:
        bridge.fly()
    finally:
        bridge.radio.close()
    world.close()
    for system, course in bridge.courses.items():
        assert course.revision == REPLACED + 1
        assert len(course.withdrawn) >= REPLACED // 3
        assert Counter(course.done) == Counter(set(course.done)), f'{system}: told twice'
        assert not course.withdrawn & {*course.done, *course.visits.made}
        assert course.visits.made == course.done, f'{system}: told is not flown'
        really = world.reached(system)
        if really is not None:
            at = [min(course.places, key=lambda n, p=p, c=course: math.dist(c.places[n], p))
                  for p in really]
            assert at == course.done
    assert not any(event.event == 'FAILED' for _, event in bridge.events)
