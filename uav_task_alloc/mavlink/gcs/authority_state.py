# SPDX-License-Identifier: Apache-2.0
"""Who controls a vehicle, and what is stored of it for a restarted bridge."""
from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from uav_task_alloc.mavlink.mission.piece_mark import PieceMark


class AuthorityState(Enum):
    """Who controls a vehicle; the values are those of UavState.authority."""

    UNKNOWN = 0
    NONE = 1
    HELD = 2
    SUSPENDED = 3
    LOST = 4

    __hash__ = object.__hash__  # many times as fast; members are compared by identity anyway


class TaskMark(NamedTuple):
    """A task that was flown or skipped, which a restarted bridge cannot read from the vehicle."""

    task: str
    x: float  # [m] ENU of the task
    y: float
    z: float
    at: float  # steady time [s]
    flown: bool  # False: another station has set the current item beyond it


@dataclass(frozen=True, slots=True)
class AuthorityRecord:
    """What is stored for a restarted bridge; times are steady [s]."""

    state: AuthorityState = AuthorityState.NONE
    why: str = 'never granted'
    since: float = 0.0
    killed: bool = False
    landed: bool = False  # NONE after our own landing: `takeoff` alone does not grant it
    until_landing: bool = False  # `takeoff` became false in the air
    flown: bool = False  # armed since the grant
    mode: int | None = None  # HEARTBEAT.custom_mode received last
    armed: bool = False
    commanded: tuple[int, ...] = ()  # custom modes sent and not confirmed by a heartbeat
    arming: bool = False
    replacing_since: float | None = None  # since when it is held for a mission replacement
    climb: float | None = None  # [m] above home, of a take-off in progress
    marks: tuple[TaskMark, ...] = ()  # of the last tasks
    mission: int | None = None  # checksum of the items on board
    current: int | None = None  # index of the item being flown, home not counted
    arrived: bool = False  # the vehicle was seen at that item
    # items passed and still to be judged: index of the first one and after the last one, whether
    # it has left mission mode unseen since (0 no, 1 yes, 2 perhaps), indices where it was seen
    passed: tuple[int, ...] = ()
    # checksum of a mission being uploaded, or whose current item is still to be set, and index of
    # its start; with it the current item may be of the mission before
    uploading: tuple[int, ...] = ()
    # vehicle time [s], position [m] and velocity [m/s], both ENU, of one to three recent positions
    seen: tuple[float, ...] = ()
    # 0..1, at its own landing or on its way down over its home, while it may start again
    landed_battery: float | None = None
    pieces: tuple[PieceMark, ...] = ()  # that are partly flown
    # the next tasks on board, with the one being flown; at 0 s, flown: passed, and seen there
    ahead: tuple[TaskMark, ...] = ()


# of a file that cannot be used: what it held is not known
UNUSABLE = AuthorityRecord(AuthorityState.UNKNOWN, 'its authority file cannot be used')
