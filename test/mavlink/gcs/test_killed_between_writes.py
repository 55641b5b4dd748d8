# SPDX-License-Identifier: Apache-2.0
"""A bridge killed before or after any write to its state_dir: no task is lost or flown twice."""
import pytest
from flight_bench import FlightBench, Store, flying, places
from mission_bench import REPORTS_STATE, task_list

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

NAMES = 'ABC'
ROW = {name: (60.0 * k, 100.0, 50.0) for k, name in enumerate('ABCD')}  # on a straight line


class Killed(BaseException):
    """The end of the bridge, which no `except Exception` prevents."""


class KillingStore(Store):
    """A state_dir whose bridge is killed at one write of where it is in its list."""

    def __init__(self, write, before):
        super().__init__()
        self.writes_left, self.before = write, before

    def save(self, uav_id, record):
        known = self.records.get(uav_id)
        if known is None or progress_of(known) == progress_of(record):
            super().save(uav_id, record)
            return
        self.writes_left -= 1
        if self.writes_left or not self.before:
            super().save(uav_id, record)
        if not self.writes_left:
            raise Killed


def progress_of(record):
    return (record.mission, record.current, record.arrived, record.uploading,
            record.replacing_since, record.marks)


class KilledBench(FlightBench):
    """A bridge that is started again when it was killed, and an allocator that shortens lists."""

    def __init__(self, kind, write, before, down, service, reports=True):
        self.killed, self.down, self.service = False, down, service
        self.done, self.listed, self.revision = [], None, 0
        super().__init__(kind, store=KillingStore(write, before), delay=(0.02, 0.02),
                         configs=REPORTS_STATE if reports else None)

    def guard(self, call):
        """Call the bridge; what it has not published when it is killed is lost."""
        try:
            call()
        except Killed:
            self.killed, self.listed = True, None
            self.start()
            self.line.cut = True
            self.run(limit=self.down)
            self.line.cut = False

    def _move(self):
        self.guard(super()._move)

    def _collect(self):
        super()._collect()
        self.done += [task for task in self.completed() if task not in self.done]
        assert set(self.done) <= set(places(self))

    def allocate(self):
        """List the tasks not reported yet; an operator hands the aircraft over where it is due."""
        left = [name for name in NAMES if name not in self.done]
        if self.ground_station.sessions:
            if self.authority() is AuthorityState.LOST:
                self.hand_over()
            if left != self.listed:
                self.listed, self.revision = left, self.revision + 1
                self.guard(lambda: self.assign(
                    task_list(left, self.revision, service=self.service)))
        return not left

    def fly(self):
        """Fly the list; returns the tasks of the places reached, in order."""
        assert self.run(self.allocate), (self.done, places(self))
        self.run(limit=8.0)
        return places(self)


def killed_at_each_write(make):
    """The benches that `make(write)` gives for each write, until the bridge is not killed."""
    write, killed = 0, True
    while killed:
        write += 1
        bench = make(write)
        yield write, bench
        killed = bench.killed


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
@pytest.mark.parametrize('before', [True, False])
@pytest.mark.parametrize(('down', 'service'), [(0.0, 0.0), (15.0, 3.0)])
def test_killed_at_any_write_each_task_is_flown_once_and_reported(kind, before, down, service):
    for write, bench in killed_at_each_write(
            lambda write: KilledBench(kind, write, before, down, service)):
        assert bench.fly() == list(NAMES), f'write {write}'
    assert write > len(NAMES)


@pytest.mark.parametrize('down', [0.0, 15.0])
def test_killed_at_any_write_each_task_of_a_px4_without_a_mission_state_is_reported(down):
    for write, bench in killed_at_each_write(
            lambda write: KilledBench('px4', write, False, down, 3.0, reports=False)):
        flown = bench.fly()  # the last one again where its end came in the silence
        assert flown in (['A', 'B', 'C'], ['A', 'B', 'C', 'C']), f'write {write}'


class TurnedBench(KilledBench):
    """Its list is turned around where it nears the second place of a row, which it passes."""

    def __init__(self, kind, write, before, down, near):
        self.near, self.turns_at_write = near, write
        super().__init__(kind, 10**9, before, down, 0.0)

    def reached(self):
        """The places reached, in order."""
        return [name for e in self.truth[1] if e.name == 'item_reached'
                for name, place in ROW.items() if abs(place[0] - e.point[0]) < 3.0]

    def _collect(self):
        FlightBench._collect(self)
        self.done += [task for task in self.completed() if task not in self.done]
        assert set(self.done) <= set(self.reached())

    def allocate(self):
        if self.near is not None and 'A' in self.done and (
                ROW['B'][0] - self.vehicles[1].flight.body.position[0] <= self.near):
            self.near, self.store.writes_left = None, self.turns_at_write
        left = [name for name in ROW if name not in self.done]
        if self.ground_station.sessions and left[::1 if self.near else -1] != self.listed:
            self.listed, self.revision = left[::1 if self.near else -1], self.revision + 1
            self.guard(lambda: self.assign(TaskList(self.revision, tuple(
                MissionStop(Task(name, ROW[name]), ()) for name in self.listed), False)))
        return not left


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
@pytest.mark.parametrize('before', [True, False])
@pytest.mark.parametrize(('near', 'down'), [(3.0, 0.0), (10.0, 15.0)])
def test_killed_at_any_write_of_a_replacement_no_task_is_flown_twice(kind, before, near, down):
    for write, bench in killed_at_each_write(
            lambda write: TurnedBench(kind, write, before, down, near)):
        bench.fly()
        assert sorted(bench.reached()) == list(ROW), f'write {write}'
    assert write > len(ROW)


@pytest.mark.parametrize('near', [25.0, 30.0, 35.0])
def test_killed_as_it_reaches_an_item_in_a_replacement_nothing_else_is_completed(near):
    bench = TurnedBench('px4', 10**9, True, 0.0, near)
    bench.line.delay = 0.3, 0.3
    assert bench.run(lambda: bench.allocate() or 'B' in bench.reached())
    bench.listed = None
    bench.start()
    bench.fly()  # which compares what is completed with what it has reached
    assert set(bench.reached()) == set(ROW)


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_what_is_reported_or_answered_is_stored_before(kind):
    bench, seen = flying(kind), []
    receive = bench.ground_station.receive

    def checked(address, message, now):
        out, executor = receive(address, message, now), bench.executor()
        before = bench.store.saved
        executor.watch.save_record()
        seen.extend(['event'] * len(executor.events) + ['answer'] * len(out))
        assert bench.store.saved == before or not (executor.events or out), message.get_type()
        return out
    bench.ground_station.receive = checked
    bench.assign(task_list('ABXC', 2))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'X', 'C'])
    assert {'event', 'answer'} <= set(seen)
