# SPDX-License-Identifier: Apache-2.0
"""The world as rows of the journal and back."""
from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any, TypeVar

from uav_task_alloc.allocator.records import ListStop, TaskRecord, TaskState, UavList
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import (
    Leg,
    Point,
    Task,
    ThreatZone,
    check_id,
    check_names,
    check_number,
    check_point,
    check_ros_name,
)
from uav_task_alloc.zone_codec import JOURNAL_ZONE, decode_zone, encode_zone

Thing = TypeVar('Thing')
_KINDS = frozenset({'task', 'list', 'zones', 'off', 'revision', 'learner', 'origin'})
UNREADABLE = (LookupError, TypeError, ValueError, AttributeError, OverflowError)
LAST = 2.0**31 - 1.0  # [s] the last stamp, and the last revision, that a message can hold


@dataclass(slots=True)
class Saved:
    """What survives a restart."""

    tasks: list[TaskRecord] = field(default_factory=list)
    lists: list[UavList] = field(default_factory=list)
    zones: list[ThreatZone] = field(default_factory=list)
    off: list[str] = field(default_factory=list)  # UAVs an operator switched off
    revision: int = 0  # of the allocation
    learnt: Any = None  # by the bees: the body of their row
    origin: Origin | None = None  # of all coordinates; None: the journal does not say
    bad: list[str] = field(default_factory=list)  # rows that are left out, and why


def task_row(record: TaskRecord) -> JournalRow:
    """A task and its fate."""
    body = {spec.name: _plain(getattr(record, spec.name)) for spec in fields(record)
            if spec.name != 'announced' or record.announced is not record.task}
    return JournalRow('task', record.task.id, body)


def list_row(uav_list: UavList) -> JournalRow:
    """What a UAV was told last."""
    return JournalRow('list', uav_list.uav, _plain(uav_list))


def zones_row(zones: Iterable[ThreatZone]) -> JournalRow:
    """All zones, a whole picture."""
    return JournalRow('zones', '', [encode_zone(zone, JOURNAL_ZONE) for zone in zones])


def off_row(off: Iterable[str]) -> JournalRow:
    """The UAVs that an operator switched off."""
    return JournalRow('off', '', sorted(off))


def revision_row(revision: int) -> JournalRow:
    """The revision of the allocation."""
    return JournalRow('revision', '', revision)


def origin_row(origin: Origin) -> JournalRow:
    """Where ENU (0, 0, 0) is."""
    return JournalRow('origin', '', [origin.latitude, origin.longitude, origin.altitude_amsl])


def saved(rows: Iterable[JournalRow]) -> Saved:
    """The world of these rows; one that is not as it was written is left out, and told."""
    found = Saved()
    for row in rows:
        try:
            _take(found, row)
        except UNREADABLE as error:
            found.bad.append(f'journal row {row.kind} {row.id!r} cannot be read: {error!r}')
    known = {record.task.id for record in found.tasks}
    found.lists = [replace(each, stops=tuple(s for s in each.stops if s.task.id in known))
                   for each in found.lists]
    return found


def _take(found: Saved, row: JournalRow) -> None:
    if row.kind not in _KINDS:
        raise ValueError(f'unknown kind {row.kind!r}')
    if isinstance(row.body, (bytes, str)):
        raise ValueError('body: expected JSON')
    json.dumps(row.body, ensure_ascii=False).encode()  # no message holds half a character
    if row.kind == 'task':
        found.tasks.append(_task_record(row.id, row.body))
    elif row.kind == 'list':
        found.lists.append(_list(row.id, row.body))
    elif row.kind == 'zones':
        found.zones = _each(found, 'zone', row.body, decode_zone)
    elif row.kind == 'off':
        found.off = _each(found, 'UAV switched off', row.body, _uav_id)
    elif row.kind == 'revision':
        found.revision = _whole('revision', row.body)
    elif row.kind == 'learner':
        found.learnt = row.body
    else:
        found.origin = Origin(*row.body)


def _each(found: Saved, what: str, bodies: Any, read: Callable[[Any], Thing]) -> list[Thing]:
    """Those of a row that can be read; of the others it is told."""
    good = []
    for body in _list_of(what, bodies):
        try:
            good.append(read(body))
        except UNREADABLE as error:
            found.bad.append(f'journal: {what} cannot be read: {error!r}')
    return good


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
    check_ros_name('task id', check_id('task id', body['id']))
    return Task(**{spec.name: body[spec.name] for spec in fields(Task)})


def _uav_id(body: Any) -> str:
    return check_ros_name('uav_id', check_id('uav_id', body))


def _task_record(task_id: str, body: dict[str, Any]) -> TaskRecord:
    record = TaskRecord(**{**body, 'task': _task(body['task']),
                           'announced': _task(body.get('announced', body['task'])),
                           'state': TaskState(body['state']),
                           'failed_on': tuple(_list_of('failed_on', body['failed_on']))})
    check_names('failed_on', record.failed_on)
    _same('task id', record.task.id, task_id)
    for name, text in (('uav', record.uav), ('reason', record.reason)):
        if not isinstance(text, str):
            raise InvalidValue(name, text, 'a string')
    check_number('stamp', record.stamp, -LAST, LAST)
    return record


def _list(uav_id: str, body: dict[str, Any]) -> UavList:
    stops = tuple(ListStop(_task(stop['task']), _leg(stop['leg']), _metres('eta', stop['eta']))
                  for stop in _list_of('stops', body['stops']))
    found = UavList(**{**body, 'stops': stops, 'end_via': _points('end_via', body['end_via']),
                       'revision': _whole('revision', body['revision']),
                       'distance': _metres('distance', body['distance']),
                       'stamp': check_number('stamp', body['stamp'], -LAST, LAST)})
    _same('uav', _uav_id(found.uav), uav_id)
    if not isinstance(found.returns, bool):
        raise InvalidValue('returns', found.returns, 'true or false')
    return found


def _leg(body: dict[str, Any]) -> Leg:
    return Leg(_points('via', body['via']), _metres('length', body['length']))


def _points(place: str, body: Any) -> tuple[Point, ...]:
    return tuple(check_point(place, point) for point in _list_of(place, body))


def _metres(place: str, body: Any) -> float:
    """A length [m] or a time span [s]."""
    return check_number(place, body, 0.0, sys.float_info.max)


def _whole(place: str, body: Any) -> int:
    if not isinstance(body, int):
        raise InvalidValue(place, body, 'a whole number')
    return int(check_number(place, body, 0.0, LAST))


def _list_of(place: str, body: Any) -> list[Any]:
    if not isinstance(body, list):
        raise InvalidValue(place, body, 'a list')
    return body


def _same(place: str, value: str, expected: str) -> None:
    if value != expected:
        raise InvalidValue(place, value, f'{expected!r} as the row has it')
