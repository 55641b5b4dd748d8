# SPDX-License-Identifier: Apache-2.0
"""Four vehicles whose lists are replaced ten times in flight, on fleet_sim and on real SITL."""
import random
from collections import Counter

from sitl_bench import Bridge, Visits, stops
from worlds import HOMES, SYSTEMS

from uav_task_alloc.mavlink.gcs.status import UavMode, state_of
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

REPLACED = 10  # times, each vehicle


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
            MissionStop(Task(name, self.places[name], service_time=2.0)) for name in names))

    def is_due(self, mode):
        """Another list after each task, or where the last one is flown."""
        return self.revision == 0 or (self.revision <= REPLACED and len(self.done) > self._seen
                                      and mode in (UavMode.ON_MISSION, UavMode.HOLD))


class Replacing(Bridge):
    """Hands out lists that are due."""

    def collect(self, system, session):
        super().collect(system, session)
        now, course = self.now(), self.courses[system]
        if course.is_due(state_of(session, now).mode):
            self.send(self.ground_station.assign(session.uav_id, course.next(), now))


def test_each_task_is_reached_once_and_none_that_was_withdrawn(world):
    bridge = Replacing(world, {n: Course(n, random.Random(n)) for n in SYSTEMS})
    try:
        bridge.until(lambda: all(course.ended for course in bridge.courses.values()),
                     f'{REPLACED + 1} lists each')
    finally:
        bridge.close()
    world.close()
    for system, course in bridge.courses.items():
        assert course.revision == REPLACED + 1
        assert len(course.withdrawn) >= REPLACED // 3
        assert Counter(course.done) == Counter(set(course.done)), f'{system}: reported twice'
        visited = stops(world, system, course)
        assert not course.withdrawn & {*course.done, *visited}
        assert visited == course.done, f'{system}: reported is not flown'
    assert not any(event.event == 'FAILED' for _, event in bridge.events)
