# SPDX-License-Identifier: Apache-2.0
"""The real solver and a simulated fleet that flies its lists, over virtual time."""
import math

import numpy as np
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.geometry.zones import zones_around
from uav_task_alloc.model import Task, ThreatZone

STEP = 0.5  # [s]
SPEED = 20.0  # [m/s]


class SimulatedFleet:
    """UAVs that follow their lists by the detour points, and report their progress."""

    def __init__(self, seed, count, **params):
        self.rng = np.random.default_rng(seed)
        self.driver = AllocatorDriver(
            plan=plan, solve_budget=0.01, background_budget=0.005, uav_timeout=3.0,
            replan_margin=0.01, clearance=15.0, **params)
        self.places = {f'u{k}': (float(100 * k), 0.0, 50.0) for k in range(count)}
        self.alive = set(self.places)
        self.active = dict.fromkeys(self.places, '')
        self.passed = dict.fromkeys(self.places, 0)
        self.flown, self.entered, self.weak, self.number = [], 0, [], 0
        self.report()

    def report(self):
        for uav_id in sorted(self.alive):
            self.driver.uav(uav_id, *self.places[uav_id], active_task=self.active[uav_id])

    def announce(self, count):
        spots = self.rng.uniform((-1000.0, -1000.0, 30.0), (1000.0, 1000.0, 80.0), (count, 3))
        self.number += count
        self.driver.add(*(
            Task(f't{self.number - k}', tuple(spot)) for k, spot in enumerate(spots)))

    def step(self):
        driver = self.driver
        driver.now += STEP
        self.report()
        for uav_id in sorted(self.alive):
            self.fly(uav_id)
        for _ in range(3):
            before = {u: each.task_ids[:1] for u, each in driver.lists.items()}
            planned = self.planned()
            problem = driver.begin()
            if problem is None:
                break
            driver.finish(problem)
            self.check(problem, before, planned)

    def fly(self, uav_id):
        published = self.driver.lists.get(uav_id)
        if published is None or not published.stops:
            self.active[uav_id] = ''
            return
        stop = published.stops[0]
        if self.active[uav_id] != stop.task.id:
            self.active[uav_id], self.passed[uav_id] = stop.task.id, 0
            assert self.driver.event('STARTED', stop.task.id, uav_id) == ''
        left = STEP * SPEED
        points = (*stop.leg.via, stop.task.position)
        while left > 0.0 and self.passed[uav_id] < len(points):
            goal = points[self.passed[uav_id]]
            far = math.dist(self.places[uav_id], goal)
            share = min(1.0, left / far) if far else 1.0
            self.places[uav_id] = tuple(p + share * (g - p) for p, g in zip(
                self.places[uav_id], goal, strict=True))
            left -= far
            self.passed[uav_id] += share == 1.0
        if self.passed[uav_id] == len(points):
            self.flown.append(stop.task.id)
            assert self.driver.event('COMPLETED', stop.task.id, uav_id) == ''
            self.active[uav_id] = ''

    def planned(self):
        """The ids of the tasks in all lists, and their length [m]."""
        lists = self.driver.world.lists.lists.values()
        return ({task for each in lists for task in each.task_ids},
                sum(each.distance for each in lists))

    def check(self, problem, before, planned):
        """No task is listed twice; the one under way stays; small gains change nothing."""
        driver = self.driver
        lists = driver.world.lists.lists
        ids = [task_id for each in lists.values() for task_id in each.task_ids]
        assert len(ids) == len(set(ids))
        for uav_id in self.alive:
            active = self.active[uav_id]
            if active and driver.world.tasks.records[active].open and (
                    driver.world.airspace.zones == {}):
                assert lists[uav_id].task_ids[:1] == (active,)
        changed = [u for u, first in before.items() if lists[u].task_ids[:1] != first and first]
        if problem.background and changed:
            (old, length), (new, now) = planned, self.planned()  # it serves more, or is shorter
            self.weak += [] if now < length or new - old else [
                (problem.trigger, length, now, old - new)]

    def until_done(self, limit=2000):
        for _ in range(limit):
            self.step()
            if not any(self.driver.world.lists.get(u).stops for u in self.alive):
                return
        raise AssertionError('still flying')


@pytest.mark.parametrize('seed', [1, 2])
def test_every_task_is_flown_once_or_explained(seed):
    fleet = SimulatedFleet(seed, 4)
    fleet.announce(12)
    dome = ThreatZone.hemisphere('dome', (300.0, 300.0, 0.0), 120.0)
    for k in range(120):
        if k % 20 == 5:
            fleet.announce(3)
        if k == 30:
            fleet.driver.cancel('t3')
        if k == 40:
            fleet.alive.discard('u3')
        if k == 60:
            fleet.driver.world.set_zones([dome], (), fleet.driver.now)
            outside = {u for u in fleet.alive if not zones_around(fleet.places[u], [dome])}
        if k == 90:
            fleet.alive.add('u3')
        fleet.step()
        fleet.entered += k > 60 and sum(
            bool(zones_around(fleet.places[u], [dome])) for u in fleet.alive & outside)
    fleet.until_done()
    states = {t: record.state.name for t, record in fleet.driver.world.tasks.records.items()}
    left = {t: fleet.driver.reason(t) for t, state in states.items() if state == 'UNASSIGNED'}
    assert len(fleet.flown) == len(set(fleet.flown))
    assert len(fleet.flown) + len(left) + (states['t3'] == 'CANCELLED') == len(states) == 30
    assert all(left.values())
    assert fleet.weak == []
    revisions = [(each.uav, each.revision) for each in fleet.driver.history]
    assert len(revisions) == len(set(revisions))
    assert fleet.entered == 0
    assert len(revisions) < 4 * len(states)
