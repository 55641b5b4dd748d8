# SPDX-License-Identifier: Apache-2.0
"""Executes a list with tasks: upload or set current, then mission mode at the right item."""
from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.end_of_list import EndOfList
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.status_text_log import StatusTextLog
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.upload_hold import UploadHold
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.position_history import MAX_MESSAGE_DELAY

_REPORT_DELAY = 2.0  # [s] after a change of mode in which the current item is reported, as a rule


class ListExecution:
    """Updates the onboard mission to the list, and flies it."""

    def __init__(
        self,
        sender: CommandSender,
        telemetry: Telemetry,
        onboard: OnboardMission,
        watch: AuthorityWatch,
        profile: Profile,
        end_of_list: EndOfList,
        status_text_log: StatusTextLog,
    ) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._watch, self._profile, self._end_of_list = watch, profile, end_of_list
        self._status_text_log = status_text_log
        self._upload_hold = UploadHold(onboard, telemetry, profile)
        self._current_set = False  # the bridge has set the current item since the last flight
        self._refused_list: TaskList | None = None  # with which mission mode was refused last

    def update_mission(self, now: float) -> NextMessages:
        """Change the onboard mission to the list by the smallest transfer; None: no change."""
        onboard, telemetry, sender = self._onboard, self._telemetry, self._sender
        diff = onboard.diff()
        if diff.kind is DiffKind.KEEP:
            onboard.adopt(diff, now)
            return None
        if sender.backing_off(now):
            return []
        if not telemetry.past_boot:
            return sender.wait_for('the autopilot to start')
        if onboard.list.awaits_others:
            return sender.wait_for('the mission of the UAV that flew its tasks before')
        if onboard.list.awaits_speed:
            return sender.wait_for('its cruise speed (WPNAV_SPEED)')
        if self._end_of_list.may_set_end(now):  # it would take effect in the new mission
            return sender.wait_for('the end of a set-current that may be on the way')
        if self._chosen_by_another():
            return sender.wait_for('the item that another station has chosen')
        if diff.kind is DiffKind.JUMP:
            return self._set_current(diff, now)
        if onboard.list.leg.start_unknown:
            return sender.wait_for('a position')
        if self._upload_hold.active(now):
            sender.waits_for = 'the end of the service'
            return []
        if diff.kind is DiffKind.REPLACE and telemetry.airborne and not telemetry.link.good(now):
            return sender.wait_for('a link without gaps for 10 s')
        if (diff.kind is DiffKind.REPLACE and not self._profile.atomic and telemetry.airborne
                and telemetry.mode is ModeFunction.MISSION):
            sender.must_start, self._watch.replacing_since = True, now
            return sender.set_mode(ModeFunction.HOLD, now)
        if (diff.kind is DiffKind.REPLACE and not self._profile.atomic and telemetry.airborne
                and now - sender.mission_repeated_at < MAX_MESSAGE_DELAY):
            # its mission would be replaced while it flies it
            return sender.wait_for('the end of its mode commands that may be on the way')
        if telemetry.airborne and onboard.list.leave_out_detours():
            return self.update_mission(now)
        return onboard.begin_upload(diff, now)

    def _chosen_by_another(self) -> bool:
        """Whether another station has set the current item: it is flown first."""
        progress, item = self._onboard.progress, self._onboard.progress.active
        return (progress.set_by_other is not None and progress.set_by_other == progress.current
                and self._telemetry.airborne
                and self._telemetry.mode is ModeFunction.MISSION and item is not None
                and any(item.task == stop.task.id for stop in self._onboard.remaining().stops))

    def _set_current(self, diff: MissionDiff, now: float) -> NextMessages:
        onboard = self._onboard
        if not self._watch.authority.held:
            return self._sender.wait_for('authority to set the current item')
        tasks = onboard.tasks

        def done(t: float) -> None:
            onboard.progress.retag(diff.items)
            onboard.progress.note_set_current(diff.start, t)
            onboard.item_to_set.seq, self._current_set = None, True
            onboard.adopt(diff, t, tasks)

        onboard.progress.begin_set_current(diff.start)
        return self._sender.set_current(diff.start + onboard.own, now, done)

    def fly(self, now: float) -> NextMessages:
        """Fly the onboard mission from the right item; None is never returned."""
        sender, onboard = self._sender, self._onboard
        in_mission = self._telemetry.mode is ModeFunction.MISSION
        flying = in_mission and not sender.must_start
        self._current_set = self._current_set and not flying
        if flying and self._mission_ended():
            onboard.item_to_set.seq = onboard.progress.current
            sender.must_start = True
            # in mission mode it would start again at the first item
            return sender.set_mode(ModeFunction.HOLD, now)
        if flying and onboard.item_to_set.seq is None and self._set_back_late(now):
            onboard.item_to_set.seq = onboard.progress.current
        if flying and onboard.item_to_set.seq is None:
            self._refused_list = None
            onboard.progress.note_mission_mode()
            self._end_of_list.end_hold()
            return sender.satisfied()
        if sender.mission_refused and not in_mission:
            reason = self._status_text_log.last or sender.mission_refused
            sender.mission_refused = ''
            if self._refused_list is onboard.tasks and self._telemetry.airborne:
                onboard.list.infeasible(reason)
            self._refused_list = onboard.tasks  # one refusal may be of a vehicle that restarts
            return []
        if sender.backing_off(now):
            return []
        if self._telemetry.mode is ModeFunction.TAKEOFF:
            return sender.wait_for('the end of the take-off')
        if onboard.item_to_set.seq is None and not (flying or self._current_set) and (
                not self._profile.atomic or self._may_have_ended()):
            # ArduPilot resumes after the item that it flew last
            if not self._profile.atomic and self._current_unreported(now):
                return sender.wait_for('the current item since the hold')
            onboard.item_to_set.seq = onboard.progress.current
        if onboard.item_to_set.seq is not None:
            return self._set_current(
                MissionDiff(DiffKind.JUMP, onboard.progress.items, onboard.item_to_set.seq), now
            )
        return sender.set_mode(ModeFunction.MISSION, now)

    def _may_have_ended(self) -> bool:
        """Whether its mission may have ended in a silence (a PX4 that does not report that).

        A complete mission is not flown on, and Hold is entered again, until its item is set.
        """
        telemetry, progress = self._telemetry, self._onboard.progress
        last = len(progress.items) - 1
        return (telemetry.airborne and telemetry.mission.state == d.MISSION_STATE_UNKNOWN
                and telemetry.mission.current == progress.current == last)

    def _current_unreported(self, now: float) -> bool:
        """Whether no current item came since the mode has just changed in the air."""
        telemetry = self._telemetry
        return telemetry.airborne and telemetry.mission.current_at <= telemetry.mode_at and (
            now - telemetry.mode_at < _REPORT_DELAY)

    def _set_back_late(self, now: float) -> bool:
        """Whether a command of ours that a link delayed has set back the current item.

        A command and the report of what it changed may each be late. Only items of completed tasks
        are passed again.
        """
        progress, seq = self._onboard.progress, self._onboard.progress.reports.reported
        if seq is None or not progress.reports.went_back or progress.finished:
            return False
        sent_at = self._sender.current_set_at.get(seq + self._onboard.own, -math.inf)
        passed = [item.task for item in progress.items[seq:progress.current] if item.task]
        return now - sent_at < 2.0 * MAX_MESSAGE_DELAY and bool(passed) and all(
            task in progress.completed for task in passed)

    def _mission_ended(self) -> bool:
        """Whether ArduPilot has ended its mission and does not start the appended items.

        It does not either where the current item was set after the end.
        """
        telemetry, onboard, progress = self._telemetry, self._onboard, self._onboard.progress
        report = telemetry.mission
        if self._profile.atomic or report.current is None or progress.finished or (
                progress.active is None or report.current_at <= onboard.mission.verified_at):
            return False
        return (report.stopped and telemetry.airborne) or (
            report.state == d.MISSION_STATE_COMPLETE
            and report.current - onboard.own < len(progress.items) - 1)
