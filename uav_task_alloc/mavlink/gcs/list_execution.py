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
        helm: CommandSender,
        telemetry: Telemetry,
        board: OnboardMission,
        watch: AuthorityWatch,
        profile: Profile,
        ending: EndOfList,
        texts: StatusTextLog,
    ) -> None:
        self._helm, self._telemetry, self._board = helm, telemetry, board
        self._watch, self._profile, self._ending, self._texts = watch, profile, ending, texts
        self._service = UploadHold(board, telemetry, profile)
        self._aimed = False  # its current item is set by us since it flew last

    def bring(self, now: float) -> NextMessages:
        """The list on board, by the cheapest way."""
        board, telemetry, helm = self._board, self._telemetry, self._helm
        found = board.change()
        if found.kind is DiffKind.KEEP:
            board.adopt(found, now)
            return None
        if helm.resting(now):
            return []
        if not telemetry.past_boot:
            return helm.wait_for('the autopilot to start')
        if self._chosen_by_another():
            return helm.wait_for('the item that another station has chosen')
        if found.kind is DiffKind.JUMP:
            return self._jump(found, now)
        if board.list.leg.unknown:
            return helm.wait_for('a position')
        if self._service.lasts(now):
            helm.waits_for = 'the end of the service'
            return []
        if found.kind is DiffKind.SWAP and telemetry.airborne and not telemetry.good_link(now):
            return helm.wait_for('a link without gaps for 10 s')
        if (found.kind is DiffKind.SWAP and not self._profile.atomic and telemetry.airborne
                and telemetry.flight is ModeFunction.MISSION):
            helm.must_start, self._watch.swap_at = True, now
            return helm.set_mode(ModeFunction.HOLD, now)
        return board.begin_upload(found, now)

    def _chosen_by_another(self) -> bool:
        """Somebody has set the current item: it is flown, and what was left out later."""
        progress, item = self._board.progress, self._board.progress.active
        return (progress.chosen is not None and progress.chosen == progress.current
                and self._telemetry.airborne
                and self._telemetry.flight is ModeFunction.MISSION and item is not None
                and any(item.task == stop.task.id for stop in self._board.remaining().stops))

    def _jump(self, found: MissionDiff, now: float) -> NextMessages:
        board = self._board
        if not self._watch.authority.held:
            return self._helm.wait_for('authority to set the current item')
        tasks = board.tasks

        def done(t: float) -> None:
            board.progress.retag(found.items)
            board.progress.jumped(found.start, t)
            board.must_jump, self._aimed = None, True
            board.adopt(found, t, tasks)

        board.progress.asked(found.start)
        return self._helm.jump(found.start + board.own, now, done)

    def fly(self, now: float) -> NextMessages:
        """In mission mode, at the right item."""
        helm, board = self._helm, self._board
        in_mission = self._telemetry.flight is ModeFunction.MISSION
        flying = in_mission and not helm.must_start
        self._aimed = self._aimed and not flying
        if flying and self._stands():
            board.must_jump = board.progress.current
            helm.must_start = True
            return helm.set_mode(ModeFunction.HOLD, now)  # it would begin at the first item again
        if flying and board.must_jump is None:
            board.progress.started()
            self._ending.swap_ended()
            return helm.content()
        if helm.refused and not in_mission:
            board.list.infeasible(self._texts.last or helm.refused)
            helm.refused = ''
            return []
        if helm.resting(now):
            return []
        if self._telemetry.flight is ModeFunction.TAKEOFF:
            return helm.wait_for('the end of the take-off')
        if not (flying or self._aimed or self._profile.atomic) and board.must_jump is None:
            board.must_jump = board.progress.current  # ArduPilot resumes after what it flew last
        if board.must_jump is not None:
            return self._jump(
                MissionDiff(DiffKind.JUMP, board.progress.items, board.must_jump), now
            )
        return helm.set_mode(ModeFunction.MISSION, now)

    def _stands(self) -> bool:
        """ArduPilot has ended the mission that it had, and does not begin what was appended."""
        telemetry, progress = self._telemetry, self._board.progress
        return (not self._profile.atomic and telemetry.current is not None
                and telemetry.mission_state == d.MISSION_STATE_COMPLETE
                and not progress.finished and progress.active is not None
                and telemetry.current_at > self._board.verified_at
                and telemetry.current - self._board.own < len(progress.items) - 1)
