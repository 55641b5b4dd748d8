# SPDX-License-Identifier: Apache-2.0
"""Finding 33: allocator and bridge joined over virtual time; new tasks under old ids."""
import importlib.util
from pathlib import Path

import pytest
from findings_bench import BOTH, FindingsBench
from flight_bench import places

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

PLACES = {'A': (0.0, 100.0, 50.0), 'B': (100.0, 100.0, 50.0), 'C': (200.0, 100.0, 50.0)}


def load_driver():
    """The virtual allocator of the tests one folder up, which is not on the path of these."""
    file = Path(__file__).parents[2] / 'allocation.py'
    spec = importlib.util.spec_from_file_location('allocation', file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.AllocatorDriver


class Fleet:
    """One UAV in flight, a bridge, and an allocator that receives the events of the bridge."""

    def __init__(self, kind, **params):
        self.make_driver = load_driver()
        self.bench = FindingsBench(kind).discover()
        self.loses_events = False  # of the bridge
        self.start(**params)

    def start(self, rows=(), **params):
        """Start an allocator with the journal of the previous one."""
        self.driver = self.make_driver(restored_state(rows), **params)
        self.driver.now = 1000.0 + self.bench.now
        self.revision = self.driver.world.lists.get('uav_1').revision

    def run(self, until, limit=120.0):
        """Let time pass until the condition holds; True where it did."""
        end = self.bench.now + limit
        while self.bench.now < end and not until():
            self.step()
        return until()

    def step(self):
        """Step by a quarter of a second."""
        bench, driver = self.bench, self.driver
        bench.run(limit=0.25)
        driver.now = 1000.0 + bench.now
        state = bench.state()
        report = UavReport('uav_1', state.position, list_revision=bench.onboard().revision)
        driver.world.update_uav(report, driver.now, driver.now)
        self.deliver_events()
        driver.settle(report=False)
        published = driver.lists.get('uav_1')
        if published is not None and published.revision > self.revision:
            self.revision = published.revision
            stops = tuple(MissionStop(stop.task, stop.leg.via) for stop in published.stops)
            bench.assign(TaskList(published.revision, stops, published.returns))

    def deliver_events(self):
        """Deliver the events of the bridge, unless they are lost."""
        events, self.bench.events = self.bench.events, []
        for _, event in events:
            if not self.loses_events:
                self.driver.event(event.event, event.task, 'uav_1', event.revision)

    def add(self, names):
        self.driver.add(*(Task(name, PLACES[name]) for name in names))

    def state(self, name):
        known = self.driver.world.tasks.records.get(name)
        return known.state.name if known else ''

    def flown(self, name):
        return places(self.bench).count(name)


@BOTH
def test_finding_33_a_task_announced_again_at_the_same_place_is_flown(kind):
    fleet = Fleet(kind, keep_ended=0)
    fleet.add('ABC')
    assert fleet.run(lambda: not fleet.driver.world.tasks.records)  # all ended and forgotten
    assert [fleet.flown(name) for name in 'ABC'] == [1, 1, 1]
    fleet.add('AC')
    assert fleet.run(lambda: not fleet.driver.world.tasks.records)
    assert [fleet.flown(name) for name in 'ABC'] == [2, 1, 2]


@BOTH
def test_finding_33_a_task_announced_again_while_others_are_flown_is_flown(kind):
    fleet = Fleet(kind, keep_ended=0)
    fleet.add('ABC')
    assert fleet.run(lambda: fleet.flown('A') == 1 and 'A' not in fleet.driver.world.tasks.records)
    fleet.add('A')
    assert fleet.run(lambda: not fleet.driver.world.tasks.records)
    assert [fleet.flown(name) for name in 'ABC'] == [2, 1, 1]


@BOTH
@pytest.mark.parametrize('away', [False, True])
def test_finding_33_what_was_flown_while_the_allocator_received_nothing_is_flown_once(kind, away):
    """away: a list without the tasks comes meanwhile, as for a UAV that seemed silent."""
    fleet = Fleet(kind)
    fleet.add('ABC')
    fleet.loses_events = True
    assert fleet.run(lambda: fleet.flown('B') == 1)
    if away:
        fleet.driver.world.set_available('uav_1', False, fleet.driver.now)
        assert fleet.run(lambda: fleet.driver.route('uav_1') == ())
        fleet.driver.world.set_available('uav_1', True, fleet.driver.now)
    fleet.loses_events = False
    assert fleet.run(lambda: [fleet.state(name) for name in 'ABC'] == ['COMPLETED'] * 3)
    assert [fleet.flown(name) for name in 'ABC'] == [1, 1, 1]


@BOTH
def test_finding_33_a_restart_with_a_journal_does_not_hide_what_is_new(kind):
    fleet = Fleet(kind, keep_ended=0)
    fleet.add('ABC')
    assert fleet.run(lambda: not fleet.driver.world.tasks.records)
    fleet.driver.core.nothing_written()
    fleet.start(fleet.driver.core.rows(), keep_ended=0)
    fleet.add('B')
    assert fleet.run(lambda: not fleet.driver.world.tasks.records)
    assert [fleet.flown(name) for name in 'ABC'] == [1, 2, 1]


@BOTH
def test_finding_33_announcements_repeated_to_an_allocator_without_journal_are_not_flown(kind):
    fleet = Fleet(kind)
    fleet.add('ABC')
    assert fleet.run(lambda: fleet.state('C') == 'COMPLETED')
    fleet.start()
    fleet.add('ABC')
    assert fleet.run(lambda: [fleet.state(name) for name in 'ABC'] == ['COMPLETED'] * 3)
    assert [fleet.flown(name) for name in 'ABC'] == [1, 1, 1]
