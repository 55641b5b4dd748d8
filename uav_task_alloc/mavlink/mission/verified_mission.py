# SPDX-License-Identifier: Apache-2.0
"""The mission that one vehicle holds, as far as it is known: verified, mixed or foreign."""
from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.transport.codec import Message, plan_id

_SETTLE = 3.0  # [s] in which messages sent before the last change may still come
READBACK_PERIOD = 60.0  # [s] between readbacks of a mission that nobody should have changed


class MissionState(Enum):
    """What is known of the mission on board; numbers as in UavState."""

    UNKNOWN = 0
    UPLOADING = 1
    VERIFIED = 2
    MIXED = 3
    FOREIGN = 4


class VerifiedMission:
    """Items without home, and whether somebody else has put them there."""

    def __init__(self, own: int, atomic: bool) -> None:
        self._own, self._atomic = own, atomic
        self.items: tuple[Item, ...] | None = None  # None: to be read
        self.state = MissionState.UNKNOWN
        self.verified_at = 0.0  # [s]
        self.read_once = False  # since the vehicle was first heard or restarted
        self.is_foreign = False  # somebody else has changed what we had verified
        self._plan = self._heard_plan = 0  # PX4's id of the mission verified, last heard

    def note_mission_id(self, message: Message) -> None:
        """MISSION_ACK and MISSION_COUNT tell PX4's id of the mission that they are about."""
        self._heard_plan = plan_id(message)

    def has_mission_id(self, message: Message) -> bool:
        """A MISSION_CURRENT is of this mission, by PX4's id."""
        return self._plan != 0 and plan_id(message) == self._plan

    def verify(self, items: tuple[Item, ...], now: float) -> None:
        """What was uploaded is on board."""
        self.items, self.verified_at, self._plan = items, now, self._heard_plan
        self.state, self.read_once, self.is_foreign = MissionState.VERIFIED, True, False

    def interrupt(self) -> None:
        """A transfer has ended before its end: what is on board is to be read."""
        self.items = None
        self.state = MissionState.UNKNOWN if self._atomic else MissionState.MIXED

    def reset(self) -> None:
        """The vehicle was restarted."""
        self.items, self.state = None, MissionState.UNKNOWN
        self.is_foreign = self.read_once = False

    def check_current(self, message: Message, now: float) -> None:
        """Has somebody else changed the mission? What MISSION_CURRENT says is doubt, not proof."""
        if self.items is None or now - self.verified_at < _SETTLE:
            return
        ours, plan = self._plan, plan_id(message)
        changed = (plan != ours if plan and ours else message.total not in (
            0, 65535, len(self.items), len(self.items) + self._own))
        gone = message.mission_state == d.MISSION_STATE_NO_MISSION and self.items
        if changed or gone or now - self.verified_at > READBACK_PERIOD:
            self.items = None  # read what is on board before anything else

    def note_readback(self, items: tuple[Item, ...], known: tuple[Item, ...], listed: bool,
                 goes_on: Callable[[], bool], now: float) -> bool:
        """A readback has come that no upload of ours explains.

        Args:
            items: read, without home.
            known: those that were on board before.
            listed: a list has come.
            goes_on: whether that list can go on with what was read, without a swap.
            now: [s].

        Returns:
            Whether it is another mission than the one known.
        """
        if known and all_alike(known, items):
            self.items, self.verified_at = known, now
            if self.state is MissionState.UNKNOWN:
                self.state = MissionState.VERIFIED
            return False
        self.items, self.verified_at, self._plan = items, now, self._heard_plan
        if self.state is MissionState.VERIFIED or (not listed and items):
            self.state = MissionState.FOREIGN
            self.is_foreign = self.is_foreign or self.read_once
            self.read_once = False
        elif self.is_foreign and listed and goes_on():
            self.is_foreign, self.state = False, MissionState.UNKNOWN
        return True
