# SPDX-License-Identifier: Apache-2.0
"""Sends commands to one vehicle, one at a time: modes, arming, take-off, the current item.

Whether a command may be sent is decided by `authority` at each send, not here.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.command import Command, CommandResult
from uav_task_alloc.mavlink.gcs.telemetry import DISARM_PAUSE, Telemetry
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote

_ARM, _SET_CURRENT = 'arm', 'set current'
_ARM_ATTEMPTS = 120  # one per second: a position estimate may take that long
_REACHED_HEIGHT = 0.9  # fraction of the commanded height
_RETRY, _RETRIES = 10.0, 5  # [s] after a failure that may be temporary
_SLOW_RETRY = 60.0  # [s] after more failures, without limit
_SET_ATTEMPTS = 5  # to set an item as current that only the ACK can show to be set
_LANDED_STATE = 3.0  # [s] after HOLD in which a landed state comes, sent once a second, also late
_REFUSAL_DELAY = 5.0  # [s] of arming attempts before a refusal is logged: the reason may follow

_Completion = Callable[[float], None]
NextMessages = list[Message] | None  # None: the rule is satisfied


class CommandSender:
    """Executes one command at a time, with back-off after failures.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
        telemetry: of the vehicle; shows which commands were executed.
    """

    def __init__(self, peer: Peer, profile: Profile, telemetry: Telemetry) -> None:
        self._peer, self._profile, self._telemetry = peer, profile, telemetry
        self.notes: deque[OperatorNote] = deque()
        self.waits_for = ''  # text on what the bridge waits for; '': nothing
        self.commanded: ModeFunction | None = None  # the latest mode set by the bridge
        # False: it is to hold, and a command of mission mode is not sent again
        self.may_start_mission: Callable[[], bool] = lambda: True
        self.must_start = False  # airborne and held by the bridge: set mission mode
        self.armed_here = False  # armed by the bridge, on the ground: take-off or disarm is next
        self.climbing = False  # by a take-off of the bridge
        # mission mode was commanded since it was armed, as it looked airborne: a PX4 takes off
        self.started_mission = False
        self.mission_refused = ''  # why the last attempt to set mission mode was refused
        self.arming_refusal = ''  # the vehicle's text on why it does not arm
        # by seq on the wire, until when [s] the commands to set it as the current item were sent
        self.current_set_at: dict[int, float] = {}
        self._seq = 0  # of the latest of these commands
        self.mission_repeated_at = -math.inf  # [s] the command of mission mode was sent again
        self._reads = False  # a message was processed since the open command was continued last
        self._command: Command | None = None
        self._completion: _Completion | None = None
        self._logged_wait = ''
        self._logged: dict[str, str] = {}  # reason logged last, by the name of the failed command
        self._arming_since: float | None = None  # [s] of the first of the failing attempts
        self._retry_at, self._retries = -math.inf, 0

    @property
    def busy(self) -> bool:
        return self._command is not None

    @property
    def failing(self) -> bool:
        """More than _RETRIES failures in a row."""
        return self._retries > _RETRIES

    @property
    def climbs_by_mission(self) -> bool:
        """Whether its mission has taken it off: nobody else has to.

        While its first position estimates settle it may look airborne on the ground, and mission
        mode is set there.
        """
        telemetry = self._telemetry
        return (telemetry.mode is ModeFunction.MISSION and telemetry.airborne
                and telemetry.landed != d.MAV_LANDED_STATE_ON_GROUND)

    @property
    def left_ground(self) -> bool:
        """Whether telemetry shows that a vehicle that stood on the ground takes off."""
        telemetry = self._telemetry
        return telemetry.mode is ModeFunction.TAKEOFF or (
            telemetry.airborne and telemetry.landed != d.MAV_LANDED_STATE_ON_GROUND)

    @property
    def _needs_hold(self) -> bool:
        """Whether HOLD comes before arming and climbing.

        ArduPilot does both in GUIDED. PX4 climbs from any mode; it does not arm in Return or Land.
        """
        telemetry, profile = self._telemetry, self._profile
        if ModeFunction.HOLD not in profile.set_mode:
            return False
        climbs = profile.amsl_takeoff and telemetry.armed
        return telemetry.arms_into_mission or (
            telemetry.mode is not ModeFunction.HOLD and not climbs)

    def drop(self) -> None:
        """Drop the open command and its state, but not a climb, which the vehicle continues."""
        self._command = self._arming_since = None
        self.must_start = self.armed_here = False
        self.commanded, self.mission_refused = None, ''

    def reset(self, now: float) -> None:
        """Drop everything after a restart of the vehicle."""
        self.drop()
        self.climbing = False
        self.current_set_at.clear()
        self.clear_backoff(now)

    def clear_backoff(self, now: float) -> None:
        """End the back-off: a new list or a restored link may change the outcome."""
        self._retry_at, self._retries = now, 0

    def fail(self, now: float) -> None:
        """Start the back-off after a failure, a longer one after _RETRIES failures."""
        self._retries += 1
        self._retry_at = now + (_RETRY if self._retries <= _RETRIES else _SLOW_RETRY)

    def backing_off(self, now: float) -> bool:
        """Whether the back-off after a failure lasts."""
        if now < self._retry_at:
            self.waits_for = 'the next attempt'
        return now < self._retry_at

    def wait(self, what: str) -> list[Message]:
        """Send nothing; the reason is shown in diagnostics and logged once."""
        if self._logged_wait != what:
            self.notes.append(OperatorNote('warning', f'waits for {what}'))
        self.waits_for = self._logged_wait = what
        return []

    def wait_for(self, what: str) -> list[Message]:
        """Send nothing; the reason is shown in diagnostics only."""
        self.waits_for = what
        return []

    def satisfied(self) -> list[Message]:
        """Send nothing: the goal is reached. Resets waiting and failures."""
        self.waits_for = self._logged_wait = ''
        self._retries = 0
        return []

    def receive(self, message: Message) -> None:
        """Process a COMMAND_ACK; one to another station is ignored."""
        self._reads = True
        if self._command and self._peer.is_from_vehicle(message):
            self._command.receive(message)

    def note_arming_refusal(self, text: str) -> None:
        """Keep the text of a STATUSTEXT that gives the reason why the vehicle does not arm."""
        prefix, _, reason = text.partition(': ')
        if prefix in ('Arm', 'PreArm') and reason:
            self.arming_refusal = reason

    def finish(self, now: float) -> NextMessages:
        """Continue the open command; None if there is none, or it has ended now."""
        command = self._command
        if command is None:
            return None
        # the answer may be among the messages that were received in a stall, and come next
        out, self._reads = command.step(now, may_repeat=not self._reads), False
        if out and command.name == _SET_CURRENT:
            self.current_set_at[self._seq] = now
        elif out and command.name == _mode_name(ModeFunction.MISSION):
            self.mission_repeated_at = now
        if command.result is CommandResult.OPEN:
            self.waits_for = command.name + self._log_arming_refusal(command, now)
            return out
        self._command, completion = None, self._completion
        if command.name == _ARM and command.result is not CommandResult.FAILED:
            self._arming_since = None
        if command.result is CommandResult.DONE and completion:
            self._logged.pop(command.name, None)
            completion(now)
        elif command.result is CommandResult.FAILED:
            self._log_failure(command)
            if command.name == _mode_name(ModeFunction.MISSION) and 'refused' in command.reason:
                self.mission_refused = command.reason
            self.fail(now)
        return None

    def _log_failure(self, command: Command) -> None:
        """Log a reason once until it changes; a refusal to arm is logged before."""
        if command.name == _ARM and _ARM in self._logged:
            return
        if self._logged.get(command.name) != command.reason:
            self.notes.append(OperatorNote('error', f'{command.name}: {command.reason}'))
        self._logged[command.name] = command.reason

    def _log_arming_refusal(self, command: Command, now: float) -> str:
        """Text on why and for how long arming is refused, logged once until the reason changes."""
        tried = now - (now if self._arming_since is None else self._arming_since)
        if command.name != _ARM or not command.reason or tried < _REFUSAL_DELAY:
            return ''
        reason = self.arming_refusal or self._telemetry.unhealthy or command.reason
        text = f': refused for {tried:.0f} s: {reason}'
        if self._logged.get(_ARM) != reason:
            self._logged[_ARM] = reason
            self.notes.append(OperatorNote('warning', _ARM + text))
        return text

    def start(self, command: Command, now: float, completion: _Completion) -> list[Message]:
        """Start a command; `completion(now)` is called once it is executed."""
        self._command, self._completion = command, completion
        self.waits_for, self.mission_refused = command.name, ''
        return command.step(now)

    def set_mode(self, mode: ModeFunction, now: float) -> list[Message]:
        """Command a mode; confirmed by COMMAND_ACK or HEARTBEAT."""
        telemetry = self._telemetry

        def done(t: float) -> None:
            telemetry.note_acknowledged(mode)
            if mode is ModeFunction.MISSION:
                self.must_start = False

        self.commanded = mode
        self.started_mission = self.started_mission or mode is ModeFunction.MISSION
        return self.start(Command(_mode_name(mode), self._profile.mode_command(
            self._peer, mode), lambda: (
                telemetry.mode is mode and not telemetry.arms_into_mission),
            wanted=lambda: mode is not ModeFunction.MISSION or self.may_start_mission()),
            now, done)

    def set_current(self, seq: int, now: float, completion: _Completion) -> list[Message]:
        """Set the current mission item, by MISSION_SET_CURRENT if the command is unsupported.

        Args:
            seq: on the wire, that is with home on ArduPilot.
            now: steady time [s].
            completion: called once MISSION_CURRENT confirms it.
        """
        mission, sent_at, before = self._telemetry.mission, now, self._telemetry.mission.current
        plan = mission.plan_id
        self._seq, self.current_set_at[seq] = seq, now

        def executed() -> bool:
            if mission.current is None or mission.current_at < sent_at:
                return False
            # points may be passed faster than they are reported; `before` is of its own plan
            return mission.current == seq or (before is not None and seq < mission.current
                                              and (before <= seq or mission.plan_id != plan))

        # an item that was reported before is reported without the command too: it needs its ACK
        reported = before == seq
        message = Command(_SET_CURRENT, self._peer.set_current(seq), executed)
        command = Command(
            _SET_CURRENT, self._peer.command(d.MAV_CMD_DO_SET_MISSION_CURRENT, seq),
            lambda: not (reported and mission.plan_id == plan) and executed(),
            attempts=_SET_ATTEMPTS if reported else 2, fallback=message)
        return self.start(command if self._profile.jump_command else message, now, completion)

    def take_off(self, height: float, wanted: Callable[[], bool], now: float) -> NextMessages:
        """Arm, take off and climb.

        Args:
            height: [m] above home.
            wanted: checked before each attempt; False drops the command.
            now: steady time [s].

        Returns:
            The next messages; None once the vehicle is airborne at that height.
        """
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
        if self._needs_hold:
            return self.set_mode(ModeFunction.HOLD, now)
        if not telemetry.armed:
            self.armed_here = False
            if now - telemetry.disarmed_at < DISARM_PAUSE:
                return self.wait_for('a moment after it was disarmed')
            arm = self._peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
            if self._arming_since is None:
                self._arming_since, self.arming_refusal = now, ''
            return self.start(Command(_ARM, arm, lambda: telemetry.armed, attempts=_ARM_ATTEMPTS,
                                      retry_refused=True, wanted=wanted), now, self._armed)
        if self._profile.amsl_takeoff and telemetry.mode is ModeFunction.MISSION:
            return self.wait_for('its mission to take it off')  # set as it looked airborne
        if not self.armed_here:
            return self.wait_for('it to disarm: it was armed by another party, or has just landed')
        ground = telemetry.altitude - (
            0.0 if math.isnan(telemetry.height) else telemetry.height)
        takeoff = self._profile.takeoff_command(self._peer, height, ground)
        self.started_mission = False
        # ArduPilot refuses one that it has executed: its ACK may be lost
        return self.start(Command('take off', takeoff, lambda: self.left_ground,
                                  retry_refused=True,
                                  wanted=lambda: wanted() and not self.climbs_by_mission),
                          now, self.took_off)

    def disarm(self, now: float) -> list[Message]:
        """Disarm on the ground, after arming by the bridge, when there is nothing to fly.

        Where its mission may just have taken it off it holds first, until its landed state is
        known; nothing is disarmed in the air.
        """
        telemetry = self._telemetry
        if self.started_mission and ModeFunction.HOLD in self._profile.set_mode:
            if self.backing_off(now):
                return []
            if telemetry.mode is not ModeFunction.HOLD:
                return self.set_mode(ModeFunction.HOLD, now)
            if now - telemetry.mode_at < _LANDED_STATE:
                return self.wait_for('its landed state')
        self.armed_here = False
        disarm = self._peer.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
        return self.start(Command('disarm', disarm, lambda: not telemetry.armed,
                                  wanted=lambda: not telemetry.airborne), now, lambda t: None)

    def _armed(self, now: float) -> None:
        self._telemetry.armed = self.armed_here = True
        self.started_mission = False

    def took_off(self, now: float) -> None:
        """Wait for the height of the take-off: the vehicle executes it.

        Args:
            now: steady time [s].
        """
        self.climbing, self.armed_here = True, False
        self.commanded = ModeFunction.TAKEOFF

    def _climb(self, height: float, now: float) -> NextMessages:
        if self._telemetry.height >= _REACHED_HEIGHT * height:
            self.climbing, self.must_start = False, True
            return None
        self.waits_for = 'its height'
        if not self._telemetry.armed:
            self.climbing = False
            self.fail(now)
        return []


def _mode_name(mode: ModeFunction) -> str:
    return f'mode {mode.value}'
