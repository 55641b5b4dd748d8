# SPDX-License-Identifier: Apache-2.0
"""What nodes report of a run, as values: tasks, their states, services, zones, authority."""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.model import Point, ThreatZone
from uav_task_alloc.record.record_file import Line

END_STATES = ('COMPLETED', 'FAILED', 'CANCELLED', 'REJECTED')
FINAL_STATES = (*END_STATES, 'UNASSIGNED')


@dataclass(frozen=True, slots=True)
class AnnouncedTask:
    """A task as it was announced."""

    position: Point  # [m]
    wall: float  # [unix s]
    service: float = 0.0  # [s]
    earliest: float | None = None  # [ROS s] of the start of its service; None: any
    latest: float | None = None  # [ROS s] of the start of its service; None: any
    work: str = ''  # name of a kind of Task messages; '' for a point
    path: tuple[Point, ...] = ()  # [m] of a LINE, or the outline of an AREA
    holes: tuple[tuple[Point, ...], ...] = ()  # [m]
    radius: float = 0.0  # [m] of an ORBIT


def announced_task(row: Line, wall: float) -> AnnouncedTask:
    """Return a task as it was announced.

    Args:
        row: of a line of kind `announcement`.
        wall: when it was announced first [unix s].
    """
    return AnnouncedTask(
        tuple(row['position']), wall, row.get('service', 0.0), row.get('earliest'),
        row.get('latest'), row.get('work', ''), tuple(map(tuple, row.get('path', ()))),
        tuple(tuple(map(tuple, hole)) for hole in row.get('holes', ())), row.get('radius') or 0.0)


@dataclass(frozen=True, slots=True)
class Service:
    """The service of a task, as planned when the leg to it began, or as flown."""

    uav: str  # id
    begin: float  # [unix s] as `wall`
    end: float  # [unix s] as `wall`


@dataclass(frozen=True, slots=True)
class ReportedStatus:
    """The state of a task as the allocator reports it."""

    state: str  # name of a TaskStatus constant
    uav: str  # that has it, or had it; '': none
    reason: str  # of the state, for users
    done: int = 0  # pieces of work that are completed
    pieces: int = 0  # of work; 0: it has none


# of one that is in no message any more, though it has not ended
UNKNOWN_TASK = ReportedStatus(
    'PENDING', '', 'the allocator does not know it any more, as after a restart without a '
    'journal; announce it again')


def is_refused(known: AnnouncedTask, status: ReportedStatus, row: Line, action: str,
               now: float) -> bool:
    """Return whether an allocator refuses an announcement of a task, as far as that can be known.

    Args:
        known: the task as announced before.
        status: of it.
        row: of a line of kind `announcement`.
        action: ADD or UPDATE.
        now: clock of the allocator [ROS s].

    Returns:
        False also where the allocator refused the task before.
    """
    if status.state == 'REJECTED':
        return False
    latest = row.get('latest')
    return (action == 'ADD' or status.state in ('COMPLETED', 'CANCELLED')
            or bool(known.work) != bool(row.get('work'))  # it stays a point, or work
            or (latest is not None and latest < now and latest != known.latest))


@dataclass(frozen=True, slots=True)
class SolveRecord:
    """One published plan: when, solve time, and what triggered it."""

    wall: float  # [unix s]
    milliseconds: float
    trigger: str


@dataclass(frozen=True, slots=True)
class ZoneInterval:
    """A zone and the time during which it was in force."""

    zone: ThreatZone  # as it was then
    since: float  # [unix s]
    until: float = math.inf  # [unix s]


@dataclass(frozen=True, slots=True)
class ReportedAuthority:
    """Who may command a UAV, as its bridge reports it."""

    state: str
    reason: str
    since: float | None  # [unix s]
    given_back_by: str  # what returns the UAV to the bridge; '': nothing is needed
