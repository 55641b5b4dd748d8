# SPDX-License-Identifier: Apache-2.0
"""Messages of a vehicle for its mission: position, items reached, current item, status texts."""
from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.status_text_log import StatusTextLog
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote

_CHANGED = 'Auto mission changed'  # ArduPilot, in AUTO


class MissionMessages:
    """Passes messages on to the progress of the mission on board, and status texts to the rules.

    Args:
        onboard: the mission of the vehicle.
        telemetry: of the vehicle.
        watch: of its authority.
        sender: of commands; a busy one may be about to change the mission.
        atomic: whether a vehicle takes a mission as a whole (PX4).
        log: of status texts.
        notes: for the log, emptied by the caller.
        peer: the vehicle.
    """

    def __init__(self, onboard: OnboardMission, telemetry: Telemetry, watch: AuthorityWatch,
                 sender: CommandSender, atomic: bool, log: StatusTextLog,
                 notes: deque[OperatorNote], peer: Peer) -> None:
        self._peer, self._doubted = peer, False  # the mission: another may have changed it
        self._onboard, self._telemetry, self._watch = onboard, telemetry, watch
        self._sender, self._atomic = sender, atomic
        self._status_text_log, self._notes = log, notes

    def receive(self, message: Message, newest: bool, now: float) -> None:
        """Take a message of the vehicle that its telemetry has processed.

        Args:
            message: as received.
            newest: whether none of its type that was sent later has come before.
            now: steady time [s].
        """
        kind, progress, own = message.get_type(), self._onboard.progress, self._onboard.own
        flying = self._telemetry.in_mission
        if kind == 'GLOBAL_POSITION_INT':
            self._position(message, newest, now)
        elif kind == 'MISSION_ITEM_REACHED':
            self._onboard.reached(message.seq - own, now, self._telemetry.frame)
        elif kind == 'MISSION_CURRENT' and newest and (
                self._onboard.is_of_known_mission(message, now, flying)):
            seq = max(0, message.seq - own)
            self._onboard.resume.note_current(seq, now, self._telemetry.frame)
            if self._onboard.item_to_set.seq is None:  # else seq is of the previous mission
                progress.note_current(seq, now, flying, self._telemetry.frame,
                                      self._telemetry.mission.restarted,
                                      self._telemetry.showed_mission)
            elif flying:
                self._onboard.item_to_set.note_flown(seq, now)
            ended = self._telemetry.mission.ended and self._onboard.item_to_set.seq is None
            may_have_ended = flying or ended if not self._atomic else (  # PX4: take-off too
                self._telemetry.airborne_since_mission and progress.may_have_ended_unseen(seq))
            if may_have_ended and message.mission_state == d.MISSION_STATE_COMPLETE:
                progress.note_mission_complete(seq, now, self._telemetry.frame)
            if not self._sender.busy and not self._onboard.latest_upload.is_open:
                self._onboard.watch(message, now)
        elif kind == 'STATUSTEXT':
            self._watch.receive_status_text(message, now)
            self._sender.note_arming_refusal(str(message.text))
            self._onboard.list.horizon.note(str(message.text))
            if str(message.text).startswith(_CHANGED) and not (
                    self._sender.busy or self._onboard.latest_upload.is_open):
                self._onboard.mission.note_changed(now)
            self._notes += filter(None, (self._status_text_log.receive(message, now),))
        self._doubted = (self._doubted or self._peer.changed_by_another(message)
                         or progress.take_contradicted())
        if self._doubted and not (self._sender.busy or self._onboard.latest_upload.is_open):
            self._doubted = not self._onboard.mission.note_changed(now)

    def _position(self, message: Message, newest: bool, now: float) -> None:
        if self._telemetry.has_position:
            position, velocity = self._telemetry.enu_of(message)
            self._onboard.progress.add_position(
                PositionSample(message.time_boot_ms * 1e-3, position, velocity), newest, now,
                self._telemetry.frame)
            if self._telemetry.grounded:  # its estimate settles
                self._onboard.progress.positions.end_doubt()
