# SPDX-License-Identifier: Apache-2.0
"""The world as rows of the journal and back."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any

from uav_task_alloc.allocator.records import Stop, TaskRecord, TaskState, UavList
from uav_task_alloc.journal import Row
from uav_task_alloc.model import Leg, Shape, Task, ThreatZone


@dataclass(slots=True)
class Saved:
    """What survives a restart."""

    tasks: list[TaskRecord] = field(default_factory=list)
    lists: list[UavList] = field(default_factory=list)
    zones: list[ThreatZone] = field(default_factory=list)
    off: list[str] = field(default_factory=list)  # UAVs an operator switched off
    revision: int = 0  # of the allocation
    learnt: Any = None  # by the bees: the body of their row
    bad: list[str] = field(default_factory=list)  # rows that are left out, and why


def task_row(record: TaskRecord) -> Row:
    """A task and its fate."""
    body = {spec.name: _plain(getattr(record, spec.name)) for spec in fields(record)
            if spec.name != 'announced' or record.announced is not record.task}
    return Row('task', record.task.id, body)


def list_row(uav_list: UavList) -> Row:
    """What a UAV was told last."""
    return Row('list', uav_list.uav, _plain(uav_list))


def zones_row(zones: Iterable[ThreatZone]) -> Row:
    """All zones, a whole picture."""
    return Row('zones', '', [_plain(zone) for zone in zones])


def off_row(off: Iterable[str]) -> Row:
    """The UAVs that an operator switched off."""
    return Row('off', '', sorted(off))


def revision_row(revision: int) -> Row:
    """The revision of the allocation."""
    return Row('revision', '', revision)


def saved(rows: Iterable[Row]) -> Saved:
    """The world of these rows; one that is not as it was written is left out, and told."""
    found = Saved()
    for row in rows:
        try:
            _take(found, row)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            found.bad.append(f'journal row {row.kind} {row.id!r} cannot be read: {error!r}')
    known = {record.task.id for record in found.tasks}
    found.lists = [replace(each, stops=tuple(s for s in each.stops if s.task.id in known))
                   for each in found.lists]
    return found


def _take(found: Saved, row: Row) -> None:
    if row.kind == 'task':
        found.tasks.append(_task_record(row.body))
    elif row.kind == 'list':
        found.lists.append(_list(row.body))
    elif row.kind == 'zones':
        found.zones = [_zone(body) for body in row.body]
    elif row.kind == 'off':
        found.off = [str(uav_id) for uav_id in row.body]
    elif row.kind == 'revision':
        found.revision = int(row.body)
    elif row.kind == 'learner':
        found.learnt = row.body
    else:
        raise ValueError(f'unknown kind {row.kind!r}')


def _plain(value: Any) -> Any:
    if isinstance(value, (str, int, float)) or value is None:
        return value
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, Enum):
        return value.value
    return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}


def _task(body: dict[str, Any]) -> Task:
    return Task(**{spec.name: body[spec.name] for spec in fields(Task)})


def _zone(body: dict[str, Any]) -> ThreatZone:
    return ThreatZone(**{**body, 'shape': Shape(body['shape']),
                         'vertices': tuple((x, y) for x, y in body['vertices'])})


def _task_record(body: dict[str, Any]) -> TaskRecord:
    return TaskRecord(**{**body, 'task': _task(body['task']),
                         'announced': _task(body.get('announced', body['task'])),
                         'state': TaskState(body['state']),
                         'failed_on': tuple(body['failed_on'])})


def _list(body: dict[str, Any]) -> UavList:
    stops = tuple(Stop(_task(stop['task']), _leg(stop['leg']), stop['eta'])
                  for stop in body['stops'])
    return UavList(**{**body, 'stops': stops, 'end_via': tuple(map(tuple, body['end_via']))})


def _leg(body: dict[str, Any]) -> Leg:
    return Leg(tuple((x, y, z) for x, y, z in body['via']), body['length'])
