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
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.flown_items import FlownItems
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.unread_reports import UnreadReached, UnreadReports
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import Item, TaskList, with_position
from uav_task_alloc.mavlink.mission.passed_items import flown_between, flown_in_gap
from uav_task_alloc.mavlink.mission.position_history import LOOSE_RADIUS
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.task_items import TaskItems
from uav_task_alloc.model import Point

_LANDED_STATE_DELAY = 3.0  # [s] after the mission was read in which it comes, as a rule


def checksum(items: Iterable[Item]) -> int:
    """CRC-32 of the item fields that every autopilot returns unchanged; identifies a mission."""
    return zlib.crc32(repr([(item.command, item.x, item.y) for item in items]).encode())


class Resume:
    """Locates a vehicle in its onboard mission once, and credits the items it has flown.

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
        self.flown = FlownItems(origin, progress, self._tasks)
        # checksum of the mission, current item and whether it was seen there, of the previous run
        self.recorded: tuple[int | None, int | None, bool] = None, None, False
        self.passed: tuple[int, ...] = ()  # see `AuthorityRecord`
        self._seen: tuple[PositionSample, ...] = ()  # the last positions of the previous run
        self.recorded_upload: tuple[int, ...] = ()  # checksum and first item of an upload then
        self.was_disarmed, self.was_in_mission = True, False  # in the last record
        self.cruise: Callable[[], float] = lambda: math.nan  # [m/s]; NaN: not known
        self.current_unreliable = self.was_replacing = False  # items before it may be unflown
        self._rebooted = self._passed_recorded = False
        self._unread = UnreadReports(telemetry, progress.positions, profile.atomic)
        self.reset()

    def note_seen(self, sample: PositionSample) -> None:
        """Take a position that the previous run has recorded."""
        self._seen += (sample,)
        self._progress.positions.add_recorded(sample)

    def rebooted(self) -> None:
        """Reset after a restart of the vehicle, whose current item starts at the first."""
        _, recorded, arrived = self.recorded
        self._passed_recorded = not self.located and arrived and recorded is not None and any(
            each.seq > recorded for each in self._unread.currents)
        self._unread.restarted(self.located)
        if self.located:  # the record is of a mission that may have been replaced since
            self.passed = self.recorded_upload = ()
        self.reset()
        self._rebooted = True

    def reset(self) -> None:
        """Forget the location: the vehicle was restarted, or is another one."""
        self.located = False
        self._unread.currents = []
        self.flown.reset()

    def note_current(self, seq: int, now: float, frame: int) -> None:
        """Take a MISSION_CURRENT, home not counted; the first one shows what was flown before."""
        self._unread.note_current(seq, now, frame, self.located)

    def note_reached(self, seq: int, now: float, frame: int) -> None:
        """Take a MISSION_ITEM_REACHED, until the vehicle is located."""
        self._unread.note_reached(seq, now, frame)

    def _credit(self, passed: tuple[Item, ...], now: float) -> None:
        """Credit items that are known to be flown."""
        if passed:
            self.flown.add(passed)
            self.flown.credit_until(now)

    def _credit_unread(self, held: tuple[Item, ...], now: float) -> None:
        """Credit each REACHED received before the mission was read, by the positions."""
        self._credit(tuple(held[each.seq] for each in self._take_reached(held, now)), now)

    def _take_reached(self, held: tuple[Item, ...], now: float) -> list[UnreadReached]:
        mission, recorded, _ = self.recorded
        return self._unread.take_reached(
            self._placed(held), recorded if mission == checksum(held) else None, now)

    def replaced(self, held: tuple[Item, ...]) -> bool:
        """Whether a mission is neither the one that the previous run recorded nor its upload.

        Args:
            held: the items on board, without home, as they are read first.
        """
        mission, recorded_upload = self.recorded[0], self.recorded_upload
        return bool(held) and not (self.located or self.was_disarmed or recorded_upload) and (
            mission is not None and mission != checksum(held))

    def awaits_position(self, held: tuple[Item, ...], read_at: float, now: float) -> bool:
        """Whether what locates the vehicle is still to come.

        On the ground nothing is needed, unless it has passed items since the last record.

        Args:
            held: the items on board, without home.
            read_at: steady time [s] at which they were read.
            now: steady time [s].
        """
        telemetry, current = self._telemetry, self._telemetry.mission.current
        if self.located or not held or (current is not None and telemetry.has_position):
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
        telemetry, reported = self._telemetry, self._telemetry.mission.current
        if self.located or not held or reported is None:
            self.located = self.located or not held
            return
        self._begin(held, now)
        replaced = self._find_upload(held)
        if self._passed_recorded and self.recorded[0] == checksum(held):
            self._credit(held[self.recorded[1] or 0:][:1], now)
        self.current_unreliable |= self._is_mixed(held)
        if self.current_unreliable or (
                self.was_disarmed and not telemetry.airborne) or (not self._profile.atomic
                and telemetry.mode is not ModeFunction.MISSION
                and (replaced or not self._continues_recorded(held))):
            self._begin_nowhere(held, now)
            return
        # not by REACHED: PX4 repeats that of the previous mission for some seconds
        current = min(max(0, reported - self._profile.rules.home_first), len(held))
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
        self.flown.skipped = frozenset(
            range(first, flown)) - self._flown_since(held, first, flown, now)
        items = held[:flown] + self._tasks.tagged(held[flown:], tasks)
        self._progress.begin(items, flown, now, read=True)
        self.flown.located(flown)
        # the previous run has reported earlier items, or recorded that they were skipped
        self.flown.old = held[:self.recorded[1] or 0] if self.recorded[0] == checksum(held) else ()
        # on the ground with the first list: the onboard mission is of an earlier flight
        if not self._rebooted and (telemetry.airborne or tasks.revision > 1):
            self.flown.credit_until(now)

    def _begin(self, held: tuple[Item, ...], now: float) -> None:
        """Credit what the previous run has seen passed and had still to judge."""
        self.located = True
        self.flown.note_mission(held)
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
            self.flown.add(held[:self._unread.flown_first(len(held))], reached=False)
            self.flown.credit_until(now)
        self._progress.begin(held, None, now)
        self.flown.located(0)

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
        self._passed_recorded = False  # of the mission that it has replaced
        return True

    def _is_mixed(self, held: tuple[Item, ...]) -> bool:
        """Whether a part of a replacing upload is on board, below a current item of before it."""
        (mission, current, _), upload = self.recorded, self.recorded_upload
        if self._profile.atomic or len(upload) != 2 or checksum(held) in (mission, upload[0]):
            return False
        return upload[0] == mission or upload[1] != current  # has failed, or appends nothing

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
        self.flown.old = held[:recorded]
        self.flown.credit_until(now)
        # what was passed before is judged by the positions of before
        begin = min(max(recorded, *self.passed[1:2], 0), current)
        left_unseen = self.was_in_mission and not first.flying and (
            self._telemetry.mode is not ModeFunction.MISSION)
        flown = self._flown_since(held, begin, current, when, left_unseen)
        if arrived and current > recorded:
            flown |= {recorded}
        self.flown.add(tuple(held[n] for n in sorted(flown)))
        items = held[:current] + self._tasks.tagged(held[current:], tasks)
        progress.begin(items, current, now, read=True)
        self.flown.located(recorded)
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

    def _ended(self, held: tuple[Item, ...], current: int) -> bool:
        telemetry, last = self._telemetry, held[-1]
        if telemetry.mission.state != d.MISSION_STATE_COMPLETE:
            return False  # a pilot may have set HOLD just before the last item, or at it
        if not self._profile.atomic:
            return True  # PX4 reports it after a take-off and a landing too
        end = to_enu(self._origin, last.x * 1e-7, last.y * 1e-7, last.z)
        return (telemetry.airborne and telemetry.mode is ModeFunction.HOLD
                and current == len(held) - 1
                and math.dist(telemetry.position, end) < last.params[1] + LOOSE_RADIUS)
