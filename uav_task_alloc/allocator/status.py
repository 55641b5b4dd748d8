# SPDX-License-Identifier: Apache-2.0
"""Status for operators: of each task, and of the allocator as warnings and key values."""
from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import Allocation, TaskRecord, TaskState
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.works import Works
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.state.zone_checks import blocked_text
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.record.diagnostic_records import BATTERY_RESERVE, ORDER, UAV_WARNING, WAITING

_MAX_NAMED = 20  # UAVs in a warning
_MAX_ORDERS = 50  # in the diagnostics, the newest
_TURN = 'turn home '  # key: the last moment for it, with the id of a UAV
_MAX_STRANDED = 5  # warnings of UAVs without a safe path home


@dataclass(frozen=True, slots=True)
class TaskStatus:
    """State of one task, for publication."""

    task_id: str  # accepted or refused
    state: TaskState  # REJECTED where it was refused
    uav: str  # that has it, or had it when it ended
    reason: str  # of the state, for users
    stamp: float  # [s] of the last change
    expected: float = 0.0  # [s] predicted start of the service; 0: unknown
    pieces_done: int = 0  # completed, of work that is flown in pieces
    pieces: int = 0  # 0: it has none


def status_of(task_id: str, known: TaskRecord | tuple[str, float],
              expected: float = 0.0) -> TaskStatus:
    """Return the status of a task for publication.

    Args:
        task_id: of the task.
        known: record of an accepted task, or (reason, stamp [s]) of a refused one.
        expected: predicted start of the service [s] of the ROS clock; 0: unknown.

    Returns:
        REJECTED without a UAV where it was refused.
    """
    if isinstance(known, TaskRecord):
        return TaskStatus(task_id, known.state, known.uav, known.reason, known.stamp,
                          expected if known.open else 0.0)
    reason, stamp = known
    return TaskStatus(task_id, TaskState.REJECTED, '', reason, stamp)


def status_of_work(works: Works, work: WorkRecord,
                   expected: Mapping[str, float]) -> TaskStatus:
    """Return the status of work that is flown in pieces.

    Args:
        works: all of it.
        work: accepted.
        expected: predicted starts [s] of the ROS clock, by id of the piece.

    Returns:
        It is expected when its next piece is.
    """
    record, done = works.whole_record(work)
    starts = [expected[each] for each in works.open_pieces(work.id) if expected.get(each)]
    return replace(status_of(work.id, record, min(starts, default=0.0)), pieces_done=done,
                   pieces=len(work.pieces))


def last_finish(world: World, stamp: float) -> float:
    """Return the time until the last UAV has flown its list.

    Args:
        world: with the lists in force.
        stamp: published clock [s].

    Returns:
        [s]; 0.0 where no UAV has tasks, NaN where one with tasks has not reported.
    """
    lists = world.lists_in_force()
    flights = {uav_id: flight for uav_id in lists
               if (flight := world.flights.of(uav_id, stamp))}
    if any(each.stops and uav_id not in flights for uav_id, each in lists.items()):
        return math.nan
    return max((finish_time(world.lists.restamped(uav_id, stamp, flight), flight)
                for uav_id, flight in flights.items()), default=0.0)


def allocation_line(allocation: Allocation, finish: float) -> str:
    """Return the line of the log about a plan.

    Args:
        allocation: as published.
        finish: time until the last UAV has flown its list [s]; NaN: not known.

    Returns:
        Trigger, tasks, length, finish and solve time.
    """
    plan = allocation.plan
    counts = [len(each.stops) for each in allocation.lists if each.stops]
    left_out = f', {len(plan.unassigned)} left out' if plan.unassigned else ''
    ends = '' if math.isnan(finish) else f'finish in {finish:.0f} s, '
    return (f'plan {allocation.revision} ({allocation.trigger}): '
            f'{counted(sum(counts), "task")} on {counted(len(counts), "UAV")}{left_out}; '
            f'{plan.distance:.0f} m, {ends}'
            f'solved in {1e3 * plan.solve_time:.0f} ms')


def health_warnings(world: World, journal_error: str, solver_error: str = '',
                    stamp: float | None = None) -> list[str]:
    """Return what an operator has to know.

    Args:
        world: of the allocator.
        journal_error, solver_error: '' where there is none.
        stamp: [s] published clock; None: unknown.

    Returns:
        One sentence each; empty where all is well.
    """
    fleet, open_tasks = world.fleet, world.tasks.open()
    left_out = [record for record in open_tasks if record.state is TaskState.UNASSIGNED]
    blocked = blocked_text(fleet.blocked_on_ground())
    warnings = [f'journal: {journal_error}'] if journal_error else []
    warnings += [world.admission.full] if world.admission.full else []
    warnings += [f'solver: {solver_error}'] if solver_error else []
    warnings += _uav_warnings(world, stamp)
    warnings += [f'{blocked}: no tasks'] if blocked else []
    warnings += [f'{uav_id} has no safe path home: {why}'
                 for uav_id, why in sorted(world.zone_checks.stranded.items())
                 if uav_id in fleet.records and not fleet.records[uav_id].silent][:_MAX_STRANDED]
    warnings += [f'{counted(len(left_out), "task")} unassigned, {left_out[0].task.id}: '
                 f'{left_out[0].reason}'] if left_out else []
    late = sorted(world.deadlines.late)
    warnings += [f'{counted(len(late), "task")} late, {late[0]}: '
                 f'{world.deadlines.texts[late[0]]}'] if late else []
    return warnings + (['no UAV available'] if open_tasks and not world.fleet.usable_ids() else [])


def _uav_warnings(world: World, stamp: float | None) -> list[str]:
    records, flights = sorted(world.fleet.records.items()), world.flights
    silent = [uav_id for uav_id, record in records
              if record.silent and not flights.in_battery_change(uav_id, stamp)]
    low = [uav_id for uav_id, record in records if record.low]
    doubled = [uav_id for uav_id, record in records
               if world.jumps.in_two_places(uav_id) and not record.silent]
    return [f'{text}: {first_of(uavs, _MAX_NAMED)}'
            for text, uavs in (('silent', silent), ('battery low', low),
                               ('reported from two places in turn, expected one source each',
                                doubled)) if uavs]


def _zone_warnings(world: World) -> list[tuple[str, str]]:
    """Ids of UAVs that get no tasks, are inside a zone, or have no safe path home, and why."""
    found = []
    for uav_id, record in sorted(world.uav_records().items()):
        inside = f'inside zone {record.zone}' if record.zone else ''
        blocked = record.blocked_on_ground and f'{record.blocked_on_ground}: no tasks'
        why = world.zone_checks.stranded.get(uav_id, '')
        text = blocked or inside or (why and f'no safe path home: {why}')
        if text and not record.silent:
            found.append((uav_id, text.removeprefix(f'{uav_id} is ')))
    return found[:_MAX_NAMED]


def health_values(world: World, solving: bool,
                  near: Mapping[str, str] | None = None,
                  turns: Mapping[str, str] | None = None,
                  waiting: Mapping[str, str] | None = None) -> dict[str, object]:
    """Return numbers of UAVs, tasks and zones, and the revision in force, by name.

    Args:
        world: of the allocator.
        solving: a plan is being computed.
        near: UAVs that would lose separation, by id; None: none.
        turns: last moments to turn home, by id; None: none.
        waiting: where idle UAVs wait, or why they stay, by id; None: none.

    Returns:
        Counts of UAVs, zones and of tasks by state; the revision of the allocation; what is wrong
        with single UAVs.
    """
    states = Counter(record.state for task_id, record in world.task_records().items()
                     if not split_piece(task_id)[1])
    states.update(map(world.works.state, world.works.records.values()))
    orders = list(world.orders.in_force.values())[-_MAX_ORDERS:]
    warnings = dict(near or {})
    for uav_id, text in _zone_warnings(world):
        warnings[uav_id] = '; '.join(filter(None, (warnings.get(uav_id), text)))
    return {**{f'{UAV_WARNING}{uav_id}': text for uav_id, text in warnings.items()},
            **{f'{_TURN}{uav_id}': text
               for uav_id, text in list((turns or {}).items())[:_MAX_NAMED]},
            **{f'{WAITING}{uav_id}': text
               for uav_id, text in list((waiting or {}).items())[:_MAX_NAMED]},
            **{f'{ORDER}{order.id}': f'{order.text} ({order.operator})' for order in orders},
            'orders in force': len(world.orders.in_force),
            'UAVs known': len(world.uav_records()),
            'UAVs available': len(world.fleet.usable_ids()),
            BATTERY_RESERVE: world.params.battery_reserve,
            'zones': len(world.airspace.zones), 'revision': world.revision,
            **{f'tasks {state.name}': states[state] for state in TaskState
               if state is not TaskState.REJECTED},
            'tasks REJECTED': len(world.tasks.rejected), 'tasks late': len(world.deadlines.late),
            'wind': '{:.1f} m/s east, {:.1f} m/s north'.format(*world.flights.wind.wind),
            'time lost at a stop': f'{world.flights.stop_time:.1f} s', 'solving': solving}
