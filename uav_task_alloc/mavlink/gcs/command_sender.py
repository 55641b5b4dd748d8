# SPDX-License-Identifier: Apache-2.0
"""Commands to one vehicle, one after the other: modes, arming, take-off, the current item.

Whether one may be sent is not decided here: `authority` is asked at every send.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.command import Command, CommandResult
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote

ARM = 'arm'
ARM_TRIES = 120  # one a second: a position estimate may take that long
_CLIMB = 120.0  # [s] for a take-off
ENOUGH = 0.9  # of the height asked for
RETRY, RETRIES = 10.0, 5  # [s] after a failure that may pass
SLOW_RETRY = 60.0  # [s] after more of them, without end
REFUSAL = 5.0  # [s] that an arming is tried before its refusal is told: the reason may follow

Then = Callable[[float], None]
NextMessages = list[Message] | None  # None: satisfied


class CommandSender:
    """One command at a time until it is done; what was commanded last."""

    def __init__(self, peer: Peer, profile: Profile, telemetry: Telemetry) -> None:
        self._peer, self._profile, self._telemetry = peer, profile, telemetry
        self.notes: deque[OperatorNote] = deque()
        self.waits_for = ''  # why nothing is done, for a human
        self.commanded: ModeFunction | None = None  # by us, last
        self.must_start = False  # in the air and held by us
        self.armed_here = False  # by us, on the ground: it takes off next, or is disarmed
        self.climbing = False  # by our take-off
        self.refused = ''  # why the mission mode was refused, at the last try
        self.refusal = ''  # why it does not arm, in the vehicle's words
        self._command: Command | None = None
        self._then: Then | None = None
        self._climb_until = math.inf
        self._said = ''
        self._told: dict[str, str] = {}  # why a command failed, as told last
        self._arming_since: float | None = None  # [s] it is tried, without success
        self._retry_at, self._retries = -math.inf, 0

    @property
    def busy(self) -> bool:
        return self._command is not None

    @property
    def failing(self) -> bool:
        """It was tried often enough to say that it does not work."""
        return self._retries > RETRIES

    def drop(self) -> None:
        """Somebody else has the vehicle: nothing that is under way is repeated."""
        self._command = self._arming_since = None
        self.climbing = self.must_start = self.armed_here = False
        self.commanded, self.refused = None, ''

    def reset(self, now: float) -> None:
        """The vehicle was restarted."""
        self.drop()
        self.clear_backoff(now)

    def clear_backoff(self, now: float) -> None:
        """A new list, a new link: what failed may be tried again."""
        self._retry_at, self._retries = now, 0

    def fail(self, now: float) -> None:
        """Wait before the next try, longer where many have failed."""
        self._retries += 1
        self._retry_at = now + (RETRY if self._retries <= RETRIES else SLOW_RETRY)

    def backing_off(self, now: float) -> bool:
        """After a failure, before the next try."""
        if now < self._retry_at:
            self.waits_for = 'the next try'
        return now < self._retry_at

    def wait(self, what: str) -> list[Message]:
        """Do nothing, and say once why."""
        if self._said != what:
            self.notes.append(OperatorNote('warning', f'waits for {what}'))
        self.waits_for = self._said = what
        return []

    def wait_for(self, what: str) -> list[Message]:
        """Do nothing; why is said in diagnostics, or was told by who decided it."""
        self.waits_for = what
        return []

    def satisfied(self) -> list[Message]:
        """All is as it should be."""
        self.waits_for = self._said = ''
        self._retries = 0
        return []

    def receive(self, message: Message) -> None:
        """Take a COMMAND_ACK; one to another station says nothing of our command."""
        if self._command and self._peer.is_from_vehicle(message):
            self._command.receive(message)

    def note_refusal(self, text: str) -> None:
        """STATUSTEXT: why the vehicle does not arm, where that is what is tried."""
        prefix, _, reason = text.partition(': ')
        if prefix in ('Arm', 'PreArm') and reason:
            self.refusal = reason

    def finish(self, now: float) -> NextMessages:
        """The command under way."""
        command = self._command
        if command is None:
            return None
        out = command.step(now)
        if command.answer is CommandResult.OPEN:
            self.waits_for = command.name + self._tell_arming(command, now)
            return out
        self._command, then = None, self._then
        if command.name == ARM and command.answer is not CommandResult.FAILED:
            self._arming_since = None
        if command.answer is CommandResult.DONE and then:
            self._told.pop(command.name, None)
            then(now)
        elif command.answer is CommandResult.FAILED:
            self._tell_failed(command)
            if command.name == _mode_name(ModeFunction.MISSION) and 'refused' in command.reason:
                self.refused = command.reason
            self.fail(now)
        return None

    def _tell_failed(self, command: Command) -> None:
        """Once until the reason changes; why it does not arm was told before."""
        if command.name == ARM and ARM in self._told:
            return
        if self._told.get(command.name) != command.reason:
            self.notes.append(OperatorNote('error', f'{command.name}: {command.reason}'))
        self._told[command.name] = command.reason

    def _tell_arming(self, command: Command, now: float) -> str:
        """Why it does not arm, once until the reason changes, and for how long it was tried."""
        tried = now - (now if self._arming_since is None else self._arming_since)
        if command.name != ARM or not command.reason or tried < REFUSAL:
            return ''
        why = self.refusal or self._telemetry.unhealthy or command.reason
        text = f': refused for {tried:.0f} s: {why}'
        if self._told.get(ARM) != why:
            self._told[ARM] = why
            self.notes.append(OperatorNote('warning', ARM + text))
        return text

    def do(self, command: Command, now: float, then: Then) -> list[Message]:
        """Begin a command; `then` is called once it is done."""
        self._command, self._then = command, then
        self.waits_for, self.refused = command.name, ''
        return command.step(now)

    def set_mode(self, flight: ModeFunction, now: float) -> list[Message]:
        """Into a mode, seen by the ACK or by a heartbeat."""
        telemetry = self._telemetry

        def done(t: float) -> None:
            telemetry.mode = flight  # a heartbeat sent before may say otherwise for a moment
            if flight is ModeFunction.MISSION:
                self.must_start = False

        self.commanded = flight
        return self.do(Command(_mode_name(flight), self._profile.mode_command(
            self._peer, flight), lambda: telemetry.mode is flight), now, done)

    def jump(self, seq: int, now: float, then: Then) -> list[Message]:
        """To an item: by command, and where that is unknown the old way."""
        telemetry, asked = self._telemetry, now

        def seen() -> bool:
            return telemetry.current == seq and telemetry.current_at >= asked

        old_way = Command('set current', self._peer.set_current(seq), seen)
        new_way = Command('set current', self._peer.command(
            d.MAV_CMD_DO_SET_MISSION_CURRENT, seq), seen, tries=2, fallback=old_way)
        return self.do(new_way if self._profile.jump_command else old_way, now, then)

    def rise(self, height: float, wanted: Callable[[], bool], now: float) -> NextMessages:
        """Off the ground to `height` [m]; each try asks whether that is still wanted."""
        telemetry = self._telemetry
        if telemetry.airborne and not self.climbing:
            return None
        if self.backing_off(now):
            return []
        if self.climbing:
            return self._climb(height, now)
        if not telemetry.grounded or not telemetry.has_position:
            self.waits_for = 'a position' if telemetry.grounded else 'its landed state'
            return []
        if telemetry.mode is not ModeFunction.HOLD and not self._profile.amsl_takeoff and (
                ModeFunction.HOLD in self._profile.set_mode):
            return self.set_mode(ModeFunction.HOLD, now)  # ArduPilot arms and climbs in GUIDED
        if not telemetry.armed:
            self.armed_here = False
            arm = self._peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
            if self._arming_since is None:
                self._arming_since, self.refusal = now, ''
            return self.do(Command(ARM, arm, lambda: telemetry.armed, tries=ARM_TRIES,
                                   patient=True, wanted=wanted), now, self._armed)
        if not self.armed_here:
            return self.wait_for('it to disarm: it was armed by another, or has just landed')
        ground = telemetry.altitude - (
            0.0 if math.isnan(telemetry.height) else telemetry.height)
        up = self._profile.takeoff_command(self._peer, height, ground)
        return self.do(Command('take off', up, lambda: telemetry.mode is ModeFunction.TAKEOFF,
                               wanted=wanted), now, self._took_off)

    def disarm(self, now: float) -> list[Message]:
        """On the ground, where we armed it and nothing is to be flown any more."""
        self.armed_here = False
        off = self._peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
        return self.do(Command('disarm', off, lambda: not self._telemetry.armed), now,
                       lambda t: None)

    def _armed(self, now: float) -> None:
        self._telemetry.armed = self.armed_here = True

    def _took_off(self, now: float) -> None:
        self.climbing, self._climb_until = True, now + _CLIMB
        self.armed_here = False
        self.commanded = ModeFunction.TAKEOFF

    def _climb(self, height: float, now: float) -> NextMessages:
        if self._telemetry.height >= ENOUGH * height:
            self.climbing, self.must_start = False, True
            return None
        self.waits_for = 'its height'
        if now > self._climb_until or not self._telemetry.armed:
            self.climbing = False
            self.fail(now)
        return []


def _mode_name(flight: ModeFunction) -> str:
    return f'mode {flight.value}'
