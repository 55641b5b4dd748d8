# SPDX-License-Identifier: Apache-2.0
"""Returns a UAV that holds for a shared id before its battery is empty, or says why it may not.

Nobody else does: its allocator has no list for it, and its autopilot may have no failsafe.
"""
from __future__ import annotations

import math
from collections import deque

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.end_of_list import EndOfList
from uav_task_alloc.mavlink.gcs.hand_over import LOW_BATTERY
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRule
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.vehicle_energy import VehicleEnergy
from uav_task_alloc.mavlink.transport.notes import OperatorNote


class LowBatteryReturn:
    """A rule of the executor that comes before the one that holds.

    Args:
        sender, telemetry, watch, profile, holds, energy: of the vehicle.
        end_of_list: whether it may return.
        notes: for the log.
    """

    def __init__(self, sender: CommandSender, telemetry: Telemetry, watch: AuthorityWatch,
                 profile: Profile, holds: HoldRule, energy: VehicleEnergy,
                 end_of_list: EndOfList, notes: deque[OperatorNote]) -> None:
        self._sender, self._telemetry, self._watch = sender, telemetry, watch
        self._profile, self._holds, self._energy = profile, holds, energy
        self._end_of_list, self._notes = end_of_list, notes
        self._reported = False  # a battery that is not empty; else 0 is unknown
        self._low = self._turned = self._noted = False  # in this flight, while it held
        self.alarm = ''  # why it stays on a low battery; '': it does not

    def turn_home(self, now: float) -> NextMessages:
        """Return on a low battery, and go on to do so until it has landed.

        Args:
            now: steady time [s].

        Returns:
            Messages to send; None: it is not to return.
        """
        telemetry, alarm_before, self.alarm = self._telemetry, self.alarm, ''
        self._reported = self._reported or telemetry.battery > 0.0
        if not telemetry.airborne or not self._watch.authority.held or self._sender.climbing:
            self._low = self._turned = self._noted = False
            return None
        returns = telemetry.mode is ModeFunction.RETURN
        if self._turned and returns:
            out = self._end_of_list.stop_return(now)
            return out if out is not None else self._sender.wait_for('its landing')
        self._turned = False
        if not self._holds.for_shared_id or (
                telemetry.mode is not ModeFunction.HOLD and not returns):
            return None
        self._low = self._low or self._is_low(now)
        if not self._low:
            return None
        if blocked := self._holds.held_by_others or self._end_of_list.blocked_home():
            self.alarm = (f'holds on a low battery, and {blocked}: stays; expected a return '
                          'by radio control')
            if self.alarm != alarm_before:
                self._notes.append(OperatorNote('error', f'{self.alarm} ({self._charge})'))
            return None
        if self._sender.backing_off(now):
            return []
        self._turned = True
        if not self._noted:
            self._noted = True
            self._notes.append(OperatorNote(
                'error', f'returns on a low battery ({self._charge}), as it gets no list: '
                f'{self._holds.reason}'))
        return self._sender.set_mode(ModeFunction.RETURN, now)

    @property
    def _charge(self) -> str:
        return f'{self._telemetry.battery:.0%}'

    def _is_low(self, now: float) -> bool:
        """Whether the battery is down to what is kept, or above it only has the way home."""
        telemetry, battery = self._telemetry, self._telemetry.battery
        if not self._reported or math.isnan(battery):
            return False
        if battery < LOW_BATTERY:
            return True
        limits, home = self._energy.limits_now(now), telemetry.home
        if home is None or not telemetry.has_position:
            return False
        kept = LOW_BATTERY * limits.full_range
        if math.isnan(kept):
            kept = LOW_BATTERY / battery * limits.range
        return limits.range - kept <= math.dist(telemetry.position, home)
