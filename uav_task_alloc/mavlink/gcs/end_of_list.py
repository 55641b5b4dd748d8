# SPDX-License-Identifier: Apache-2.0
"""Hold, wait or return: with an empty list; and when an upload of a mission takes too long."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.onboard_mission import LATE_REACHED, OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.items import TaskList, all_alike
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import ThreatZone

_MAX_HOLD = 30.0  # [s] of a hold for an upload


class EndOfList:
    """Holds a vehicle, or returns it home if its path home is clear of zones."""

    def __init__(
        self,
        sender: CommandSender,
        telemetry: Telemetry,
        onboard: OnboardMission,
        watch: AuthorityWatch,
        policy: Callable[[], Policy],
        notes: deque[OperatorNote],
        profile: Profile,
    ) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._watch, self._policy, self._notes, self._profile = watch, policy, notes, profile
        self.going_home = False  # by a list without tasks
        self.alarm = ''  # condition that requires action by a human; '': none
        # the last item was set as current: its seq on the wire, since when [s], acknowledged
        self._end_set: tuple[int, float, bool] | None = None
        # the list that was not flown for a zone, with the zones then
        self._given_up: tuple[TaskList | None, tuple[ThreatZone, ...]] | None = None
        self.held_at_zone: Callable[[], bool] = lambda: False  # set by the executor
        self._stopped_at = ''  # the zone before which its return was ended
        self._zone_found: tuple[object, ThreatZone | None] = None, None
        self._stays = False  # it was, since the mission was reported as complete

    def end_hold(self) -> None:
        """The vehicle flies its list: the hold for an upload is over."""
        self._watch.replacing_since, self.alarm = None, ''

    def stop_return(self, now: float) -> NextMessages:
        """Hold a vehicle that returns by our command before a zone that has come into its way.

        Its list then decides, as where it holds: another way, or a hold until the zone is gone.
        """
        telemetry = self._telemetry
        if telemetry.mode is not ModeFunction.RETURN or not telemetry.airborne or not (
                self._watch.authority.held and ModeFunction.HOLD in self._profile.set_mode):
            return None
        zone = self._zone_on_return()
        if zone is None:
            self._stopped_at = ''
            return None
        if self._stopped_at != zone.id:
            self._stopped_at = zone.id
            self._notes.append(OperatorNote('warning', f'zone {zone.id} has come into its way '
                                            'home: holds'))
        return [] if self._sender.backing_off(now) else self._sender.set_mode(
            ModeFunction.HOLD, now)

    def _zone_on_return(self) -> ThreatZone | None:
        """The zone that its return is about to enter; zones count without their margins."""
        telemetry, way_home = self._telemetry, self._onboard.list.way_home
        if telemetry.home is None or not telemetry.has_position:
            return None
        key = telemetry.position_at, way_home.key
        if self._zone_found[0] != key:
            self._zone_found = key, way_home.zone_before(telemetry.position, telemetry.home)
        return self._zone_found[1]

    def held_too_long(self, now: float) -> NextMessages:
        """Return home after a too long hold for an upload; stay if a zone is across the path."""
        since = self._watch.replacing_since
        if since is None or now - since <= _MAX_HOLD or not self._watch.authority.held:
            return None
        self._watch.replacing_since = None
        awaited = 'an upload that does not end'
        if self.held_at_zone() and self._onboard.verified():  # the zone is newer
            awaited, self._given_up = 'a list around a zone', self._list_and_zones()
        blocked = self.blocked_home()
        if blocked:
            self.alarm = f'held for {awaited}, and {blocked}: stays'
            self._notes.append(OperatorNote('error', self.alarm))
            return None
        text = f'held for {_MAX_HOLD:g} s for {awaited}: returns'
        self._notes.append(OperatorNote('error', text))
        return self._sender.set_mode(ModeFunction.RETURN, now)

    def _list_and_zones(self) -> tuple[TaskList | None, tuple[ThreatZone, ...]]:
        return self._onboard.tasks, self._policy().no_fly_zones

    def given_up(self, now: float) -> NextMessages:
        """Do not fly a list again from which a zone made it return, while both are the same."""
        if self._given_up is None or self._given_up != self._list_and_zones():
            self._given_up = None
            return None
        return self._sender.wait('another list: a zone is across this one')

    def empty(self, now: float) -> NextMessages:
        """With an empty list, hold or return, and keep the onboard mission; None: it has tasks."""
        onboard, telemetry, sender = self._onboard, self._telemetry, self._sender
        end, tasks = onboard.list.items_and_list()  # without refused tasks
        self.going_home = False
        if tasks.stops:
            return None
        rest = (onboard.held or ())[onboard.progress.current or 0:]
        if not onboard.progress.pending:
            onboard.revision = tasks.revision
        flying = telemetry.mode is ModeFunction.MISSION and not onboard.progress.finished
        if flying and end and rest and all_alike(end[-len(rest):], rest):
            self.going_home = tasks.returns
            self.end_hold()
            return sender.satisfied()
        if self._just_landed(now):
            return []
        if onboard.progress.pending or not telemetry.airborne or sender.backing_off(now) or (
                not self._watch.authority.held):
            return []
        return self._end(tasks, flying, now)

    def _just_landed(self, now: float) -> bool:
        """Whether the mission has ended with a landing: `landed_state` is sent once a second."""
        progress = self._onboard.progress
        return progress.finished and progress.returns and (
            now - progress.ended_at <= LATE_REACHED)

    def _end(self, tasks: TaskList, flying: bool, now: float) -> NextMessages:
        telemetry = self._telemetry
        returns = tasks.returns or self._policy().when_empty == 'return'
        if tasks.end_via and tasks.returns and telemetry.mode is not ModeFunction.RETURN:
            self.going_home = True
            return None  # the straight path home crosses a zone: fly the list with the detour
        if tasks.waits and self._policy().when_empty == 'hold':
            return None  # fly to where it waits for tasks
        blocked = self.blocked_home() if returns else ''
        if blocked and telemetry.mode is not ModeFunction.RETURN:
            returns = False
            self._sender.wait(f'a path home: {blocked}')
        if flying or (returns and telemetry.mode in (ModeFunction.HOLD, ModeFunction.MISSION)):
            mode = ModeFunction.RETURN if returns else ModeFunction.HOLD
            self._watch.replacing_since = None
            return self._sender.set_mode(mode, now)
        return self._stay_at_end(now)

    def _stay_at_end(self, now: float) -> NextMessages:
        """Set the last item of a complete mission of ArduPilot as current.

        Else it begins again at its first item whenever its autopilot enters mission mode, as at
        the end of an avoidance, when nothing may be sent. It is complete until then.
        """
        telemetry, progress = self._telemetry, self._onboard.progress
        tasks, seq = self._onboard.tasks, len(progress.items) - 1 + self._onboard.own
        complete = telemetry.mission.state == d.MISSION_STATE_COMPLETE
        self._stays = self._stays and complete
        if self._stays or not complete or self._profile.atomic or (
                telemetry.mode is not ModeFunction.MISSION or telemetry.mission.current != seq
                or not progress.finished or progress.returns or tasks is None or tasks.stops):
            return []

        def done(t: float) -> None:
            self._end_set = seq, now, True

        self._end_set, self._stays = (seq, now, False), True
        return self._sender.set_current(seq, now, done)

    def may_set_end(self, now: float) -> bool:
        """Whether a command to set the last item as current may still be on the way."""
        if self._end_set is None:
            return False
        seq, since, acknowledged = self._end_set
        sent_at = self._sender.current_set_at.get(seq, -math.inf)
        return now - sent_at < MAX_MESSAGE_DELAY and not (acknowledged and sent_at == since)

    def blocked_home(self) -> str:
        """Why it must not fly straight home; '': it may."""
        telemetry, zones = self._telemetry, self._policy().no_fly_zones
        if telemetry.home is None or not telemetry.has_position:
            return 'its path home is not known' if zones else ''
        zone = self._onboard.list.way_home.zone_on_return(telemetry.position, telemetry.home)
        return f'zone {zone.id} is across its path home' if zone else ''
