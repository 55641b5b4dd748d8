# SPDX-License-Identifier: Apache-2.0
"""The mission that an upload carries, and the outcomes of an upload."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.errors import MissionError
from uav_task_alloc.mavlink.mission.items import Item


@dataclass(frozen=True, slots=True)
class Mission:
    """Items as uploaded, and the one to fly now."""

    items: tuple[Item, ...]  # by seq
    start: int = 0  # seq
    flag_start: bool = False  # mark it with current=1, to which PX4 jumps
    own: int = 0  # leading items that the vehicle sets itself: home

    def __post_init__(self) -> None:
        if not self.items:
            raise MissionError('mission items = (): expected at least one; a UAV with an empty '
                               'list is held instead')


@dataclass(frozen=True, slots=True)
class Verified:
    """The readback matches: this mission is on board."""

    mission: Mission  # on board


@dataclass(frozen=True, slots=True)
class Failed:
    """The upload failed; only a readback shows the mission on board."""

    mission: Mission  # that was uploaded
    reason: str  # a text for users
    result: int | None = None  # MAV_MISSION_RESULT
    seq: int | None = None  # the item last requested, where the vehicle refused


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle has accepted all items: MISSION_ITEM_REACHED refers to them from now on."""

    mission: Mission  # on board, not yet read back


@dataclass(frozen=True, slots=True)
class Downloaded:
    """The mission on board, read without an upload; None where the vehicle did not answer."""

    items: tuple[Item, ...] | None  # by seq


Outcome = Verified | Failed | Accepted | Downloaded
