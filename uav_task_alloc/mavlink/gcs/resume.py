# SPDX-License-Identifier: Apache-2.0
"""Finds out what a vehicle has flown while the bridge was down, from the onboard items alone.

The bridge never sets the current item past a task that is not flown (see `mission.diff`), so the
items before the current one have been flown, whichever station commanded it.
"""
from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.seen_passed import SeenPassed
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.unread_reports import UnreadReached, UnreadReports
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import (
    Item,
    MissionStop,
    TaskList,
    alike,
    with_position,
)
from uav_task_alloc.mavlink.mission.passed_items import flown_between, flown_in_gap
from uav_task_alloc.mavlink.mission.position_history import LOOSE_RADIUS
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.stop_items import place_of
from uav_task_alloc.mavlink.mission.task_items import TaskItems
from uav_task_alloc.model import Point, Task

_SAME_PLACE = 1.0  # [m]
_MAX_MISSIONS = 4  # that were read and are kept
_LANDED_STATE_DELAY = 3.0  # [s] after the mission was read in which it comes, as a rule
MAX_AGE = 60.0  # [s] after the restart; a later task at the same position is a new one
_NAMED_AGE = 3540.0  # [s] more, where it is a task of the previous run, which recorded its id


def checksum(items: Iterable[Item]) -> int:
    """CRC-32 of the item fields that every autopilot returns unchanged; identifies a mission."""
    return zlib.crc32(repr([(item.command, item.x, item.y) for item in items]).encode())


class Resume:
    """Locates a vehicle in its onboard mission once, and finds the tasks it has flown.

    Args:
        profile: of its autopilot.
        origin: of the local ENU frame.
        telemetry: of the vehicle.
        progress: table that is set to the onboard mission.
    """

    def __init__(self, profile: Profile, origin: Origin, telemetry: Telemetry,
                 progress: ProgressTable) -> None:
        self._profile, self._origin = profile, origin
        self._telemetry, self._progress = telemetry, progress
        self._tasks = TaskItems(profile, origin, progress.coverage, lambda: self.cruise())
        self.unflown: dict[str, Point] = {}  # [m] ENU, by task; skipped by another station
        self.reported: set[str] = set()  # flown and reported by the previous run
        self.ahead: dict[str, Point] = {}  # [m] ENU, by id; the next tasks of the previous run
        self.seen_passed = SeenPassed()
        # checksum of the mission, current item and whether it was seen there, of the previous run
        self.recorded: tuple[int | None, int | None, bool] = None, None, False
        self.passed: tuple[int, ...] = ()  # see `AuthorityRecord`
        self._seen: tuple[PositionSample, ...] = ()  # the last positions of the previous run
        self.recorded_upload: tuple[int, ...] = ()  # checksum and first item of an upload then
        self.was_disarmed, self.was_in_mission = True, False  # in the last record
        self.cruise: Callable[[], float] = lambda: math.nan  # [m/s]; NaN: not known
        self._missions: tuple[tuple[Item, ...], ...] = ()  # read so far
        self.current_unreliable = self.was_replacing = False  # items before it may be unflown
        self._rebooted = self._passed_recorded = False
        self._unread = UnreadReports(telemetry, progress.positions, profile.atomic)
        self.reset()

    def note_mark(self, task: str, place: Point, flown: bool) -> None:
        """Take a task that the previous run has reported as flown, or as skipped by another."""
        if flown:
            self.reported.add(task)
        else:
            self.unflown[task] = place

    def note_seen(self, sample: PositionSample) -> None:
        """Take a position that the previous run has recorded."""
        self._seen += (sample,)
        self._progress.positions.add_recorded(sample)

    def rebooted(self) -> None:
        """Reset after a restart of the vehicle, whose current item starts at the first."""
        _, recorded, arrived = self.recorded
        self._passed_recorded = arrived and recorded is not None and any(
            each.seq > recorded for each in self._unread.currents)
        self._unread.restarted(self.located)
        self.passed = () if self.located else self.passed
        self.reset()
        self._rebooted = True

    def reset(self) -> None:
        """Forget the location: the vehicle was restarted, or is another one."""
        self.located = False
        self._unread.currents = []
        self._skipped: frozenset[int] = frozenset()  # earlier items that were not flown
        self._old: tuple[Item, ...] = ()  # flown in the previous run
        self._epoch, self._located_at = -1, 0  # epoch and seq of the location
        self._until = -math.inf  # [s]
        self._reached: tuple[Item, ...] = ()  # those of `_flown` with a REACHED
        self._known_reached = 0  # how many had one at the last call of `_flown_items`
        self._flown: tuple[Item, ...] = ()  # of missions that were replaced

    def note_current(self, seq: int, now: float, frame: int) -> None:
        """Take a MISSION_CURRENT, home not counted; the first one shows what was flown before."""
        self._unread.note_current(seq, now, frame, self.located)

    def note_reached(self, seq: int, now: float, frame: int) -> None:
        """Take a MISSION_ITEM_REACHED, until the vehicle is located."""
        self._unread.note_reached(seq, now, frame)

    def _credit(self, passed: tuple[Item, ...], now: float) -> None:
        """Credit items that are known to be flown."""
        if passed:
            self._flown, self._reached = self._flown + passed, self._reached + passed
            self._until = now + MAX_AGE

    def _credit_unread(self, held: tuple[Item, ...], now: float) -> None:
        """Credit each REACHED received before the mission was read, by the positions."""
        self._credit(tuple(held[each.seq] for each in self._take_reached(held, now)), now)

    def _take_reached(self, held: tuple[Item, ...], now: float) -> list[UnreadReached]:
        mission, recorded, _ = self.recorded
        return self._unread.take_reached(
            self._placed(held), recorded if mission == checksum(held) else None, now)

    def awaits_position(self, held: tuple[Item, ...], read_at: float, now: float) -> bool:
        """Whether what locates the vehicle is still to come.

        On the ground nothing is needed, unless it has passed items since the last record.

        Args:
            held: the items on board, without home.
            read_at: steady time [s] at which they were read.
            now: steady time [s].
        """
        telemetry = self._telemetry
        if self.located or not held or (telemetry.current is not None and telemetry.has_position):
            return False
        return telemetry.airborne or self._passed_unlocated(held) or (
            not telemetry.grounded and now - read_at < _LANDED_STATE_DELAY)

    def _passed_unlocated(self, held: tuple[Item, ...]) -> bool:
        """Whether it has left mission mode past the recorded item, and no position has come."""
        mission, recorded, _ = self.recorded
        return bool(self._seen) and self.was_in_mission and not self._rebooted and (
            recorded is not None and mission == checksum(held)
            and any(each.seq > recorded for each in self._unread.currents))

    def locate(self, held: tuple[Item, ...], tasks: TaskList, now: float) -> None:
        """Locate the vehicle in its onboard mission, once.

        Args:
            held: the items on board, without home.
            tasks: the present list.
            now: steady time [s].
        """
        telemetry = self._telemetry
        if self.located or not held or telemetry.current is None:
            self.located = self.located or not held
            return
        self._begin(held, now)
        replaced = self._find_upload(held)
        if self._passed_recorded and self.recorded[0] == checksum(held):
            self._credit(held[self.recorded[1] or 0:][:1], now)
        if self.current_unreliable or (
                self.was_disarmed and not telemetry.airborne) or (not self._profile.atomic
                and telemetry.mode is not ModeFunction.MISSION
                and (replaced or not self._continues_recorded(held))):
            self._begin_nowhere(held, now)
            return
        # not by REACHED: PX4 repeats that of the previous mission for some seconds
        current = min(max(0, telemetry.current - self._profile.rules.home_first), len(held))
        if not self._profile.atomic and self._progress.items:  # REACHED was received first
            current = max(current, self._progress.current or 0)
        ended = self._ended(held, current)
        if self._continues_recorded(held):
            self._continue_recorded(held, tasks, ended, now)
            return
        self._credit_unread(held, now)
        flown, currents = len(held) if ended else current, self._unread.currents
        first = min(currents[0].seq, flown) if currents else flown
        if self._unread.began_held and self.recorded[0] is None:
            first = 0  # what was before it may be of the mission before
        self._skipped = frozenset(range(first, flown)) - self._flown_since(held, first, flown, now)
        items = held[:flown] + self._tasks.tagged(held[flown:], tasks)
        self._progress.begin(items, flown, now, read=True)
        self._epoch, self._located_at = self._progress.epoch, flown
        # the previous run has reported earlier items, or recorded that they were skipped
        self._old = held[:self.recorded[1] or 0] if self.recorded[0] == checksum(held) else ()
        # on the ground with the first list: the onboard mission is of an earlier flight
        if not self._rebooted and (telemetry.airborne or tasks.revision > 1):
            self._until = now + MAX_AGE

    def _begin(self, held: tuple[Item, ...], now: float) -> None:
        """Credit what the previous run has seen passed and had still to judge."""
        self.located, self._missions = True, (*self._missions[-_MAX_MISSIONS:], held)
        before = self._unread.take_passed_before(self._placed(held), self._home_of(held))
        self._credit(tuple(held[n] for n in sorted(before)), now)
        if len(self.passed) < 3 or self.recorded[0] != checksum(held):
            return
        first, end, left, *known = self.passed
        left &= 1 if self._telemetry.mode is ModeFunction.MISSION else 3
        flown = flown_in_gap(self._placed(held), first, min(end, len(held)), self._seen[:2],
                             bool(left), self._home_of(held)).union(known)
        self._credit(tuple(held[n] for n in sorted(flown) if n < len(held)), now)

    def _begin_nowhere(self, held: tuple[Item, ...], now: float) -> None:
        """Begin a mission whose current item may be that of the mission before it."""
        self._credit_unread(held, now)
        if not self.was_replacing:
            passed = self._unread.passed(
                self._placed(held), self._home_of(held), self.current_unreliable)
            self._credit(tuple(held[n] for n in sorted(passed)), now)
        if self._telemetry.airborne and self.recorded[0] is None:  # no file: taken at the start
            flown = held[:self._unread.flown_first(len(held))]
            self._flown, self._until = self._flown + flown, now + MAX_AGE
        self._progress.begin(held, None, now)
        self._epoch, self._located_at = self._progress.epoch, 0

    def _placed(self, held: tuple[Item, ...]) -> tuple[Item, ...]:
        return tuple(with_position(item, self._origin) for item in held)

    def _home_of(self, held: tuple[Item, ...]) -> Point | None:
        """Where a mission returns to; None: it does not, or not known."""
        returns = held[-1].command == d.MAV_CMD_NAV_RETURN_TO_LAUNCH
        return self._telemetry.home if returns else None

    def _find_upload(self, held: tuple[Item, ...]) -> bool:
        """Continue at its first item where the recorded upload is on board, and whether it is."""
        upload = self.recorded_upload
        if len(upload) != 2 or not upload[0] == checksum(held) != self.recorded[0]:
            return False
        self.recorded, self.passed = (upload[0], upload[1], False), ()
        return True

    def _continues_recorded(self, held: tuple[Item, ...]) -> bool:
        """Whether the vehicle flies the recorded mission on from the recorded item."""
        mission, recorded, _ = self.recorded
        return (mission == checksum(held) and recorded is not None and not self._rebooted
                and self._progress.positions.continues_recorded
                and bool(self._unread.currents) and recorded <= self._unread.currents[0].seq)

    def _continue_recorded(self, held: tuple[Item, ...], tasks: TaskList, ended: bool,
                           now: float) -> None:
        """Continue the previous run: items passed since are judged by the positions."""
        _, recorded, arrived = self.recorded
        assert recorded is not None
        progress, first = self._progress, self._unread.currents[0]
        current, when = min(first.seq, len(held)), first.at
        if ended:
            current, when = len(held), now
        self._old, self._until = held[:recorded], now + MAX_AGE
        # what was passed before is judged by the positions of before
        begin = min(max(recorded, *self.passed[1:2], 0), current)
        left_unseen = self.was_in_mission and not first.flying and (
            self._telemetry.mode is not ModeFunction.MISSION)
        flown = self._flown_since(held, begin, current, when, left_unseen)
        if arrived and current > recorded:
            flown |= {recorded}
        passed = tuple(held[n] for n in sorted(flown))
        self._flown, self._reached = self._flown + passed, self._reached + passed
        items = held[:current] + self._tasks.tagged(held[current:], tasks)
        progress.begin(items, current, now, read=True)
        self._epoch, self._located_at = progress.epoch, recorded
        self._replay(held, now)

    def _flown_since(self, held: tuple[Item, ...], begin: int, end: int, now: float,
                     left_unseen: bool = False) -> set[int]:
        """Indices in [begin, end) at which the vehicle was until steady time `now` [s]."""
        if begin == end or not self._unread.currents:
            return set()
        frame = max(each.frame for each in self._unread.currents if each.at <= now)
        placed, home = self._placed(held), self._home_of(held)
        return self._unread.passed_unseen(placed) | flown_between(
            placed, begin, end, now, frame, self._progress.positions, home, left_unseen)

    def _replay(self, held: tuple[Item, ...], now: float) -> None:
        """Pass on what was received until the mission was read, in the order it was sent."""
        rows: list[tuple[int, int, int, float]] = [
            (each.frame, 1, each.seq, each.at) for each in self._unread.currents[1:]]
        rows += [(each.frame, 0, each.seq, each.at) for each in self._take_reached(held, now)]
        for frame, kind, seq, when in sorted(rows):
            if kind:
                self._progress.note_current(seq, when, True, frame)
            else:
                self._progress.note_reached(seq, when, proven=True, frame=frame)

    def read_again(self, held: tuple[Item, ...], tasks: TaskList | None,
                   ) -> tuple[tuple[Item, ...], float | None]:
        """Return the items of a mission that was read, and since when [s] they are flown.

        Once it was located they have their tasks, and count from now on: what was reported before
        may be of another mission.

        Args:
            held: the items, without home.
            tasks: the list.
        """
        if tasks is None or not self.located:
            return held, None
        return self._tasks.tagged(held, tasks), self._progress.path.newest

    def keep_flown(self) -> None:
        """Keep the flown items of this mission before it is replaced."""
        here = self._flown_here()
        self._flown, self._reached = self._flown + here, self._reached + self._reached_of(here)

    def flown_count(self, now: float) -> int:
        """How many flown items and tasks are known; it changes where `flown_tasks` may."""
        if not self._flown and self._progress.epoch != self._epoch:  # as at most calls
            self._known_reached = 0
            return self.seen_passed.count(now)
        return len(self._flown_items(now)) + self.seen_passed.count(now)

    def _flown_items(self, now: float) -> tuple[Item, ...]:
        """Flown items that were not reported; none when no task can be credited any more."""
        here = self._flown_here()
        if not here and not self._flown:
            self._known_reached = 0
            return ()
        reached = len(self._reached) + len(self._reached_of(here))
        if reached > self._known_reached:
            self._until = now + MAX_AGE
        self._known_reached = reached
        return (*self._flown, *here) if now < self._until + _NAMED_AGE * bool(self.ahead) else ()

    def flown_tasks(self, tasks: Iterable[Task], now: float) -> tuple[Task, ...]:
        """The given tasks that are among the flown items, or were seen passed before."""
        tasks = tuple(tasks)
        flown, seen = self._flown_items(now), self.seen_passed.among(tasks, now)
        if not flown:
            return seen
        named = [task for task in tasks
                 if now < self._until or self.ahead.get(task.id) == task.position]
        found = []
        for turned in (False, True):
            stops = tuple(MissionStop(t, reversed=turned) for t in named if t.path or not turned)
            ends = {item.task: item for item in self._tasks.items_of(stops) if item.completes}
            found += [stop.task for stop in stops if stop.task.id in ends and any(
                alike(ends[stop.task.id], other) and self._is_flown(stop.task, other)
                and self._comes_along(stop, other) for other in flown)]
        return tuple(dict.fromkeys((*seen, *found)))

    def _comes_along(self, stop: MissionStop, last: Item) -> bool:
        """Whether the items before the last one of a way are of that way; ways share points."""
        if not stop.task.path:
            return True
        mission = next((each for each in self._missions if any(last is i for i in each)), ())
        at = next((n for n, item in enumerate(mission) if item is last), 0)
        end = with_position(last, self._origin).position
        for item in reversed(mission[:at]):
            place = with_position(item, self._origin).position
            if place is not None and end is not None and math.dist(place, end) > _SAME_PLACE:
                return segment_distance(place, *stop.way[-2:]) <= _SAME_PLACE
        return False

    def _is_flown(self, task: Task, item: Item) -> bool:
        """Whether an item at a task's position was reached, or passed and not skipped."""
        reached = (*self._reached, *self._reached_of(self._flown_here()))
        if any(item is each for each in reached):
            return True
        return self.unflown.get(task.id) != place_of(task) and (
            task.id in self.reported or not any(item is old for old in self._old))

    def _reached_of(self, flown: tuple[Item, ...]) -> tuple[Item, ...]:
        """Those of the flown items on board of which a REACHED was received."""
        items = self._progress.items
        return tuple(item for item in flown if any(
            item is items[n] for n in self._progress.reached_seqs if n < len(items)))

    def _flown_here(self) -> tuple[Item, ...]:
        """Flown items of the onboard mission that belong to no task of the list."""
        progress = self._progress
        if progress.epoch != self._epoch:
            return ()  # read again: earlier items may be of an interrupted transfer
        return tuple(item for n, item in enumerate(progress.items[:progress.current or 0])
                     if not item.task and item.position is None and n not in self._skipped
                     and (n < self._located_at or n in progress.reached_seqs))

    def _ended(self, held: tuple[Item, ...], current: int) -> bool:
        telemetry, last = self._telemetry, held[-1]
        if telemetry.mission_state != d.MISSION_STATE_COMPLETE:
            return False  # a pilot may have set HOLD just before the last item, or at it
        if not self._profile.atomic:
            return True  # PX4 reports it after a take-off and a landing too
        end = to_enu(self._origin, last.x * 1e-7, last.y * 1e-7, last.z)
        return (telemetry.airborne and telemetry.mode is ModeFunction.HOLD
                and current == len(held) - 1
                and math.dist(telemetry.position, end) < last.params[1] + LOOSE_RADIUS)
