# SPDX-License-Identifier: Apache-2.0
"""Conversion of diagnostics into lines of a record: what bridges and allocators say of UAVs."""
from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from uav_task_alloc.record.message_records import RecordBody, finite_or_none, from_stamp

_Message = Any

_SLOWEST, _FASTEST = 0.01, 200.0  # a clock rate beyond is a fault of its measurement
_COUNT = re.compile('[0-9]{1,18}')  # int() refuses some strings for which isdigit() is true
UAV_WARNING = 'warning of '  # a key of an allocator begins so, and ends with the id of a UAV
WAITING = 'waiting of '  # the same, of a UAV without tasks
ORDER = 'order '  # a key of an allocator begins so, and ends with the id of an order
BATTERY_RESERVE = 'battery reserve'  # key of an allocator: share, see its parameter
NOTHING = 'nothing is needed'  # value of `given_back_by` while the bridge has authority


def of_namespace(msg: _Message, namespace: str) -> list[_Message]:
    """Return the statuses of the nodes of one fleet: `/diagnostics` is of all fleets.

    Args:
        msg: DiagnosticArray.
        namespace: of the fleet; '/': none.

    Returns:
        Those whose names, before a colon, are full names of nodes in the namespace.
    """
    return [status for status in msg.status
            if status.name.partition(':')[0].rpartition('/')[0] == namespace.rstrip('/')]


def uploads_record(msg: _Message) -> RecordBody:
    """Return the bridge's values of a DiagnosticArray.

    Args:
        msg: DiagnosticArray of one fleet.

    Returns:
        Kind `uploads`. `uploads`: counts by name of the status; `health`: [level, text, hardware
        id] likewise, which is the UAV in statuses of a bridge, '' of a node; `authority`,
        `clock_rates`: by UAV; `uav_warnings`: texts by UAV, by name of the status of an allocator;
        `waiting`: where idle UAVs wait, likewise; `orders`: of operators, texts by id, likewise;
        `battery_reserves`: shares by its name; `stamp` [ROS s] of the message of an allocator.
    """
    warnings = dict(_of_allocators(msg, UAV_WARNING))
    stamp = {'stamp': from_stamp(msg.header.stamp)} if warnings else {}
    return {
        'kind': 'uploads', **stamp, 'uploads': dict(_upload_counts(msg)),
        'authority': dict(_authority(msg)), 'clock_rates': dict(_clock_rates(msg)),
        'uav_warnings': warnings, 'waiting': dict(_of_allocators(msg, WAITING)),
        'orders': dict(_of_allocators(msg, ORDER)),
        'battery_reserves': dict(_battery_reserves(msg)), 'health': {
            status.name: [
                status.level if isinstance(status.level, int) else ord(status.level),
                status.message, status.hardware_id]
            for status in msg.status}}


def _upload_counts(msg: _Message) -> Iterable[tuple[str, int]]:
    for status in msg.status:
        for pair in status.values:
            if pair.key == 'uploads' and _COUNT.fullmatch(pair.value):
                yield status.name, int(pair.value)


def _authority(msg: _Message) -> Iterable[tuple[str, RecordBody]]:
    """By UAV: state, reason (`why`), duration (`for`) [s] or None, and what gives it `back`."""
    for status in msg.status:
        values = {pair.key: pair.value for pair in status.values}
        if 'authority' in values:
            back = values.get('given_back_by', '')
            yield status.hardware_id, {
                'state': values['authority'], 'why': values.get('authority_why', ''),
                'for': _seconds_or_none(values.get('authority_for', '')),
                'back': '' if back == NOTHING else back}


def _of_allocators(msg: _Message, prefix: str) -> Iterable[tuple[str, dict[str, str]]]:
    """By allocator: the values whose keys begin with a prefix, by the rest of the key."""
    for status in msg.status:
        values = {pair.key: pair.value for pair in status.values}
        if 'UAVs known' in values:
            yield status.name, {key.removeprefix(prefix): text
                                for key, text in values.items() if key.startswith(prefix)}


def _battery_reserves(msg: _Message) -> Iterable[tuple[str, float]]:
    """By allocator: share of the battery below which it sends a UAV home."""
    for status in msg.status:
        for pair in status.values:
            share = _seconds_or_none(pair.value) if pair.key == BATTERY_RESERVE else None
            if share is not None:
                yield status.name, share


def _clock_rates(msg: _Message) -> Iterable[tuple[str, float]]:
    """By UAV: seconds of its clock in one of the bridge's."""
    for status in msg.status:
        for pair in status.values:
            rate = _seconds_or_none(pair.value) if pair.key == 'clock_rate' else None
            if rate is not None and _SLOWEST <= rate <= _FASTEST:
                yield status.hardware_id, rate


def _seconds_or_none(text: str) -> float | None:
    """The number of `12 s`; None for any other text."""
    try:
        return finite_or_none(float(text.removesuffix(' s')))
    except ValueError:
        return None
