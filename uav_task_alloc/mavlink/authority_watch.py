# SPDX-License-Identifier: Apache-2.0
"""Turns what a vehicle shows, and what was sent to it, into events of the authority table."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.authority import (
    Authority,
    Event,
    Hold,
    Record,
    State,
    Suspension,
    TaskMark,
)
from uav_task_alloc.mavlink.codec import Message
from uav_task_alloc.mavlink.mission_evidence import MissionEvidence
from uav_task_alloc.mavlink.modes import ModeClass, avoids_traffic, mode_class, mode_name
from uav_task_alloc.mavlink.policy import Note, Policy
from uav_task_alloc.mavlink.profiles import Flight, Profile
from uav_task_alloc.mavlink.sent_commands import IN_FLIGHT, SentCommands
from uav_task_alloc.mavlink.status_texts import StatusTexts
from uav_task_alloc.mavlink.telemetry import OFF_GROUND, STALE, Telemetry
from uav_task_alloc.model import Point

CLIMBED = 0.9  # of the height asked for: the take-off has ended by itself
CONTRADICTED = 2.5  # [s] in which a heartbeat may still show a mode that was acknowledged
DOUBT = 5.0  # [s] in which a message under way may explain a change of mode
REST, REST_MOVED, REST_TIME = 1.0, 3.0, 6.0  # [m/s], [m], [s]: at rest, for a hand-over
SWAP_KEPT = 60.0  # [s] that a swap may be under way when the bridge is restarted
BRAKING = 10.0  # [s] after its hold was sent until it is at rest
MARKS, REMEMBERED = 50, 600.0  # tasks, [s]
LOW_BATTERY = 0.2  # [0..1] below which nothing is handed over


@dataclass(slots=True)
class _Doubt:
    """A change of mode that a message under way may explain."""

    until: float  # [s]
    explained: Callable[[float], bool]
    why: str  # it is lost otherwise
    ours: int | None = None  # custom_mode of ours that explains it


class AuthorityWatch:
    """Watches one vehicle; `authority` is who has it."""

    def __init__(self, profile: Profile, telemetry: Telemetry, evidence: MissionEvidence,
                 policy: Callable[[], Policy], now: float, record: Record | None = None,
                 save: Callable[[Record], None] = lambda record: None) -> None:
        self.authority = Authority(now, record)
        self.notes: deque[Note] = deque()
        self.mode: int | None = None  # custom_mode of the newest heartbeat
        self.armed = False
        self.swap_at: float | None = None  # [s] since when we hold it for an upload
        self.marks: dict[str, TaskMark] = {m.task: m for m in record.marks} if record else {}
        self.was_lost = False  # the link, and the mode is not confirmed yet
        self._profile, self._telemetry, self._evidence = profile, telemetry, evidence
        self._policy, self._save, self._saved = policy, save, record
        self._record = record  # of the bridge before, until it is judged
        self._flown = record.flown if record else False
        self._sent = SentCommands() if record is None else (
            SentCommands.before_restart(record, now))
        self._status = 0
        self._texts = StatusTexts()
        self._armed_at_start = False  # somebody had armed it before this bridge was there
        self._adopt = False  # the next heartbeat tells the mode, and is no change
        # modes and armed states that are no news when the link is back
        self._compare: tuple[frozenset[int | None], frozenset[bool]] = frozenset(), frozenset()
        self._doubt: _Doubt | None = None
        self._rest: tuple[float, Point] | None = None  # since when, where: STICK -> HOLD
        self._to_mission = False  # set on the ground, by another
        self._hold_due = False  # first, where it turns out to be in the air after a restart
        self._maybe_ours = False  # in MISSION when the bridge started
        self._descending = False  # by our RETURN
        self._was_airborne = False
        self._landed_at = -math.inf  # [s] by our descent
        self._takeoff = policy().takeoff
        if record is None:
            self.authority.undecided = True

    # what the vehicle shows

    def heartbeat(self, message: Message, now: float) -> None:
        """Take the newest HEARTBEAT of the autopilot."""
        before, was_armed, descends = self.mode, self.armed, self._descends()
        if self._sent.armed_before(self._telemetry.frame):
            was_armed, self._flown = True, True  # that it is not armed now is news
        self.mode = message.custom_mode
        self.armed = bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
        self._status = message.system_status
        if before is None or self._record is not None:
            self._first(now)
        elif self._adopt:
            self._confirm(now)
        else:
            before = self._entered(before, now)
            if self.mode != before and self._class(before) is not None:
                self._mode_changed(before, self.mode, now)
            if self.armed != was_armed:
                self._armed_changed(descends, now)
        self._check_status(now)
        self._keep()

    def answered(self, message: Message, frame: int) -> None:
        """Take a COMMAND_ACK that is addressed to us, and the number of its frame."""
        self._sent.answered(message, frame)

    def _entered(self, before: int, now: float) -> int:
        """The mode before this heartbeat, also one that no heartbeat has shown.

        A mode that was acknowledged and is not there is doubted until the next heartbeat: PX4
        may answer a moment before it tells its new mode.
        """
        if self._doubt is not None and self._doubt.ours is not None and (
                self._doubt.ours == self.mode):
            self._resolve(now)
            return self.mode
        mode = self._sent.acks.known_by(self._telemetry.frame)
        if mode is None:
            return before
        self._sent.acks.clear()
        if self.mode in (mode, *self._sent.under_way(now), before):
            self._sent.modes = [each for each in self._sent.modes
                                if each[0] == mode == self.mode != before][-1:]
            if mode != self.mode and self.authority.held and self._doubt is None:
                why = f'{self._name(mode)} -> {self._name(self.mode)}'
                self._doubt = _Doubt(now + CONTRADICTED, lambda t: self.mode == mode, why, mode)
                self._apply(Event.UNEXPLAINED, now, why)
                before = self.mode if self.mode is not None else before
        return before

    def text(self, message: Message, now: float) -> None:
        """Take a STATUSTEXT: it may say why the mode changes."""
        if self._texts.receive(message, now):
            self._apply(Event.KILLED, now, f'the vehicle says: {message.text}')
        self._keep()

    def step(self, now: float) -> None:
        """Let time pass, after each message too."""
        telemetry = self._telemetry
        self.was_lost = self._adopt and (self.was_lost or telemetry.lost(now))
        if telemetry.stale(now) and not self._adopt and self.mode is not None:
            self._lose_sight(now)
            self._apply(Event.LINK_STALE, now, 'nothing heard for 3 s')
        self._decide(now)
        self._resolve(now)
        self._check_rest(now)
        self._check_ground(now)
        self._check_takeoff(now)
        self._check_foreign(now)
        self._keep()

    def new_address(self, now: float) -> None:
        """It speaks from elsewhere: the same vehicle, or another one with its id."""
        if not self._adopt:
            self._lose_sight(now)
        self._apply(Event.NEW_ADDRESS, now, 'heard from a new address')

    def _lose_sight(self, now: float) -> None:
        """The next heartbeat is compared with what is known, and what we have just asked for."""
        self._adopt = True
        self._sent.acks.clear()
        armed = {self.armed} | ({True} if now <= self._sent.arm_until + STALE else set())
        self._compare = frozenset({self.mode, *self._sent.under_way(now - STALE)}), frozenset(
            armed)

    def rebooted(self, now: float) -> None:
        """Its clock went back."""
        self._apply(Event.REBOOTED_FLOWN if self._flown else Event.REBOOTED, now,
                    'the vehicle was restarted')
        if not self._flown and self.authority.suspended_by(Suspension.LINK):
            self._adopt = False
            self._apply(Event.LINK_BACK, now, 'the vehicle was restarted, and never armed')
        elif not self.authority.suspended_by(Suspension.LINK):
            self._adopt = True
        self._sent.drop()
        self._descending = self._was_airborne = self._to_mission = False
        self._keep()

    def mark(self, task: str, place: Point | None, flown: bool, now: float) -> None:
        """A task was flown, or passed over: a restarted bridge could not see which."""
        if place is None:
            return
        self.marks.pop(task, None)
        self.marks = {old: mark for old, mark in list(self.marks.items())[-MARKS:]
                      if now - mark.at < REMEMBERED}
        self.marks[task] = TaskMark(task, *place, round(now, 3), flown)

    # what we do

    def sent(self, message: Message, now: float) -> None:
        """A command is about to be sent: written down before it is."""
        if message.get_type() != 'COMMAND_LONG':
            return
        mode = self._profile.commanded_mode(message)
        if mode is not None:
            self._sent.climb = None
            self._sent.acks.sent(mode, now)
            self._sent.mode(mode, now)
            self._descending = self._profile.flight(mode) is Flight.RETURN
        elif message.command == d.MAV_CMD_COMPONENT_ARM_DISARM:
            self._sent.arm(message.param1 == 1.0, now)
        elif message.command == d.MAV_CMD_NAV_TAKEOFF:
            self._descending = False
            takes_off = self._profile.takeoff_mode
            if takes_off is not None:
                self._sent.mode(takes_off, now)
                self._sent.climb = self._policy().cruise_altitude
        self._keep()

    def hand_over(self, operator: str, now: float) -> str:
        """An operator gives the aircraft to the bridge.

        Args:
            operator: who does, for the log.
            now: steady time [s].

        Returns:
            Why it is refused; '' where the bridge has it now.
        """
        if self.authority.held:
            return ''
        refusal = self._refusal(now)
        if not refusal:
            self._maybe_ours, self._rest, self._to_mission = False, None, False
            self._sent.drop()
            self._flown = self.armed
            self.authority.undecided = False
            self._apply(Event.HAND_OVER, now, f'handed over by {operator or "an operator"}')
            self._keep()
        return refusal

    def _refusal(self, now: float) -> str:
        telemetry, authority = self._telemetry, self.authority
        if telemetry.stale(now) or self.mode is None:
            return 'its link is stale'
        if self._status >= d.MAV_STATE_CRITICAL and not authority.killed:
            return 'a failsafe is active'
        if self._evidence.foreign():
            return 'the mission on board is foreign'
        if authority.state is State.SUSPENDED:
            return f'SUSPENDED: {authority.why}'
        if telemetry.battery < LOW_BATTERY:
            return (f'battery = {telemetry.battery:.0%}: expected at least {LOW_BATTERY:.0%}')
        if not telemetry.past_boot:
            return 'the autopilot is starting'
        if not (telemetry.airborne or telemetry.grounded):
            return 'not known whether it is in the air'
        if authority.killed and (self.armed or not telemetry.grounded):
            return 'after a kill only on the ground and disarmed'
        if self._status >= d.MAV_STATE_CRITICAL:
            return 'a failsafe is active'
        if telemetry.grounded and not self._policy().takeoff:
            return 'on the ground, and takeoff is false'
        return ''

    # judgement

    def _class(self, mode: int | None) -> ModeClass | None:
        return None if mode is None else mode_class(self._profile.family, mode)

    def _name(self, mode: int | None) -> str:
        return 'no mode' if mode is None else mode_name(self._profile.family, mode)

    def _apply(self, event: Event, now: float, why: str) -> None:
        before = self.authority.state
        if not self.authority.apply(event, now, why):
            return
        state = self.authority.state
        if state is State.LOST and before is not State.LOST:
            self._doubt, self._rest = None, None
            self._sent.modes.clear()
        if state is State.SUSPENDED and not self._adopt:
            self._sent.modes.clear()
        if state is State.HELD and before in (State.LOST, State.NONE):
            self._flown = self.armed
        if self.swap_at is not None:
            self.swap_at = now if state in (State.HELD, State.SUSPENDED) else None
        back = self.authority.gives_back
        self.notes.append(Note('info' if state in (State.HELD, State.NONE) else 'warning',
                               f'authority {state.name}: {why}'
                               + (f'; given back by {back}' if back else '')))

    def _first(self, now: float) -> None:
        """The first heartbeat of this bridge: does the vehicle do what it was left to do?"""
        record = self._record
        if record is None:
            self.authority.undecided = self._armed_at_start = self.armed
            return
        if record.state not in (State.HELD, State.SUSPENDED):
            self._record = None
            return
        same = self._class(self.mode) is None or self.mode in (record.mode, *record.commanded)
        agrees = same and (self.armed == record.armed or (self.armed and record.arming))
        why = f'the bridge was restarted, and found {self._name(self.mode)}'
        if agrees and record.swap_at is not None and self._class(self.mode) is ModeClass.HOLD:
            held, known = now - record.swap_at, self._telemetry.has_velocity
            rests = known and self._telemetry.speed < REST
            if not rests and 0.0 <= held < (BRAKING if known else SWAP_KEPT):
                return  # at rest? the next heartbeat will tell
            agrees = rests and 0.0 <= held < SWAP_KEPT
            self.swap_at = record.swap_at if agrees else None
        self._record = None
        self._descending = self._profile.flight(self.mode or 0) is Flight.RETURN
        if agrees and self.mode is not None:
            # a hold that was sent, or was to be sent, and was not seen
            self._hold_due = self._class(self.mode) is ModeClass.STICK or (
                self._class(self.mode) is not ModeClass.HOLD
                and ModeClass.HOLD in map(self._class, record.commanded))
            self._sent.expects(self.mode, now)
        self._apply(Event.RESTART_AGREES if agrees else Event.RESTART_DIFFERS, now, why)

    def _decide(self, now: float) -> None:
        """After a start without a file: on the ground, or in the air?"""
        if self.authority.undecided and self.mode is not None:
            if self._telemetry.grounded:
                self.authority.undecided = False
                if self._armed_at_start and self._policy().takeoff:
                    self.authority.landed = True  # `takeoff` alone grants nothing
                    self.authority.why = 'armed or landing when the bridge started'
            elif self._telemetry.airborne:
                self.authority.undecided = False
                self._maybe_ours = self._class(self.mode) is ModeClass.MISSION
                self._apply(Event.RESTART_AIRBORNE, now,
                            f'in the air in {self._name(self.mode)} when the bridge started')
        if self._maybe_ours and self.authority.state is State.LOST and self._evidence.ours():
            self._maybe_ours = False
            self._apply(Event.RESTART_OURS, now, 'flies our mission')

    def _confirm(self, now: float) -> None:
        """The first heartbeat after silence, from a new address, or after a reboot."""
        if not self.authority.suspended_by(Suspension.LINK):
            self._adopt = False
            return
        modes, armed = self._compare
        if (self.mode in modes and self.armed in armed) or (
                self._boots() and not (self._flown or self.armed)):
            self._adopt, self._doubt = False, None
            self._apply(Event.LINK_BACK, now, f'heard again, in {self._name(self.mode)}')
            return
        names = ' or '.join(sorted(map(self._name, modes)))
        why = f'heard again, in {self._name(self.mode)} instead of {names}'
        if self._flown or self.armed:
            self._adopt = False
            self._apply(Event.LINK_CHANGED, now, why)
        elif self._doubt is None:  # its clock will tell whether it was restarted
            self._doubt = _Doubt(now + DOUBT, lambda t: False, why)

    def _mode_changed(self, before: int, mode: int, now: float) -> None:
        was, new = self._class(before), self._class(mode)
        self._rest, self._to_mission, self._maybe_ours = None, False, False
        why = f'{self._name(before)} -> {self._name(mode)}'
        if self._doubt is not None:
            self._doubt = None
            self._apply(Event.TAKEN, now, why)
        elif self._sent.expects(mode, now):
            self._apply(Event.OWN, now, why)
        elif avoids_traffic(self._profile.family, mode):  # it says CRITICAL as well
            self._apply(Event.AVOIDING, now, why)
        elif (new is ModeClass.MISSION and self.authority.suspended_by(Suspension.AVOID)
                and avoids_traffic(self._profile.family, before)):
            self._apply(Event.AVOIDED, now, why)
        elif self._failing(now):
            event = Event.SWAP_TAKEN if self.swap_at is not None else Event.FAILSAFE_MODE
            self._apply(event, now, f'failsafe: {why}')
        elif new is ModeClass.MISSION:
            self._mission_set(before, mode, now, why)
        elif was is ModeClass.MISSION and self._explained(mode, now):
            self._apply(Event.MISSION_ENDED, now, why)
            self._descending = self._profile.flight(mode) is Flight.RETURN
        elif was is ModeClass.MISSION and self._explicable(mode):
            self._doubt = _Doubt(now + DOUBT, lambda t: self._explained(mode, t), why)
            self._apply(Event.UNEXPLAINED, now, why)
        elif new is ModeClass.HOLD:
            self._hold_set(was, before, mode, now, why)
        elif not self._flown and not self.armed and self.authority.held:
            # never armed: a restart of the autopilot looks alike until its clock is heard
            self._doubt = _Doubt(now + DOUBT, self._restarted_since(), why)
            self._apply(Event.UNEXPLAINED, now, why)
        elif self.authority.state is not State.NONE or self._telemetry.past_boot:
            self._take(why, now)

    def _take(self, why: str, now: float) -> None:
        swap = self.swap_at is not None and self.authority.held
        self._apply(Event.SWAP_TAKEN if swap else Event.TAKEN, now, f'not by the bridge: {why}')

    def _restarted_since(self) -> Callable[[float], bool]:
        restarts = self._telemetry.restarts
        return lambda now: self._telemetry.restarts != restarts or self._boots()

    def _boots(self) -> bool:
        """A heartbeat says so: while SUSPENDED nothing asks for a message with its clock."""
        return self._status in (d.MAV_STATE_BOOT, d.MAV_STATE_CALIBRATING)

    def _mission_set(self, before: int, mode: int, now: float, why: str) -> None:
        """MISSION, not expected: by a human, unless a command of ours came late."""
        if self._sent.recently(mode, now):
            self._apply(Event.OWN, now, why)
        elif self._telemetry.airborne:
            self._apply(Event.TO_MISSION, now, f'{why} in flight')
        else:
            self._to_mission = True  # it may take off with it

    def _hold_set(self, was: ModeClass | None, before: int, mode: int, now: float,
                  why: str) -> None:
        climb = self._sent.climb
        if self._profile.takeoff_mode == before and climb is not None:
            def climbed(t: float) -> bool:
                return self._telemetry.height >= CLIMBED * climb

            self._sent.climb = None
            if climbed(now):
                self._apply(Event.OWN, now, why)
            else:
                self._doubt = _Doubt(now + DOUBT, climbed, why)
                self._apply(Event.UNEXPLAINED, now, why)
        elif self._descending and self._profile.flight(before) is Flight.RETURN:
            # PX4 goes to Hold when it has landed
            self._doubt = _Doubt(now + DOUBT, lambda t: self._telemetry.grounded, why)
            if self._telemetry.grounded:
                self._doubt = None
            else:
                self._apply(Event.UNEXPLAINED, now, why)
        elif self._sent.recently(mode, now):
            # a command of ours that came late: it hands nothing over
            if was is ModeClass.MISSION:
                self._take(why, now)
        elif was is ModeClass.STICK:
            if self._telemetry.airborne:
                self._rest = now, self._telemetry.position
        elif self._telemetry.airborne and (was is ModeClass.MISSION or self.authority.held
                                           or avoids_traffic(self._profile.family, before)):
            self._take(why, now)

    def _explained(self, mode: int, now: float) -> bool:
        """The vehicle has left the mission by itself, at its end (PX4)."""
        if self._profile.family != 'px4':
            return False
        if self._class(mode) is ModeClass.HOLD:
            return (self._evidence.ended(now) or self._evidence.rejected(now)
                    or self._texts.mission_over(now))
        return self._profile.flight(mode) is Flight.RETURN and self._evidence.returning()

    def _explicable(self, mode: int) -> bool:
        hold = self._class(mode) is ModeClass.HOLD
        return self._profile.family == 'px4' and self._evidence.may_end() and (
            hold or self._profile.flight(mode) is Flight.RETURN)

    def _failing(self, now: float) -> bool:
        return bool(self._status >= d.MAV_STATE_CRITICAL) or self._texts.failsafe(now)

    def _resolve(self, now: float) -> None:
        doubt = self._doubt
        if doubt is None:
            return
        if doubt.explained(now):
            self._doubt = None
            if self.mode is not None and self._profile.flight(self.mode) is Flight.RETURN:
                self._descending = True
            self._apply(Event.EXPLAINED, now, doubt.why)
        elif now >= doubt.until:
            self._doubt = None
            if self._adopt:
                self._adopt = False
                self._apply(Event.LINK_CHANGED, now, doubt.why)
            else:
                self._take(doubt.why, now)

    def _armed_changed(self, descends: bool, now: float) -> None:
        if self.armed:
            if now <= self._sent.arm_until:
                self._flown = True
                self._apply(Event.OWN, now, 'armed by the bridge')
            else:
                self._apply(Event.ARMED_BY_OTHER, now, 'armed, not by the bridge')
        elif descends:
            self._landed(now, 'landed')
        elif now <= max(self._sent.disarm_until, self._landed_at + IN_FLIGHT):
            self._apply(Event.OWN, now, 'disarmed by the bridge, or after its landing')
        elif self._was_airborne and self._falls():
            self._apply(Event.KILLED, now, 'disarmed in the air')
        else:
            self._apply(Event.ARMED_BY_OTHER, now, 'disarmed, not by the bridge')

    def _falls(self) -> bool:
        """Off the ground by both: landed_state is told once a second, and a home may be low."""
        return (self._telemetry.height > OFF_GROUND
                and self._telemetry.landed != d.MAV_LANDED_STATE_ON_GROUND)

    def _descends(self) -> bool:
        """We sent it home, by mode or by the last item."""
        flight = None if self.mode is None else self._profile.flight(self.mode)
        return (self._descending and flight is Flight.RETURN) or (
            flight is Flight.MISSION and self._evidence.returning())

    def _landed(self, now: float, why: str) -> None:
        policy = self._policy()
        again = (policy.relaunch == 'automatic' and policy.takeoff
                 and not self.authority.until_landing)
        self._sent.drop()
        self._landed_at = now
        self._apply(Event.OWN if again else Event.OWN_LANDING, now, why)

    def _check_ground(self, now: float) -> None:
        """Landing, and take-off with a mission that somebody started on the ground."""
        if self._hold_due and (self._telemetry.airborne or self._telemetry.grounded):
            self._hold_due = False
            if self._telemetry.airborne and self.authority.held:
                self.authority.hold = Hold.FIRST
        if self._telemetry.airborne:
            if self._to_mission:
                self._to_mission = False
                if not self._failing(now) and self._evidence.verified():
                    self._apply(Event.TO_MISSION, now, 'took off with our mission')
            self._was_airborne = True
        elif self._was_airborne and self._telemetry.grounded and not self._adopt:
            self._was_airborne = False
            if self.authority.held and (self._descends() or self.authority.until_landing):
                self._landed(now, 'landed')

    def _check_status(self, now: float) -> None:
        if self._status > d.MAV_STATE_CRITICAL:
            self._apply(Event.KILLED, now, 'emergency, or flight terminated')
        elif self._status == d.MAV_STATE_CRITICAL:
            if not self.authority.suspended_by(Suspension.FAILSAFE):
                self._apply(Event.FAILSAFE_STAYS, now, 'a failsafe is active')
        elif self.authority.suspended_by(Suspension.FAILSAFE):
            self._apply(Event.FAILSAFE_OVER, now, 'the failsafe is over')

    def _check_rest(self, now: float) -> None:
        """STICK -> HOLD is a hand-over once it has been at rest for a while."""
        if self._rest is None:
            return
        since, place = self._rest
        telemetry = self._telemetry
        moved = math.dist(telemetry.position, place)
        calm = (telemetry.speed < REST and moved < REST_MOVED and telemetry.airborne
                and now - telemetry.position_at < 2.0 and self._status == d.MAV_STATE_ACTIVE
                and not self._failing(now))
        if not calm:
            self._rest = None
        elif now - since >= REST_TIME:
            self._rest = None
            self._apply(Event.STICK_TO_HOLD, now,
                        f'{self._name(self.mode)} at rest for {REST_TIME:g} s')

    def _check_takeoff(self, now: float) -> None:
        takeoff, telemetry = self._policy().takeoff, self._telemetry
        idle = self.mode is not None and not self.armed and self.authority.held
        if not takeoff and (self._takeoff or idle):
            air = telemetry.airborne
            self._apply(Event.WITHDRAWN_IN_AIR if air else Event.WITHDRAWN, now,
                        'takeoff is false' + (': until the landing' if air else ''))
        elif takeoff and not self._takeoff:
            self.authority.until_landing = False
        if self.authority.state is not State.SUSPENDED or takeoff:
            self._takeoff = takeoff  # else it becomes false when that is over
        if (takeoff and self.authority.state is State.NONE and not self.authority.landed
                and not self.authority.undecided and self.mode is not None and not self.armed
                and telemetry.grounded and telemetry.past_boot and not telemetry.stale(now)):
            self._apply(Event.GRANTED, now, 'takeoff is true')

    def _check_foreign(self, now: float) -> None:
        foreign = self._evidence.foreign() and self._policy().when_foreign == 'yield'
        if foreign and not self.authority.suspended_by(Suspension.FOREIGN):
            self._apply(Event.FOREIGN, now, 'somebody else changed the mission: yield')
        elif not foreign and self.authority.suspended_by(Suspension.FOREIGN):
            self._apply(Event.FOREIGN_OVER, now, 'our mission is on board again')

    def _keep(self) -> None:
        """Hand what a restart has to know to whoever keeps it, where it has changed."""
        authority = self.authority
        if authority.undecided or self._record is not None or (
                authority.suspended_by(Suspension.RESTART)):
            return
        record = Record(
            authority.state, authority.why, authority.since, authority.killed, authority.landed,
            authority.until_landing, self._flown, self.mode, self.armed,
            tuple(dict.fromkeys(mode for mode, _ in self._sent.modes)),
            self._sent.arm_until > -math.inf and not self.armed and authority.held,
            self.swap_at, self._sent.climb, tuple(self.marks.values()),
            *self._evidence.place())
        if record != self._saved:
            self._saved = record
            self._save(record)
