# SPDX-License-Identifier: Apache-2.0
"""Windows, release and payload of Task messages to those of model.Task and back.

In messages, and in the tasks of the allocator, times are [s] of the ROS clock; zero is none.
"""
from __future__ import annotations

import math
from typing import TypedDict

from builtin_interfaces.msg import Time
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task
from uav_task_alloc.record.message_records import from_stamp
from uav_task_alloc.timetable import clock_text

_MOST_PAYLOAD = 1e6  # [kg]
_LAST = 2**31 - 1  # [s] whole ones that a message can hold


class TaskTimes(TypedDict):
    """Arguments of model.Task."""

    earliest: float  # [s] of the ROS clock
    latest: float  # [s] of the ROS clock
    release: float  # [s] of the ROS clock
    payload: float  # [kg]


def to_times(place: str, msg: m.Task) -> TaskTimes:
    """Return the times and the payload of a task.

    Args:
        place: `task ID: `, for the error text.
        msg: from any publisher, not yet checked.

    Returns:
        No earliest time: -inf; no latest: inf; no release: 0.

    Raises:
        InvalidValue: a time is negative, `latest` is before `earliest` or `release`, or the
            payload is negative or infinite.
    """
    earliest, latest, release = (_seconds(f'{place}{name}', getattr(msg, name))
                                 for name in ('earliest', 'latest', 'release'))
    for name, other in (('earliest', earliest), ('release', release)):
        if 0.0 < latest < other:
            raise InvalidValue(f'{place}latest', clock_text(latest),
                               f'at least {name} = {clock_text(other)}')
    payload = 0.0 if math.isnan(msg.payload) else check_number(
        f'{place}payload', msg.payload, 0.0, _MOST_PAYLOAD)
    return {'earliest': earliest or -math.inf, 'latest': latest or math.inf, 'release': release,
            'payload': payload}


def _seconds(place: str, time: Time) -> float:
    if time.sec < 0 or time.nanosec >= 10**9:
        raise InvalidValue(place, f'{time.sec} s and {time.nanosec} ns',
                           'a time of the ROS clock (sec >= 0, nanosec < 1e9), or zero: none')
    return from_stamp(time)


def from_time(seconds: float) -> Time:
    """Return a time of a task as a message.

    Args:
        seconds: [s] of the ROS clock; infinite, 0 or less: none.

    Returns:
        Zero where there is none; the last one that a message can hold instead of a later one.
    """
    if not 0.0 < seconds < math.inf:
        return Time()
    whole = min(math.floor(seconds), _LAST)
    return Time(sec=whole, nanosec=min(999_999_999, round((seconds - whole) * 1e9)))


def from_expected(seconds: float) -> Time:
    """Return a predicted time as a message.

    Args:
        seconds: [s] of the ROS clock; 0: not known.

    Returns:
        Zero where it is not known, or later than a message can hold.
    """
    return from_time(seconds) if seconds < _LAST + 1 else Time()


def put_times(msg: m.Task, task: Task) -> m.Task:
    """Set the times and the payload of a message.

    Args:
        msg: is changed.
        task: with times of the ROS clock.

    Returns:
        The same message.
    """
    msg.earliest, msg.latest = from_time(task.earliest), from_time(task.latest)
    msg.release, msg.payload = from_time(task.release), task.payload
    return msg
