# SPDX-License-Identifier: Apache-2.0
"""Commands to one vehicle, one after the other: modes, arming, take-off, the current item."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.command import Answer, Command
from uav_task_alloc.mavlink.peer import Peer
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.mavlink.telemetry import Telemetry

ARM_TRIES = 120  # one a second: a position estimate may take that long
CLIMB = 120.0  # [s] for a take-off
ENOUGH = 0.9  # of the height asked for
RETRY, RETRIES = 10.0, 5  # [s] after a failure that may pass, until a new list or a new link

Then = Callable[[float], None]
Step = list[Message] | None  # None: satisfied


@dataclass(frozen=True, slots=True)
class Note:
    """Something a human should read."""

    level: str  # 'info', 'warning', 'error'
    text: str


class Helm:
    """One command at a time until it is done; what was commanded, and what a pilot did instead."""

    def __init__(self, peer: Peer, profile: Profile, telemetry: Telemetry) -> None:
        self._peer, self._profile, self._telemetry = peer, profile, telemetry
        self.notes: deque[Note] = deque()
        self.waits_for = ''  # why nothing is done, for a human
        self.commanded: Flight | None = None  # by us, last
        self.must_start = False  # in the air and held by us
        self.climbing = False  # by our take-off
        self.paused = False  # a pilot took it out of its mission
        self.refused = ''  # why the mission mode was refused, at the last try
        self._command: Command | None = None
        self._then: Then | None = None
        self._climb_until = math.inf
        self._said = ''
        self._retry_at, self._retries = -math.inf, 0

    @property
    def busy(self) -> bool:
        return self._command is not None

    def reset(self, now: float) -> None:
        """The vehicle was restarted."""
        self._command = None
        self.climbing = self.must_start = self.paused = False
        self.encourage(now)

    def encourage(self, now: float) -> None:
        """A new list, a new link: what failed may be tried again."""
        self._retry_at, self._retries = now, 0

    def fail(self, now: float) -> None:
        """Wait before the next try, of which there are not many."""
        self._retries += 1
        self._retry_at = now + RETRY if self._retries <= RETRIES else math.inf

    def resting(self, now: float) -> bool:
        """After a failure, before the next try."""
        if now < self._retry_at:
            self.waits_for = 'the next try'
        return now < self._retry_at

    def wait(self, what: str) -> list[Message]:
        """Do nothing, and say once why."""
        if self._said != what:
            self.notes.append(Note('warning', f'waits for {what}'))
        self.waits_for = self._said = what
        return []

    def content(self) -> list[Message]:
        """All is as it should be."""
        self.waits_for = self._said = ''
        return []

    def receive(self, message: Message) -> None:
        """Take a COMMAND_ACK."""
        if self._command:
            self._command.receive(message)

    def finish(self, now: float) -> Step:
        """The command under way."""
        command = self._command
        if command is None:
            return None
        out = command.step(now)
        if command.answer is Answer.OPEN:
            self.waits_for = command.name
            return out
        self._command, then = None, self._then
        if command.answer is Answer.DONE and then:
            then(now)
        elif command.answer is Answer.FAILED:
            self.notes.append(Note('error', f'{command.name}: {command.reason}'))
            if command.name == _mode_name(Flight.MISSION) and 'refused' in command.reason:
                self.refused = command.reason
            self.fail(now)
        return None

    def do(self, command: Command, now: float, then: Then) -> list[Message]:
        """Begin a command; `then` is called once it is done."""
        self._command, self._then = command, then
        self.waits_for, self.refused = command.name, ''
        return command.step(now)

    def set_mode(self, flight: Flight, now: float) -> list[Message]:
        """Into a mode, seen by the ACK or by a heartbeat."""
        telemetry = self._telemetry

        def done(t: float) -> None:
            telemetry.flight = flight  # a heartbeat sent before may say otherwise for a moment
            if flight is Flight.MISSION:
                self.must_start = False

        self.commanded = flight
        return self.do(Command(_mode_name(flight), self._profile.mode_command(
            self._peer, flight), lambda: telemetry.flight is flight), now, done)

    def jump(self, seq: int, now: float, then: Then) -> list[Message]:
        """To an item: by command, and where that is unknown the old way."""
        telemetry, asked = self._telemetry, now

        def seen() -> bool:
            return telemetry.current == seq and telemetry.current_at >= asked

        old_way = Command('set current', self._peer.set_current(seq), seen)
        new_way = Command('set current', self._peer.command(
            d.MAV_CMD_DO_SET_MISSION_CURRENT, seq), seen, tries=2, fallback=old_way)
        return self.do(new_way if self._profile.jump_command else old_way, now, then)

    def rise(self, height: float, allowed: bool, now: float) -> Step:
        """Off the ground to `height` [m], where that is ours to do."""
        telemetry = self._telemetry
        if telemetry.airborne and not self.climbing:
            return None
        if not allowed and not self.climbing:
            return self.wait('a pilot to arm and take off (takeoff is false)')
        if self.resting(now):
            return []
        if self.climbing:
            return self._climb(height, now)
        if telemetry.flight is not Flight.HOLD and not self._profile.amsl_takeoff and (
                Flight.HOLD in self._profile.set_mode):
            return self.set_mode(Flight.HOLD, now)  # ArduPilot arms and climbs in GUIDED
        if not telemetry.armed:
            arm = self._peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
            return self.do(Command('arm', arm, lambda: telemetry.armed, tries=ARM_TRIES,
                                   patient=True), now, self._armed)
        ground = telemetry.altitude - (
            0.0 if math.isnan(telemetry.height) else telemetry.height)
        up = self._profile.takeoff_command(self._peer, height, ground)
        return self.do(Command('take off', up, lambda: telemetry.flight is Flight.TAKEOFF), now,
                       self._took_off)

    def changed(self, before: Flight, was_airborne: bool, excused: bool) -> bool:
        """A heartbeat tells another mode; True where the mission has stopped or the UAV landed.

        excused: it may have left the mission mode by itself, at the end or after an upload.
        """
        telemetry, stopped = self._telemetry, False
        if telemetry.flight is Flight.MISSION:
            self.paused = False
        elif before is Flight.MISSION and telemetry.flight is not self.commanded:
            self.paused = telemetry.airborne and not excused
            stopped = True
        if was_airborne and not telemetry.airborne:
            self.paused = self.climbing = False
            return True
        return stopped

    def _armed(self, now: float) -> None:
        self._telemetry.armed = True

    def _took_off(self, now: float) -> None:
        self.climbing, self._climb_until = True, now + CLIMB
        self.commanded = Flight.TAKEOFF

    def _climb(self, height: float, now: float) -> Step:
        if self._telemetry.height >= ENOUGH * height:
            self.climbing, self.must_start = False, True
            return None
        self.waits_for = 'its height'
        if now > self._climb_until or not self._telemetry.armed:
            self.climbing = False
            self.fail(now)
        return []


def _mode_name(flight: Flight) -> str:
    return f'mode {flight.value}'
