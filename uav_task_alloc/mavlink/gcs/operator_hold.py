# SPDX-License-Identifier: Apache-2.0
"""Holds a vehicle: for an operator, to keep it separate, at a zone, while its id is shared.

A hold is sent before any transfer, and kept until it ends.

Whether HOLD may be sent is asked of the authority over the vehicle, as for any command.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.hand_over import REST_SPEED
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.zone_ahead import ZoneAhead
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Point, ThreatZone

SHARED_ID = 'shared id'  # source of a hold while another node reports the UAV, too
_ZONE = 'zone'


@dataclass(frozen=True, slots=True)
class HoldRequest:
    """A hold, or its end."""

    source: str  # `operator`, `separation`, `zone` or SHARED_ID; the last of each counts
    hold: bool  # or go on
    reason: str = ''  # for users


class HoldRule:
    """Two rules of the executor: `hold` comes before transfers, `stay` before the mission.

    Args:
        sender, telemetry, watch, profile, onboard: of the vehicle.
        update_mission: rule that transfers its list.
        notes: for the log.

    Arguments of methods:
        request: a hold, or its end.
        now: steady time [s].
    """

    def __init__(self, sender: CommandSender, telemetry: Telemetry, watch: AuthorityWatch,
                 profile: Profile, onboard: OnboardMission,
                 update_mission: Callable[[float], NextMessages],
                 notes: deque[OperatorNote]) -> None:
        self._sender, self._telemetry, self._watch = sender, telemetry, watch
        self._profile, self._notes = profile, notes
        self._onboard, self._update_list = onboard, update_mission
        self._requests: dict[str, HoldRequest] = {}  # in force, by source
        self._ordered_at: Point | None = None  # [m] where it was when the hold was ordered
        self._reported = False  # where it came to rest
        self._logged = ''  # why HOLD is not sent
        self._list: TaskList | None = None
        self._known: list[ThreatZone] = []  # without their margins, when that list came
        self._zone_ahead = ZoneAhead(telemetry, onboard, profile)
        onboard.upload.may_end = self._zone_ahead.may_take_upload
        onboard.upload.may_retry = lambda: not self.for_shared_id
        sender.may_start_mission = lambda: self._requests.keys() <= {_ZONE}

    @property
    def reason(self) -> str:
        """Who holds it, and why; '' where nobody does."""
        return '; '.join(f'{each.source}: {each.reason}' for each in self._requests.values())

    @property
    def for_shared_id(self) -> bool:
        """Whether it holds as another node reports its UAV, too."""
        return SHARED_ID in self._requests

    @property
    def held_by_others(self) -> str:
        """Who else holds a UAV whose id is shared, other than a zone ahead; '': nobody."""
        others = sorted(self._requests.keys() - {SHARED_ID, _ZONE})
        return f'it is held by {" and ".join(others)}' if others else ''

    def request(self, request: HoldRequest, now: float) -> None:
        """Take a request, which replaces that of the same source."""
        before = self._requests.get(request.source)
        if not request.hold:
            self._end(request.source)
            return
        self._requests[request.source] = request
        if before is None:
            self._ordered_at = self._telemetry.position if self._telemetry.has_position else None
            self._reported = False
            self._sender.clear_backoff(now)
            self._notes.append(OperatorNote('info', f'is to hold: {self.reason}'))

    def _end(self, source: str) -> None:
        if self._requests.pop(source, None) is None:
            return
        if not self._requests:
            self._notes.append(OperatorNote('info', f'goes on: {source} ended its hold'))
            self._logged = ''
            if self._telemetry.airborne and self._telemetry.mode is ModeFunction.HOLD:
                self._sender.must_start = True

    def hold(self, now: float) -> NextMessages:
        """Set HOLD before anything else is sent; None: it holds, or is not to."""
        self._guard(now)
        if not self._requests or not self._telemetry.airborne or self._sender.climbing:
            return None
        if not self.at_zone:
            self._watch.replacing_since = None  # it holds for longer than an upload takes
        elif self._watch.replacing_since is None and self._watch.authority.held:
            self._watch.replacing_since = now
        if not self._watch.authority.held:
            self._log(f'hold is not sent: authority is {self._watch.authority.state.name}: '
                      f'{self._watch.authority.why}')
            return None
        if ModeFunction.HOLD not in self._profile.set_mode:
            self._log('hold is not sent: its autopilot has no such mode')
            return None
        self._logged = ''
        if self._telemetry.mode is ModeFunction.HOLD:
            self._report_rest()
            return None
        if self._sender.backing_off(now):
            return []
        return self._sender.set_mode(ModeFunction.HOLD, now)

    def _note_zones(self) -> None:
        """Note the zones that were known when the list came: it was made for them."""
        tasks = self._onboard.tasks
        if tasks != self._list:
            self._list = tasks
            self._known = [replace(zone, margin=0.0) for zone in self._onboard.list.zones()]

    @property
    def at_zone(self) -> bool:
        """Whether only a zone on its way holds it."""
        return self._requests.keys() == {_ZONE}

    def _guard(self, now: float) -> None:
        """Hold before a zone to which the mission on board leads, until a list is around it."""
        self._note_zones()
        held, mode = _ZONE in self._requests, self._telemetry.mode
        may_fly = self._telemetry.airborne and self._watch.authority.held and (
            mode is ModeFunction.MISSION or (held and mode is ModeFunction.HOLD))
        zone = self._zone_ahead.on_board(held) if may_fly else None
        if zone is None or (zone in self._known and self._onboard.verified()):
            self._end(_ZONE)
        elif not held and ModeFunction.HOLD in self._profile.set_mode and not (
                self._profile.rules.loiters):
            self.request(HoldRequest(_ZONE, True, f'{zone.id} is ahead on the way that it has on '
                                     'board'), now)

    def stay(self, now: float) -> NextMessages:
        """Let the list be transferred while it holds, but no more; None: it is not to hold."""
        if not self._requests or self._sender.climbing:
            return None
        stops = self._onboard.remaining().stops
        if self.at_zone and not stops:
            return None  # it holds, waits or returns by its list
        out = self.update_mission(now) if stops else None
        if out is not None:
            return out
        return self._sender.wait_for(f'the end of its hold ({self.reason})')

    def update_mission(self, now: float) -> NextMessages:
        """Transfer the list, but not while its id is shared: it may be that of the other one."""
        return None if self.for_shared_id else self._update_list(now)

    def _log(self, text: str) -> None:
        if text != self._logged:
            self._logged = text
            self._notes.append(OperatorNote('warning', text))

    def _report_rest(self) -> None:
        """Log, once, where it came to rest."""
        telemetry = self._telemetry
        if self._reported or not telemetry.has_position or telemetry.speed >= REST_SPEED:
            return
        self._reported = True
        x, y, z = telemetry.position
        far = '' if self._ordered_at is None else (
            f', {math.dist(self._ordered_at, telemetry.position):.0f} m from where it was ordered')
        self._notes.append(OperatorNote(
            'info', f'holds at ({x:.0f}, {y:.0f}, {z:.0f}) m{far} ({self.reason})'))
