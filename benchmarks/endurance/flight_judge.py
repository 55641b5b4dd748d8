# SPDX-License-Identifier: Apache-2.0
"""Judges a flight by the records of the simulator and the link, not by the bridge's reports."""
from __future__ import annotations

import math
from collections import Counter

from flight_evidence import DeliveredEvidence
from flight_world import BRIDGE, World
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.flight_modes import ModeClass, avoids_traffic, mode_class
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.sim.config import TruthEvent

OURS = f'station {BRIDGE[0]}/{BRIDGE[1]}'
ACTS = {d.MAV_CMD_DO_SET_MODE, d.MAV_CMD_COMPONENT_ARM_DISARM, d.MAV_CMD_NAV_TAKEOFF,
        d.MAV_CMD_DO_SET_MISSION_CURRENT, d.MAV_CMD_MISSION_START, d.MAV_CMD_DO_PAUSE_CONTINUE,
        d.MAV_CMD_NAV_RETURN_TO_LAUNCH, d.MAV_CMD_NAV_LAND, d.MAV_CMD_NAV_LOITER_UNLIM}
SAME = 12.0  # [s] after a mode command of the bridge the same mode may be set by either
NEAR = 2.0  # [m] from a task: its item
LEFT = 15.0  # [m] from a task: it has left
STUCK = 60.0  # [s]
PASSED = 1.5  # [s] around a set-current by another: what it crosses then may have been flown
BEAT = 1.0  # [s] between heartbeats: a shorter mode is not reported
SHOWN = 2.5  # [s] in which the link shows a mode: later it has changed in a cut
DOUBT = 5.0  # [s] in which a change of mode on the ground may still turn out to be a restart


def acts(message: Message) -> bool:
    """Whether a message makes a vehicle do something."""
    kind = message.get_type()
    return kind in ('SET_MODE', 'MISSION_SET_CURRENT') or (
        kind in ('COMMAND_LONG', 'COMMAND_INT') and message.command in ACTS)


def shows_armed(message: Message) -> bool:
    """Whether a message of a vehicle shows that it was armed."""
    if message.get_type() == 'HEARTBEAT':
        return bool(message.base_mode & d.MAV_MODE_FLAG_SAFETY_ARMED)
    return message.get_type() == 'COMMAND_ACK' and bool(
        message.command == d.MAV_CMD_COMPONENT_ARM_DISARM
        and message.result == d.MAV_RESULT_ACCEPTED)


class Judge:
    """Follows one flight tick by tick.

    A vehicle that was killed, and of which a heartbeat showed that, stays with its pilot until the
    hand-over service on the ground, by the table of authority: the bridge may send nothing. What
    others let it fly again until then, such as a complete mission that begins again where a pilot
    sets mission mode, is no fault of the bridge: `flown_again_killed` counts it apart. A mode
    that is set meanwhile hands nothing back, so that a command of the bridge is `overridden`.

    A complete mission begins again at its first item where a pilot sets mission mode; that of a
    PX4 where it was disarmed at its last item. What it flies again before the bridge may command
    it is counted apart, too, as `flown_again_for_pilot`: a failsafe is active, or the link was
    cut when the mode was set, or a pilot has armed the PX4, so that by the table it is not handed
    over. A hand-over by the service ends that.
    """

    def __init__(self, world: World, kind: str, places: dict[str, tuple[float, float, float]],
                 ) -> None:
        self.world, self.places = world, places
        self.family = 'copter' if kind == 'ardupilot' else kind
        self.taken_at: float | None = None  # [s] another has taken the aircraft
        self.known_at: float | None = None  # [s] the bridge could know of it
        self.failing = False
        self.stubborn = False  # the operator's last hand-over was by the sticks
        self.faults: list[str] = []
        self.notes: list[str] = []  # what no bridge could know
        self.counts: Counter[str] = Counter()
        self.reached: Counter[str] = Counter()
        self.completed: set[str] = set()
        self._mode = self._shown = world.vehicle.flight.custom_mode
        self._mode_at = -math.inf  # [s]
        self._armed = False  # since the last grant, as the table counts it
        self._boot_over = False  # a frame was delivered that shows the end of its boot
        self._rebooted_at = -math.inf  # [s]; what a beat later was sent is surely of after it
        self._commanded: dict[int, float] = {}  # modes commanded by the bridge, at [s]
        self._commanded_arm, self._taken_by_arm = -math.inf, False
        self._armed_at, self._shown_armed = -math.inf, False  # [s]; by a delivered frame since
        self._taken_by_disarm = self._news = False  # a heartbeat since it was taken was delivered
        self._taken_by_mode = self._own_mode_at = -math.inf  # [s]; the latest mode by another
        self._killed = False  # known to the bridge, and not handed back by the service since
        self._handed_at = -math.inf  # [s] by the service: what was sent before shows no later kill
        self._events = 0
        self._forgot = False  # the bridge, until its first heartbeat
        self._set_at = -math.inf  # [s] another station has set the current item
        self._crossed: set[str] = set()  # tasks whose places it crossed at such a moment
        self._evidence = DeliveredEvidence(self.family == 'px4')
        self._at = ''  # the task that it has reached, until it leaves: one visit
        self._ended = False  # its mission, and it was not begun again
        self._begun_again = math.inf  # [s] another has, and the bridge has commanded nothing since
        self._unheld = False  # no heartbeat has shown that in time without a failsafe
        self._armed_for_it = False  # it was begun again by an arming: no mode hands it over
        self._avoids = False  # its autopilot avoids other traffic
        self._stuck_since = self._moved_at = 0.0
        self._listed = world.tasks  # a new list begins a new transfer

    def handed_back(self, by_service: bool = False) -> None:
        """Note a hand-over by the service or by a pilot."""
        if self._killed and not by_service:
            return
        self.taken_at = self.known_at = None
        self.stubborn = self._killed = False
        if by_service:
            self._handed_at, self._armed = self.world.now, self.world.vehicle.flight.armed
        if by_service or self._armed_for_it:
            self._begun_again = math.inf
        self.counts['handed_back'] += 1

    def rebooted(self) -> None:
        """Note a reboot on the ground; not armed since the grant, it is taken by no one."""
        self.failing = self._boot_over = False
        self._rebooted_at = self.world.now
        if not self._armed and (self.known_at is None or self.world.now - self.known_at < DOUBT):
            self.taken_at = self.known_at = None

    def forgotten(self) -> None:
        """Note a restart of the bridge without a file.

        On the ground it forgets who took it, and what its predecessor had still to judge.
        """
        self._forgot, self._killed = True, False
        self._evidence.forget()

    def step(self) -> None:
        """Judge one tick of the world."""
        if self._at and math.dist(self.places[self._at],
                                  self.world.vehicle.flight.body.position) > LEFT:
            self._at = ''
        self._evidence.add_state(self.world.now, self.world.vehicle.flight)
        for event in self.world.truth:
            self._truth(event)
        for sent, message in self.world.delivered:
            self._evidence.delivered(sent, message)
            self._shown_armed |= sent >= self._armed_at and shows_armed(message)
            if message.get_type() == 'HEARTBEAT':
                self._boot_over |= sent > self._rebooted_at + BEAT and (
                    message.system_status >= d.MAV_STATE_STANDBY)
                self._killed |= sent > self._handed_at and (
                    message.system_status > d.MAV_STATE_CRITICAL)
                if (sent > self._begun_again and not self._armed_for_it
                        and self.world.now < self._begun_again + SHOWN):
                    self._unheld &= self.failing
        if self.world.now - self._set_at < PASSED:
            self._crossed.update(name for name, place in self.places.items() if math.dist(
                place, self.world.vehicle.flight.body.position) < NEAR)
        if self._forgot and self.world.arrivals:  # what the first heartbeat shows
            self._forgot = False
            flight = self.world.vehicle.flight
            if flight.landed or not flight.armed:  # it falls after a reboot in the air
                self.taken_at = self.known_at = None
        if self.taken_at is not None:
            self._news |= any(sent > self.taken_at + 1e-6 for sent in self.world.arrivals)
            # a disarming is no news where no frame has shown it armed
            if self.known_at is None and self._news and (
                    self._shown_armed or not self._taken_by_disarm):
                self.known_at = self.world.now
        for now, message in self.world.sent:
            self._sent(now, message)
        self._tasks()
        self._progress()

    def _class(self, mode: int) -> ModeClass | None:
        return mode_class(self.family, mode)

    def _truth(self, event: TruthEvent) -> None:
        if event.name == 'armed':
            self._armed_at, self._shown_armed = event.t, False
        if event.name == 'item_reached':
            self._item_reached(event)
        elif event.name == 'mode' and event.mode is not None:
            before, self._mode = self._mode, event.mode
            if self._ended and self._class(event.mode) is ModeClass.MISSION:
                self._note_begun(event, by_arming=False)
            if event.t - self._mode_at >= BEAT:
                self._shown = before
            before, self._mode_at = self._shown, event.t
            if event.cause not in (OURS, 'self'):
                self._mode_set(before, event)
            if event.cause != OURS and event.mode == self._shown and (
                    self.taken_at == self._taken_by_mode == event.t):
                self._mode_undone()  # also by a PX4 that was disarmed by it on the ground
            if event.cause == OURS and (self.known_at is None or (
                    self._avoids and self._class(event.mode) is ModeClass.MISSION)):
                # a command sent before has arrived after it; an avoidance ends by that, too
                self.taken_at = self.known_at = None
        elif event.name == 'kill_switch' or (
                event.name in ('armed', 'disarmed') and event.cause not in (OURS, 'self')):
            self._armed = True
            if event.name == 'disarmed':
                self._forget_unseen_arming()
            if event.name != 'armed' or event.t - self._commanded_arm > SAME:
                fresh = self.taken_at is None
                self._take(event.t)
                self._taken_by_arm = event.name == 'armed'
                self._taken_by_disarm = event.name == 'disarmed' and (
                    fresh or self._taken_by_disarm)
        elif event.name == 'command' and event.command == 'set current' and event.cause != OURS:
            self._set_at = event.t
            self._evidence.set_by_other(event.t)
        elif event.name == 'mission_restart':
            # armed in mission mode it takes off within the tick
            self._note_begun(event, event.t == self._armed_at or self.world.vehicle.flight.landed)
        elif event.name == 'mission_end':
            self._ended = True
        elif event.name == 'command' and event.cause == OURS:
            self._ended, self._begun_again = False, math.inf
        elif event.name == 'armed':
            self._armed = True
            if self._taken_by_disarm and self.known_at is None:
                self.taken_at = None  # a disarming that no frame has shown is undone
        elif event.name == 'failsafe':
            self.failing = True
        elif event.name == 'failsafe_over':
            self.failing = False

    def _note_begun(self, event: TruthEvent, by_arming: bool) -> None:
        """Note that a mission begins again, by another than the bridge."""
        if event.cause not in (OURS, 'self'):
            self._ended, self._begun_again, self._unheld = False, event.t, True
            self._armed_for_it = by_arming

    def _item_reached(self, event: TruthEvent) -> None:
        assert event.seq is not None
        at = [(name, place) for name, place in self.places.items()
              if math.dist(place, event.point) < NEAR]
        name, place = at[0] if at else ('', event.point)
        again = name == self._at
        if name and not again:
            self._at = name
            self.reached[name] += 1
            if self.reached[name] == 2 and self._killed:
                self.counts['flown_again_killed'] += 1
                self.notes.append(f'{event.t:.1f} {name} reached again: killed, not handed back')
            elif self.reached[name] == 2 and self._unheld and event.t > self._begun_again:
                self.counts['flown_again_for_pilot'] += 1
                self.notes.append(f'{event.t:.1f} {name} reached again: for a pilot')
            elif self.reached[name] == 2 and name in self._evidence.known:
                self._fault('flown_twice', f'{name} reached again')
            elif self.reached[name] == 2:
                self.counts['flown_again_unknowable'] += 1
                self.notes.append(f'{event.t:.1f} {name} reached again: no frame that shows that '
                                  'it was reached before was delivered')
        self._evidence.reached('' if again else name, event.t, event.seq, place,
                               self._service(name), self.world.now)

    def _service(self, name: str) -> float:
        """Service time [s] of a task."""
        tasks = self.world.tasks
        task = None if tasks is None else tasks.find(name)
        return 0.0 if task is None else task.service_time

    def _mode_set(self, before: int, event: TruthEvent) -> None:
        assert event.mode is not None
        was, new = self._class(before), self._class(event.mode)
        airborne = not self.world.vehicle.flight.landed
        avoided, self._avoids = self._avoids, avoids_traffic(self.family, event.mode)
        if new is ModeClass.MISSION:
            # after an avoidance, a failsafe that has not changed the mode only suspends
            if airborne and self.taken_at is not None and (avoided or not self.failing):
                self.handed_back()
        elif new is ModeClass.HOLD and was is ModeClass.STICK:
            if airborne and self.taken_at is not None and not self.failing:
                self.handed_back()  # the bridge has to wait before it believes that
        elif (new is not ModeClass.HOLD or was is ModeClass.MISSION) and (
                event.t - self._commanded.get(event.mode, -math.inf) > SAME) and (
                event.cause != 'failsafe' or airborne or self.world.vehicle.flight.armed) and (
                self._armed or self._boot_over):  # else as if it had been set during its boot
            self._taken_by_mode = event.t if self.taken_at is None else self._taken_by_mode
            self._own_mode_at = event.t
            self._take(event.t)

    def _forget_unseen_arming(self) -> None:
        """An arming that no frame has shown is undone: what remains is the mode."""
        if self.taken_at == self._armed_at and self.known_at is None and not self._shown_armed:
            self.taken_at, self._taken_by_arm = None, False
            if self._mode != self._shown:
                self.taken_at = self._taken_by_mode = self._own_mode_at

    def _mode_undone(self) -> None:
        """The mode by which it was taken ended within the tick: what remains is a disarming."""
        self._taken_by_disarm = not self.world.vehicle.flight.armed
        if not self._taken_by_disarm:
            self.taken_at = None

    def _take(self, when: float) -> None:
        if self.world.vehicle.flight.boot.booting:
            return  # booting: a mode is no intervention
        if self.taken_at is None:
            self.taken_at, self.known_at = when, None
            self._taken_by_disarm = self._news = False

    def _sent(self, now: float, message: Message) -> None:
        if not acts(message):
            return
        if self.known_at is not None and now > self.known_at:
            late = now - self.known_at
            self._fault('overridden', f'{message} sent {late:.1f} s after the bridge could know')
        if message.get_type() == 'COMMAND_LONG' and (
                message.command == d.MAV_CMD_COMPONENT_ARM_DISARM):
            self._commanded_arm = now
            if self._taken_by_arm and (self.known_at is None or now <= self.known_at):
                self.taken_at = self.known_at = None  # both have armed it, in unknown order
        if message.get_type() == 'COMMAND_LONG' and message.command == d.MAV_CMD_DO_SET_MODE:
            main, sub = int(message.param2), int(message.param3)
            self._commanded[main << 16 | sub << 24 if self.family == 'px4' else main] = now

    def _tasks(self) -> None:
        events = self.world.events
        while self._events < len(events):
            event = events[self._events]
            self._events += 1
            if event.event == 'COMPLETED' and event.task not in self.completed:
                self.completed.add(event.task)
                if event.task in self.places and not self.reached[event.task] and (
                        event.task not in self._crossed):
                    self._fault('false_completed', f'{event.task} was never reached')

    def _progress(self) -> None:
        """Stuck: HELD by the bridge, the link is good, and the vehicle does not move."""
        world = self.world
        flight = world.vehicle.flight
        if math.hypot(*flight.body.velocity) > 0.3 or (
                flight.track is not None and flight.track.hold > 0.0):
            self._moved_at = world.now
        wants = world.tasks is not None and any(
            stop.task.id not in self.completed for stop in world.tasks.stops)
        ready = (world.authority is AuthorityState.HELD and wants
                 and world.now >= world.link.cut_until and not self.failing)
        if not ready or world.tasks is not self._listed:
            self._stuck_since, self._listed = world.now, world.tasks
        if world.now - max(self._stuck_since, self._moved_at) > STUCK:
            self._fault('held_forever', f'{flight.mode.name}, {world.state}')
            self._moved_at = math.inf  # once a flight

    def _fault(self, kind: str, text: str) -> None:
        self.counts[kind] += 1
        self.faults.append(f'{self.world.now:.1f} {kind}: {text}')
