# SPDX-License-Identifier: Apache-2.0
"""The state of the allocator as rows of the journal, and back."""
from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from enum import Enum
from typing import Any, TypeVar

from uav_task_alloc.actions import Action
from uav_task_alloc.allocator.list_records import LaterTrips, ListStop, UavList
from uav_task_alloc.allocator.persistence.order_rows import restore_order_row
from uav_task_alloc.allocator.records import Proposal, SavedState, TaskRecord, TaskState
from uav_task_alloc.allocator.state.seen_tasks import restored_block
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.checks import check_id, check_names, check_number, check_point, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import Leg, Point, Task, ThreatZone
from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.values import Kind, Vertical
from uav_task_alloc.zone_codec import JOURNAL_ZONE, decode_zone, encode_zone

_Value = TypeVar('_Value')
_ORDER_KINDS = frozenset({'order', 'order_log', 'hold'})
_KINDS = frozenset({'task', 'work', 'list', 'zones', 'off', 'revision', 'learner', 'origin',
                    'proposal', 'demand', 'change', *_ORDER_KINDS})
_UNREADABLE = (LookupError, TypeError, ValueError, AttributeError, OverflowError)
_FIRST_FIELDS = frozenset({'id', 'position', 'value', 'service_time', 'required_capabilities',
                           'allowed_uavs', 'acceptance_radius'})  # every journal has them
_MAX = 2.0**31 - 1.0  # [s] of a stamp, and the last revision, that a message can hold


def task_row(record: TaskRecord) -> JournalRow:
    """Return the row of a task and its state."""
    body = {spec.name: _plain(getattr(record, spec.name)) for spec in fields(record)
            if spec.name != 'announced' or record.announced is not record.task}
    return JournalRow('task', record.task.id, body)


def work_row(record: WorkRecord) -> JournalRow:
    """Return the row of work that is flown in pieces, which have rows as tasks."""
    return JournalRow('work', record.id, _plain(record))


def list_row(uav_list: UavList) -> JournalRow:
    """Return the row of the list published last for a UAV."""
    return JournalRow('list', uav_list.uav, _plain(uav_list))


def zones_row(zones: Iterable[ThreatZone]) -> JournalRow:
    """Return the row of all zones."""
    return JournalRow('zones', '', [encode_zone(zone, JOURNAL_ZONE) for zone in zones])


def off_row(off: Iterable[str]) -> JournalRow:
    """Return the row of the UAVs that an operator switched off."""
    return JournalRow('off', '', sorted(off))


def change_row(uav_id: str, change_from: float | None) -> JournalRow:
    """Return the row of a UAV sent home for another battery; without a body it has it."""
    return JournalRow('change', uav_id, change_from)


def revision_row(revision: int) -> JournalRow:
    """Return the row of the revision of the allocation."""
    return JournalRow('revision', '', revision)


def proposal_row(proposal: Proposal | None) -> JournalRow:
    """Return the row of the plan that waits for approval; without a body where none does."""
    return JournalRow('proposal', '', None if proposal is None else _plain(proposal))


def origin_row(origin: Origin) -> JournalRow:
    """Return the row of the origin of all coordinates."""
    return JournalRow('origin', '', [origin.latitude, origin.longitude, origin.altitude_amsl])


def restored_state(rows: Iterable[JournalRow]) -> SavedState:
    """Return the state of these rows.

    An unreadable row or zone is left out, and named in `unreadable`; so are tasks of a list
    whose row is missing.

    Args:
        rows: of a journal.

    Returns:
        For a new allocator.
    """
    state = SavedState()
    for row in rows:
        try:
            _restore(state, row)
        except _UNREADABLE as error:
            state.unreadable.append(
                f'journal row {row.kind} {row.id!r} cannot be read: {error!r}')
    known = {record.task.id for record in state.tasks}
    state.lists = [replace(each, stops=tuple(s for s in each.stops if s.task.id in known))
                   for each in state.lists]
    return state


def _restore(state: SavedState, row: JournalRow) -> None:
    if row.kind not in _KINDS:
        raise ValueError(f'unknown kind {row.kind!r}')
    if isinstance(row.body, (bytes, str)):
        raise ValueError('body: expected JSON')
    json.dumps(row.body, ensure_ascii=False).encode()  # no message can hold a lone surrogate
    if row.kind == 'task':
        state.tasks.append(_task_record(row.id, row.body))
    elif row.kind == 'work':
        state.works.append(_work_record(row.id, row.body))
    elif row.kind == 'list':
        state.lists.append(_uav_list(row.id, row.body))
    elif row.kind == 'zones':
        state.zones = _each(state, 'zone', row.body, decode_zone)
    elif row.kind == 'off':
        state.switched_off = _each(state, 'UAV switched off', row.body, _uav_id)
    elif row.kind == 'change':
        state.change_from[_uav_id(row.id)] = check_number('change_from', row.body, 0.0, 1.0)
    elif row.kind == 'revision':
        state.revision = _whole_number('revision', row.body)
    elif row.kind == 'proposal':
        state.proposal = None if row.body is None else _proposal(row.body)
    elif row.kind == 'learner':
        state.learned = row.body
    elif row.kind == 'demand':
        state.seen_tasks[int(row.id)] = restored_block(row.body)
    elif row.kind in _ORDER_KINDS:
        restore_order_row(state.orders, row)
    else:
        state.origin = Origin(*row.body)


def _each(state: SavedState, what: str, bodies: Any,
          read: Callable[[Any], _Value]) -> list[_Value]:
    """The readable values of a row; the others are named in `unreadable`."""
    good = []
    for body in _list_of(what, bodies):
        try:
            good.append(read(body))
        except _UNREADABLE as error:
            state.unreadable.append(f'journal: {what} cannot be read: {error!r}')
    return good


def _plain(value: Any) -> Any:
    if isinstance(value, (str, int, float)) or value is None:
        return value
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, Enum):
        return value.value
    return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}


def _task(body: dict[str, Any]) -> Task:
    check_ros_name('task id', split_piece(check_id('task id', body['id']))[0])
    # what an earlier version did not know has its default
    values = {spec.name: body[spec.name] for spec in fields(Task)
              if spec.name in body or spec.name in _FIRST_FIELDS}
    actions = tuple(Action(each['name'], tuple(map(tuple, each['values'])))
                    for each in _list_of('actions', values.get('actions', [])))
    return Task(**{**values, 'actions': actions})


def _work(body: dict[str, Any]) -> Work:
    return Work(**{
        **body, 'task': _task(body['task']), 'kind': Kind(body['kind']),
        'path': _points('path', body['path']), 'vertical': Vertical(body['vertical']),
        'holes': tuple(_points('holes', hole) for hole in _list_of('holes', body['holes']))})


def _work_record(task_id: str, body: dict[str, Any]) -> WorkRecord:
    pieces = tuple(map(str, _list_of('pieces', body['pieces'])))
    record = WorkRecord(_work(body['work']), _work(body['announced']), pieces,
                        _whole_number('last', body['last']),
                        tuple(_width(each) for each in _list_of('widths', body.get('widths', []))))
    _check_same('task id', record.id, task_id)
    for each in pieces:
        _check_same('piece', split_piece(each)[0], task_id)
    return record


def _width(body: Any) -> tuple[int, float]:
    last, width = _list_of('widths', body)
    return _whole_number('last', last), check_number('widths', width, 0.0, _MAX)


def _uav_id(body: Any) -> str:
    return check_ros_name('uav_id', check_id('uav_id', body))


def _task_record(task_id: str, body: dict[str, Any]) -> TaskRecord:
    # rows of an earlier version have no announcement: the last change is the nearest to it
    record = TaskRecord(**{'since': body['stamp'], **body, 'task': _task(body['task']),
                           'announced': _task(body.get('announced', body['task'])),
                           'state': TaskState(body['state']),
                           'failed_on': tuple(_list_of('failed_on', body['failed_on']))})
    check_names('failed_on', record.failed_on)
    _check_same('task id', record.task.id, task_id)
    for name, text in (('uav', record.uav), ('reason', record.reason)):
        if not isinstance(text, str):
            raise InvalidValue(name, text, 'a string')
    check_number('stamp', record.stamp, -_MAX, _MAX)
    check_number('since', record.since, -_MAX, _MAX)
    return record


def _uav_list(uav_id: str, body: dict[str, Any]) -> UavList:
    stops = tuple(ListStop(_task(stop['task']), _leg(stop['leg']),
                           _non_negative('eta', stop['eta']),
                           _non_negative('wait', stop.get('wait', 0.0)),
                           _non_negative('served', stop.get('served', 0.0)),
                           _non_negative('begin_after', stop.get('begin_after', 0.0)),
                           stop.get('reversed', False) is True,
                           _non_negative('path_time', stop.get('path_time', 0.0)))
                  for stop in _list_of('stops', body['stops']))
    uav_list = UavList(**{**body, 'stops': stops, 'end_via': _points('end_via', body['end_via']),
                           'revision': _whole_number('revision', body['revision']),
                           'distance': _non_negative('distance', body['distance']),
                           'stamp': check_number('stamp', body['stamp'], -_MAX, _MAX)})
    _check_same('uav', _uav_id(uav_list.uav), uav_id)
    if not isinstance(uav_list.returns, bool):
        raise InvalidValue('returns', uav_list.returns, 'true or false')
    return uav_list


def _proposal(body: dict[str, Any]) -> Proposal:
    lists = tuple(_uav_list(each['uav'], each) for each in _list_of('lists', body['lists']))
    proposal = Proposal(**{**body, 'lists': lists,
                           'changes': tuple(map(str, _list_of('changes', body['changes']))),
                           'late': tuple(map(str, _list_of('late', body['late']))),
                           'trigger': str(body['trigger']),
                           'later': _later_trips(body.get('later', {}))})
    for name in ('revision', 'base_revision'):
        _whole_number(name, body[name])
    for name in ('stamp', 'deadline', 'distance', 'finish'):
        check_number(name, body[name], -sys.float_info.max, sys.float_info.max)
    if type(proposal.accepted_on_timeout) is not bool or not lists:
        raise InvalidValue('proposal', body, 'lists, and accepted_on_timeout true or false')
    return proposal


def _later_trips(body: dict[str, Any]) -> LaterTrips:
    return {_uav_id(uav_id): tuple(tuple(map(str, _list_of('trip', trip)))
                                   for trip in _list_of('later', trips))
            for uav_id, trips in body.items()}


def _leg(body: dict[str, Any]) -> Leg:
    return Leg(_points('via', body['via']), _non_negative('length', body['length']))


def _points(place: str, body: Any) -> tuple[Point, ...]:
    return tuple(check_point(place, point) for point in _list_of(place, body))


def _non_negative(place: str, body: Any) -> float:
    """A length [m] or a duration [s]."""
    return check_number(place, body, 0.0, sys.float_info.max)


def _whole_number(place: str, body: Any) -> int:
    if not isinstance(body, int):
        raise InvalidValue(place, body, 'a whole number')
    return int(check_number(place, body, 0.0, _MAX))


def _list_of(place: str, body: Any) -> list[Any]:
    if not isinstance(body, list):
        raise InvalidValue(place, body, 'a list')
    return body


def _check_same(place: str, value: str, expected: str) -> None:
    if value != expected:
        raise InvalidValue(place, value, f'{expected!r} as the row has it')
