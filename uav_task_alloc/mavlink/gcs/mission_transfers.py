# SPDX-License-Identifier: Apache-2.0
"""Rules: continue an upload, read an unknown mission, complete what was flown meanwhile."""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.end_of_list import EndOfList
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.upload_states import UploadState


class MissionTransfers:
    """Rules of MissionExecutor; `now` is steady time [s].

    Args:
        sender: of commands.
        telemetry: of the vehicle.
        onboard: its mission.
        authority: over the vehicle.
        end_of_list: what it does without tasks.
    """

    def __init__(self, sender: CommandSender, telemetry: Telemetry, onboard: OnboardMission,
                 authority: Authority, end_of_list: EndOfList) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._authority, self._end_of_list = authority, end_of_list

    def upload(self, now: float) -> NextMessages:
        """Continue an upload; set the current item past tasks flown in the meantime."""
        onboard = self._onboard
        if onboard.transfer_failed:
            onboard.transfer_failed = False
            self._sender.fail(now)
        if not onboard.upload.busy:
            return None
        seq = onboard.next_item()
        if seq is not None and self._authority.held:
            onboard.progress.begin_set_current(seq)
            return self._sender.set_current(
                seq + onboard.own, now, lambda t: onboard.item_to_set.note_set(seq, t))
        self._sender.waits_for = 'its upload'
        if (onboard.upload.state in (UploadState.BACKOFF, UploadState.DRAINING)
                and onboard.latest_upload.is_outdated(onboard.tasks)
                and onboard.held is not None and onboard.wanted()
                and not onboard.upload.may_be_stored):
            return onboard.begin_upload(onboard.diff(), now)
        return self._end_of_list.held_too_long(now) or []

    def read(self, now: float) -> NextMessages:
        """Read the onboard mission where it is unknown."""
        if self._onboard.held is not None:
            return None
        if not self._telemetry.past_boot:
            return self._sender.wait_for('the autopilot to start')
        if self._sender.backing_off(now):
            return self._end_of_list.held_too_long(now) or []
        self._sender.waits_for = 'a readback'
        return self._onboard.upload.read(now)

    def resume(self, now: float) -> NextMessages:
        """After a restart of the bridge, complete the tasks flown in the meantime."""
        onboard = self._onboard
        assert onboard.tasks is not None
        if onboard.resume.awaits_position(onboard.held or (), onboard.mission.verified_at, now):
            return []  # its current item is not known yet
        onboard.resume.locate(onboard.held or (), onboard.tasks, now)
        onboard.complete_flown(now)
        return None
