# SPDX-License-Identifier: Apache-2.0
"""What an upload carries, and the ways in which it can end."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.errors import MissionError
from uav_task_alloc.mavlink.mission.items import Item


@dataclass(frozen=True, slots=True)
class Mission:
    """Items as they go on board, and the one to fly now."""

    items: tuple[Item, ...]
    start: int = 0  # seq
    flag_start: bool = False  # say it with current=1, which PX4 jumps to
    own: int = 0  # items at the front that are the vehicle's own: home

    def __post_init__(self) -> None:
        if not self.items:
            raise MissionError('mission items = (): expected at least one; a UAV with an empty '
                               'list is held instead')


@dataclass(frozen=True, slots=True)
class Verified:
    """The readback is alike: this is on board."""

    mission: Mission


@dataclass(frozen=True, slots=True)
class Failed:
    """This upload has ended without success; what is on board is known from a readback only."""

    mission: Mission
    reason: str
    result: int | None = None  # MAV_MISSION_RESULT
    seq: int | None = None  # the item last asked for, where the vehicle refused


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle has taken all items: REACHED speaks of them from now on."""

    mission: Mission


@dataclass(frozen=True, slots=True)
class Downloaded:
    """What the vehicle holds, read without an upload; None where it did not answer."""

    items: tuple[Item, ...] | None


Outcome = Verified | Failed | Accepted | Downloaded
