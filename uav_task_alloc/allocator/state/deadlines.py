# SPDX-License-Identifier: Apache-2.0
"""When tasks are expected to start, which will be late, by how much, and what would help."""
from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import TaskRecord, TaskVerdict
from uav_task_alloc.allocator.state.earliest_starts import EarliestStarts
from uav_task_alloc.allocator.state.fleet import Fleet, may_fly
from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.allocator.state.flights import Flights
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.model import Task
from uav_task_alloc.timetable import clock_text

_LATE = 0.25  # [s] after its latest that is no rounding
_NEWS = 2.0  # [s] change of an expected start that is published
_SHARE = 0.05  # of the time until it, where that is longer
_MORE = 5.0  # [s] change of a lateness that is reported again, or of a wait that is sent again
_OF_WAIT = 0.02  # of the time until the service, where that is longer
# of the solver, which counts from now
_ARRIVAL = re.compile(r'latest -?\d+ s; the earliest arrival is ')
_EACH = re.compile(r'arrives at (-?\d+) s, its latest is -?\d+ s')


class Deadlines:
    """Expected starts and late tasks, of the lists in force; times are [s] of the ROS clock.

    `expected`: start of the service by task id, as published. `texts`: why a listed task will be
    late, by task id.

    Args:
        tasks, fleet, flights: the present state.

    Arguments of methods:
        stamp: [s] published clock.
        task: with times of the ROS clock.
    """

    def __init__(self, tasks: TaskRegistry, fleet: Fleet, flights: Flights) -> None:
        self._tasks, self._fleet, self._flights = tasks, fleet, flights
        self.expected: dict[str, float] = {}
        self.texts: dict[str, str] = {}
        self._late: dict[str, float] = {}  # [s] as in the texts
        self._logged: set[str] = set()  # late tasks that are in the log

    def update(self, lists: Iterable[UavList], later: Mapping[str, float],
               stamp: float) -> tuple[bool, list[str]]:
        """Compare predictions with what was published of them.

        Args:
            lists: in force, with times from now.
            later: expected starts of tasks on later trips, by task id.
            stamp: [s] published clock.

        Returns:
            Whether an expected start or a text is news; and texts of tasks that are late only
            now, or later than before.
        """
        found = {stop.task.id: stamp + stop.start for each in lists for stop in each.stops}
        found.update((name, start) for name, start in later.items() if name not in found)
        fresh = {name: self._news(name, start, stamp) for name, start in found.items()}
        news, self.expected = fresh != self.expected, fresh
        late = {name: over for name, start in found.items() if (over := self._over(name, start))}
        in_time = [name for name in self.texts if name not in late]
        for name in in_time:
            del self.texts[name], self._late[name]
        worse = [name for name, over in late.items()
                 if name not in self._late or abs(over - self._late[name]) > _MORE]
        reports, starts = [], self._starts(stamp)
        for name in worse:
            if late[name] > self._late.get(name, 0.0):
                reports.append(f'{name} would start {max(1.0, late[name]):.0f} s late')
            self._late[name] = late[name]
            self.texts[name] = self._text(self._tasks.records[name], found[name], starts,
                                          stamp)
        return news or bool(worse or in_time), reports

    def _news(self, name: str, start: float, stamp: float) -> float:
        """The expected start as published: the earlier one where the change is small."""
        known = self.expected.get(name)
        small = max(_NEWS, _SHARE * (start - stamp))
        return start if known is None or abs(start - known) > small else known

    def _over(self, name: str, start: float) -> float:
        record = self._tasks.records.get(name)
        late = start - record.task.latest if record is not None and record.open else 0.0
        return late if late > _LATE else 0.0

    def log_lines(self) -> Iterator[tuple[str, bool]]:
        """Yield lines for the log, each once, and whether it is a warning."""
        for name in sorted(self.texts.keys() - self._logged):
            yield f'task {name!r} will be late: {self.texts[name]}', True
        for name in sorted(self._logged - self.texts.keys()):
            if self._tasks.is_open(name) and name in self.expected:
                yield f'task {name!r} will be in time again', False
        self._logged = set(self.texts)

    @property
    def late(self) -> Mapping[str, float]:
        """By how much listed tasks are late [s], as reported."""
        return self._late

    def refused(self, task: Task, stamp: float) -> TaskVerdict | None:
        """Refuse an announcement that cannot be kept; None where it may be, or is a replay."""
        known = self._tasks.records.get(task.id)
        if known is not None and task in (known.task, known.announced):
            return None
        why = self.refusal(task, stamp)
        return self._tasks.reject(task.id, why, stamp) if why else None

    def refusal(self, task: Task, stamp: float) -> str:
        """Return why a new task cannot be kept, whatever else is flown; '' if it may be.

        Without a known UAV that may fly it nothing is refused.
        """
        able = [record.report for record in self._fleet.records.values()
                if may_fly(task, (), record.report)] if task.payload > 0.0 else []
        if able:
            most = max(able, key=lambda report: report.payload_capacity or 0.0)
            if task.payload > (most.payload_capacity or 0.0):
                return (f'payload {task.payload:g} kg; the largest capacity is '
                        f'{most.payload_capacity or 0.0:g} kg ({most.uav_id})')
        if task.latest < stamp:
            return (f'latest {clock_text(task.latest, stamp)} is '
                    f'{duration_text(stamp - task.latest)} in the past: it is '
                    f'{clock_text(stamp, stamp)}')
        start, uav_id = self._least_start(task, stamp, task.latest + _LATE)
        if uav_id and start > task.latest + _LATE:
            return (f'latest {clock_text(task.latest, stamp)} cannot be kept: the earliest '
                    f'possible start is {clock_text(start, stamp)} ({uav_id})')
        return ''

    def _least_start(self, task: Task, stamp: float, enough: float) -> tuple[float, str]:
        """The start of a task by the UAV that could be first, with nothing lost to stops or wind.

        enough: [s]; the first start that is not later will do.
        """
        best = math.inf, ''
        places = (task.position, task.end) if task.reversible else (task.position,)
        for uav_id, record in self._fleet.records.items():
            if not may_fly(task, (), record.report):
                continue
            pace = self._flights.pace(uav_id)
            speed = max(pace.speed, record.report.cruise_speed or 0.0)
            pace = FlightPace(speed + math.hypot(*pace.wind), pace.climb, pace.descent)
            seconds = min(pace.seconds((record.report.position, place)) for place in places)
            best = min(best, (max(max(stamp, task.release) + seconds, task.earliest), uav_id))
            if best[0] <= enough:
                break
        return best

    def _starts(self, stamp: float) -> EarliestStarts:
        return EarliestStarts(self._tasks, self._fleet, self._flights, stamp)

    def _text(self, record: TaskRecord, start: float, starts: EarliestStarts, stamp: float) -> str:
        """Why a listed task is late, by how much, and what would help."""
        task = record.task
        late = max(1.0, start - task.latest)
        return (f'expected {clock_text(start, stamp)}, {late:.0f} s after its latest '
                f'{clock_text(task.latest, stamp)}; {_help(record, starts, stamp)}')

    def left_out(self, reasons: Mapping[str, str], stamp: float) -> dict[str, str]:
        """Return why tasks are in no list; of those with a deadline with times of the ROS clock.

        Args:
            reasons: of the solver, in seconds from now, by task id.
            stamp: [s] of the problem that was solved.
        """
        starts = self._starts(stamp)
        return {task_id: self._left_out(task_id, reason, starts, stamp)
                for task_id, reason in reasons.items()}

    def _left_out(self, task_id: str, reason: str, starts: EarliestStarts, stamp: float) -> str:
        record = self._tasks.records.get(task_id)
        if record is None or math.isinf(record.task.latest):
            return reason
        if record.task.latest < stamp:
            return (f'its latest {clock_text(record.task.latest, stamp)} has passed; an update '
                    'with a later `latest` would help')

        latest = clock_text(record.task.latest, stamp)
        if _ARRIVAL.match(reason):
            return f'latest {latest} cannot be kept: {_help(record, starts, stamp)}'
        reason = _EACH.sub(lambda found: f'arrives at '
                           f'{clock_text(stamp + float(found[1]), stamp)}, its latest is {latest}',
                           reason)
        return f'{reason}; {_help(record, starts, stamp)}'


def _help(record: TaskRecord, starts: EarliestStarts, stamp: float) -> str:
    """What would help a task that is too late."""
    task = record.task
    first, uav_id = starts.first(task, record.failed_on, usable=True)
    if first <= task.latest:
        return (f'{uav_id} could start it at {clock_text(first, stamp)} if it flew it first')
    other, other_id = starts.first(task, record.failed_on, usable=False)
    if other <= task.latest:
        return (f'{other_id} could start it at {clock_text(other, stamp)} if it were '
                'available')
    if math.isinf(min(first, other)):
        return ('no UAV on the ground can carry it' if task.payload > 0.0 else
                'no UAV that may fly it is known')
    start, uav_id = min((first, uav_id), (other, other_id))
    return (f'no UAV can start it before {clock_text(start, stamp)} ({uav_id}); an update '
            'with a later `latest` would help')


def duration_text(seconds: float) -> str:
    """Return a duration for people: `40 s`, `12 min`, `5 h`, `9 days`.

    Args:
        seconds: [s], not negative.
    """
    for name, unit in (('days', 86400.0), ('h', 3600.0), ('min', 60.0)):
        if seconds >= 2.0 * unit:
            return f'{seconds / unit:.0f} {name}'
    return f'{seconds:.0f} s'


def without_jitter(published: UavList, now: UavList) -> bool:
    """Return whether the waits of a list need not be sent again.

    Args:
        published: list in force, with times from its stamp.
        now: the same with times from `now.stamp`.

    Returns:
        False where a wait, or the start of the first service after one, has changed by more than
        5 s, and by more than 2 % of the time until the service.
    """
    for k, (old, new) in enumerate(zip(published.stops, now.stops, strict=True)):
        if old.wait == new.wait == 0.0:
            continue
        if k == 0:  # it waits, or flies there: the rest of the wait becomes shorter with time
            change = published.stamp + old.start - now.stamp - new.start
        else:
            change = old.wait - new.wait
        if abs(change) > max(_MORE, _OF_WAIT * new.start):
            return False
    return True
