# SPDX-License-Identifier: Apache-2.0
"""The list on board and flown: upload, jump or swap, then mission mode at the right item."""
from __future__ import annotations

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


class ListExecution:
    """Brings a list with tasks on board, and has it flown."""

    def __init__(
        self,
        sender: CommandSender,
        telemetry: Telemetry,
        onboard: OnboardMission,
        watch: AuthorityWatch,
        profile: Profile,
        ending: EndOfList,
        texts: StatusTextLog,
    ) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._watch, self._profile, self._ending, self._texts = watch, profile, ending, texts
        self._service = UploadHold(onboard, telemetry, profile)
        self._aimed = False  # its current item is set by us since it flew last

    def bring(self, now: float) -> NextMessages:
        """The list on board, by the cheapest way."""
        onboard, telemetry, sender = self._onboard, self._telemetry, self._sender
        found = onboard.change()
        if found.kind is DiffKind.KEEP:
            onboard.adopt(found, now)
            return None
        if sender.backing_off(now):
            return []
        if not telemetry.past_boot:
            return sender.wait_for('the autopilot to start')
        if self._chosen_by_another():
            return sender.wait_for('the item that another station has chosen')
        if found.kind is DiffKind.JUMP:
            return self._jump(found, now)
        if onboard.list.leg.start_unknown:
            return sender.wait_for('a position')
        if self._service.lasts(now):
            sender.waits_for = 'the end of the service'
            return []
        if found.kind is DiffKind.REPLACE and telemetry.airborne and not telemetry.good_link(now):
            return sender.wait_for('a link without gaps for 10 s')
        if (found.kind is DiffKind.REPLACE and not self._profile.atomic and telemetry.airborne
                and telemetry.mode is ModeFunction.MISSION):
            sender.must_start, self._watch.swap_at = True, now
            return sender.set_mode(ModeFunction.HOLD, now)
        return onboard.begin_upload(found, now)

    def _chosen_by_another(self) -> bool:
        """Somebody has set the current item: it is flown, and what was left out later."""
        progress, item = self._onboard.progress, self._onboard.progress.active
        return (progress.set_by_other is not None and progress.set_by_other == progress.current
                and self._telemetry.airborne
                and self._telemetry.mode is ModeFunction.MISSION and item is not None
                and any(item.task == stop.task.id for stop in self._onboard.remaining().stops))

    def _jump(self, found: MissionDiff, now: float) -> NextMessages:
        onboard = self._onboard
        if not self._watch.authority.held:
            return self._sender.wait_for('authority to set the current item')
        tasks = onboard.tasks

        def done(t: float) -> None:
            onboard.progress.retag(found.items)
            onboard.progress.note_set_current(found.start, t)
            onboard.must_jump, self._aimed = None, True
            onboard.adopt(found, t, tasks)

        onboard.progress.begin_set_current(found.start)
        return self._sender.set_current(found.start + onboard.own, now, done)

    def fly(self, now: float) -> NextMessages:
        """In mission mode, at the right item."""
        sender, onboard = self._sender, self._onboard
        in_mission = self._telemetry.mode is ModeFunction.MISSION
        flying = in_mission and not sender.must_start
        self._aimed = self._aimed and not flying
        if flying and self._stands():
            onboard.must_jump = onboard.progress.current
            sender.must_start = True
            # in mission mode it would start again at the first item
            return sender.set_mode(ModeFunction.HOLD, now)
        if flying and onboard.must_jump is None:
            onboard.progress.note_mission_mode()
            self._ending.swap_ended()
            return sender.satisfied()
        if sender.mission_refused and not in_mission:
            onboard.list.infeasible(self._texts.last or sender.mission_refused)
            sender.mission_refused = ''
            return []
        if sender.backing_off(now):
            return []
        if self._telemetry.mode is ModeFunction.TAKEOFF:
            return sender.wait_for('the end of the take-off')
        if not (flying or self._aimed or self._profile.atomic) and onboard.must_jump is None:
            # ArduPilot resumes after the item that it flew last
            onboard.must_jump = onboard.progress.current
        if onboard.must_jump is not None:
            return self._jump(
                MissionDiff(DiffKind.JUMP, onboard.progress.items, onboard.must_jump), now
            )
        return sender.set_mode(ModeFunction.MISSION, now)

    def _stands(self) -> bool:
        """ArduPilot has ended the mission that it had, and does not begin what was appended."""
        telemetry, progress = self._telemetry, self._onboard.progress
        return (not self._profile.atomic and telemetry.current is not None
                and telemetry.mission_state == d.MISSION_STATE_COMPLETE
                and not progress.finished and progress.active is not None
                and telemetry.current_at > self._onboard.verified_at
                and telemetry.current - self._onboard.own < len(progress.items) - 1)
