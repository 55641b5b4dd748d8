# SPDX-License-Identifier: Apache-2.0
"""Which tasks a bridge could know to be flown, by the frames delivered to it and nothing else."""
from __future__ import annotations

import math
from dataclasses import dataclass

from flight_world import TICK
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.model import Point
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.flight import VehicleFlight
from uav_task_alloc.sim.stored_item import StoredItem

NEAR = 2.0  # [m] from a task: at its item
SAMPLED = 0.5  # [s] by which a hold may be shorter between two positions
KEPT = 60.0  # [s] of positions, and of states of the vehicle
JUDGED = 6.0  # [s] in which a bridge waits for messages sent before those that it has received


@dataclass(frozen=True, slots=True)
class _State:
    """The vehicle when frames of one tick were sent."""

    point: Point
    seq: int | None  # the item that it flies in mission mode
    items: tuple[StoredItem, ...]
    booted: float  # [s]


@dataclass(slots=True)
class _Visit:
    """The first time that the item of a task was reached."""

    at: float  # [s]
    seq: int
    place: Point
    hold: float  # [s]
    state: _State
    next_at: float = math.inf  # [s] the next item was reached
    set_at: float = math.inf  # [s] another station has set the current item since
    named: bool = True  # a REACHED names it; not to a bridge without a file, once it is replaced
    own_at: float = math.inf  # [s] a PX4 took off or landed by a mode of its own since


class DeliveredEvidence:
    """Follows each first visit of a task until a frame that shows it was delivered.

    Evidence is MISSION_ITEM_REACHED of that visit, MISSION_CURRENT past its item (or COMPLETE) of
    the same items, or positions at the place while its item was current, for its service time,
    and a frame sent after them that shows mission mode: without one a pilot may have taken the
    vehicle just before it was there. One of after a restart of the vehicle shows nothing.
    A REACHED of a mission that was replaced before a bridge without a file began is none: nothing
    names the task of its index to that.
    A MISSION_CURRENT sent after another station has set the current item is none: it would be the
    same if the item had been skipped just before it was reached. Nor is COMPLETE of a PX4 once it
    was in Takeoff or Land: these modes report their own end as that of the mission
    (`Land::on_active` and `Takeoff::on_active` of its navigator).

    Args:
        px4: the vehicle is a PX4, whose missions are replaced with their current item.
    """

    def __init__(self, px4: bool) -> None:
        self._px4 = px4
        self.known: dict[str, float] = {}  # tasks with evidence, and when [s] it was complete
        self._now = 0.0  # [s] of the tick
        self._held_from = -math.inf  # [s] visits before it need a current item in mission mode
        self._visits: dict[str, _Visit] = {}
        self._states: dict[int, _State] = {}  # by tick
        self._positions: list[float] = []  # [s] when each delivered position was sent
        # [s] the latest delivered frame that shows mission mode was sent, by the boot time [s]
        self._shown: dict[float, float] = {}

    def add_state(self, now: float, flight: VehicleFlight) -> None:
        """Record the vehicle as the frames of this tick show it."""
        self._now = now
        mission = flight.mode is FlightMode.MISSION
        self._states[_tick(now)] = _State(
            flight.body.position, flight.seq if mission else None, tuple(flight.items),
            flight.booted)
        self._states.pop(_tick(now - KEPT), None)
        if self._px4 and flight.mode in (FlightMode.TAKEOFF, FlightMode.LAND):
            for visit in self._visits.values():
                visit.own_at = min(visit.own_at, now)

    def forget(self) -> None:
        """Forget what a bridge had still to judge that was killed, and has left no file.

        Its successor cannot know either for which mission an ArduPilot is held: the current item
        of a mission that was replaced stays until it flies.
        """
        self.known = {task: at for task, at in self.known.items() if self._now - at > JUDGED}
        self._positions.clear()
        state = self._states.get(_tick(self._now))
        for visit in self._visits.values():
            end = visit.seq + 1
            visit.named &= state is not None and state.items[:end] == visit.state.items[:end]
        if not self._px4:
            self._held_from = self._now

    def reached(self, task: str, at: float, seq: int, place: Point, hold: float,
                now: float) -> None:
        """Note that the simulator has reached an item.

        Args:
            task: its id; '': the item is of no task, or of one that it has not left since.
            at: time of the event [s].
            seq: of the item.
            place: of the task, ENU [m].
            hold: service time [s].
            now: time of the tick [s].
        """
        for visit in self._visits.values():
            visit.next_at = min(visit.next_at, at)
        if task and task not in self._visits:
            self._visits[task] = _Visit(at, seq, place, hold, self._states[_tick(now)])
            self._judge_positions()

    def set_by_other(self, at: float) -> None:
        """Note that another station has set the current item at time `at` [s]."""
        for visit in self._visits.values():
            visit.set_at = min(visit.set_at, at)

    def delivered(self, sent: float, message: Message) -> None:
        """Take a frame of the vehicle that was delivered to the bridge.

        Args:
            sent: when it was sent [s].
            message: its content.
        """
        kind, state = message.get_type(), self._states.get(_tick(sent))
        if kind in ('HEARTBEAT', 'MISSION_CURRENT') and state is not None and (
                state.seq is not None and sent > self._shown.get(state.booted, -math.inf)):
            self._shown[state.booted] = sent
            self._judge_positions()
        if kind == 'GLOBAL_POSITION_INT' and (message.lat, message.lon) != (0, 0):
            self._positions = [t for t in self._positions if t > sent - KEPT] + [sent]
            self._judge_positions()
        elif kind in ('MISSION_ITEM_REACHED', 'MISSION_CURRENT'):
            for task, visit in self._visits.items():
                if task not in self.known and sent >= visit.at and self._shows(
                        visit, sent, message):
                    self.known[task] = self._now

    def _shows(self, visit: _Visit, sent: float, message: Message) -> bool:
        if message.get_type() == 'MISSION_ITEM_REACHED':
            return visit.named and bool(message.seq == visit.seq) and sent < visit.next_at
        state, end = self._states.get(_tick(sent)), visit.seq + 1
        if sent > visit.set_at:
            return False
        if state is not None and state.seq is None and visit.at < self._held_from:
            return False
        past = message.seq > visit.seq or (
            message.seq == visit.seq and sent < visit.own_at
            and message.mission_state == d.MISSION_STATE_COMPLETE)
        return past and state is not None and state.booted == visit.state.booted and (
            state.items[:end] == visit.state.items[:end])

    def _judge_positions(self) -> None:
        for task, visit in self._visits.items():
            if task in self.known:
                continue
            shown = self._shown.get(visit.state.booted, -math.inf)
            times = [t for t in self._positions
                     if t <= min(visit.at + TICK, shown) and self._at(visit, t)]
            if times and max(times) - min(times) >= visit.hold - SAMPLED:
                self.known[task] = self._now

    def _at(self, visit: _Visit, sent: float) -> bool:
        """Whether a position was sent at the place while its item was current.

        Once the mission has ended (PX4 holds then, as it does for a pilot), none is any more.
        """
        state = self._states.get(_tick(sent))
        return state is not None and state.seq is not None and (
            state.seq == visit.seq or sent >= visit.at) and (
            state.booted == visit.state.booted
            and state.items[visit.seq:visit.seq + 1] == visit.state.items[
                visit.seq:visit.seq + 1]
            and math.dist(state.point, visit.place) < NEAR)


def _tick(now: float) -> int:
    return round(now / TICK)
