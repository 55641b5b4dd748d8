# SPDX-License-Identifier: Apache-2.0
"""What is known of the mission on board of one vehicle: verified, mixed or foreign."""
from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d
from pymavlink.dialects.v20.ardupilotmega import MAV_MISSION_TYPE_MISSION

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.mavlink.mission.current_item_reports import SETTLE_TIME
from uav_task_alloc.mavlink.mission.items import Item, all_alike
from uav_task_alloc.mavlink.transport.codec import Message, plan_id
from uav_task_alloc.model import Point

READBACK_PERIOD = 60.0  # [s] between readbacks of a mission that should not have changed


class MissionState(Enum):
    """Knowledge of the mission on board; numbers as in UavState.mission_state."""

    UNKNOWN = 0
    UPLOADING = 1
    VERIFIED = 2
    MIXED = 3
    FOREIGN = 4


class VerifiedMission:
    """The items on board, without home, and whether another station uploaded them.

    Args:
        own: number of leading items that the vehicle sets itself: home.
        atomic: whether a failed upload leaves the old mission (PX4).

    Arguments of methods:
        message: of the vehicle.
        items: by seq.
        now: steady time [s].
    """

    def __init__(self, own: int, atomic: bool) -> None:
        self._own, self._atomic = own, atomic
        self.items: tuple[Item, ...] | None = None  # None: to be downloaded
        self.state = MissionState.UNKNOWN
        self.verified_at = 0.0  # [s]
        self.read_once = False  # since the vehicle was found or restarted
        self.is_foreign = False  # another station has changed a verified mission
        self.altered = False  # the vehicle has taken other items than were sent
        self._mission_id = 0  # of the verified mission (PX4); 0: none
        self.reported_id = 0  # last reported

    def note_mission_id(self, message: Message) -> None:
        """Store PX4's mission id from a MISSION_ACK or MISSION_COUNT; not that of a fence.

        A MISSION_ACK with an error has none.
        """
        refused = message.get_type() == 'MISSION_ACK' and message.type != d.MAV_MISSION_ACCEPTED
        if message.mission_type == MAV_MISSION_TYPE_MISSION and not refused:
            self.reported_id = plan_id(message)

    def has_mission_id(self, message: Message) -> bool:
        """Whether a MISSION_CURRENT refers to this mission, by PX4's mission id."""
        return self._mission_id != 0 and plan_id(message) == self._mission_id

    def is_taken(self, message: Message) -> bool:
        """Whether a MISSION_CURRENT refers to the mission taken last, by PX4's mission id."""
        return self.reported_id != 0 and plan_id(message) == self.reported_id

    def verify(self, items: tuple[Item, ...], now: float) -> None:
        """Note that these items are on board after our upload."""
        self.items, self.verified_at, self._mission_id = items, now, self.reported_id
        self.state, self.read_once = MissionState.VERIFIED, True
        self.is_foreign = self.altered = False

    def landing_place(self, origin: Origin) -> Point | None:
        """Return where the mission lands.

        Args:
            origin: of the ENU frame.

        Returns:
            [m] ENU, at the height of the origin; None where it does not end with NAV_LAND.
        """
        last = self.items[-1] if self.items else None
        if last is None or last.command != d.MAV_CMD_NAV_LAND:
            return None
        return to_enu(origin, last.x * 1e-7, last.y * 1e-7, origin.altitude_amsl)

    def interrupt(self) -> None:
        """Note that an upload failed: the mission on board must be downloaded."""
        self.items = None
        self.state = MissionState.UNKNOWN if self._atomic else MissionState.MIXED

    def reset(self) -> None:
        """Drop everything: the vehicle was restarted."""
        self.items, self.state = None, MissionState.UNKNOWN
        self.is_foreign = self.read_once = self.altered = False

    def check_current(self, message: Message, now: float) -> None:
        """Request a download where a MISSION_CURRENT does not fit the mission, or it is due."""
        if self.items is None or now - self.verified_at < SETTLE_TIME:
            return
        ours, reported = self._mission_id, plan_id(message)
        changed = (reported != ours if reported and ours else message.total not in (
            0, 65535, len(self.items), len(self.items) + self._own))
        cleared = message.mission_state == d.MISSION_STATE_NO_MISSION and self.items
        if changed or cleared or now - self.verified_at > READBACK_PERIOD:
            self.items = None  # download before anything else

    def note_foreign(self) -> None:
        """Note that another station has put the mission on board."""
        self.is_foreign, self.state = True, MissionState.FOREIGN

    def note_changed(self, now: float) -> bool:
        """Request a download, as the vehicle reports a change that is not of our upload.

        Returns:
            Whether it is requested: not while the change may still be of our upload.
        """
        if now - self.verified_at >= SETTLE_TIME:
            self.items = None
        return self.items is None

    def read_since(self, since: float) -> bool:
        """Whether it was read at steady time `since` [s] or later; else request a download."""
        if self.verified_at < since:
            self.items = None
        return self.items is not None

    def note_readback(self, items: tuple[Item, ...], known: tuple[Item, ...], listed: bool,
                      continues: Callable[[], bool], now: float) -> bool:
        """Take a download that no upload of ours explains.

        Args:
            items: on board, without home.
            known: those known to be on board before.
            listed: whether the UAV has a list.
            continues: whether that list can continue on these items, without replacing them.
            now: steady time [s].

        Returns:
            Whether it is another mission than the known one.
        """
        if known and all_alike(known, items):
            self.items, self.verified_at = known, now
            if self.state is MissionState.UNKNOWN and not self.altered:
                self.state = MissionState.VERIFIED
            return False
        self.items, self.verified_at, self._mission_id = items, now, self.reported_id
        if self.state is MissionState.VERIFIED or (not listed and items):
            self.state = MissionState.FOREIGN
            self.is_foreign = self.is_foreign or self.read_once
            self.read_once = False
        elif self.is_foreign and listed and continues():
            self.is_foreign, self.state = False, MissionState.UNKNOWN
        return True
