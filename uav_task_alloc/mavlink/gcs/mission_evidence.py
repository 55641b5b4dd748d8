# SPDX-License-Identifier: Apache-2.0
"""What the onboard mission says about the cause of a mode change."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.mavlink.gcs.authority_state import TaskMark
from uav_task_alloc.mavlink.gcs.boot_clock import CLOCK_RANGE
from uav_task_alloc.mavlink.gcs.onboard_mission import LATE_REACHED, OnboardMission
from uav_task_alloc.mavlink.gcs.resume import checksum
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.items import Item, alike
from uav_task_alloc.mavlink.mission.piece_mark import PieceMark
from uav_task_alloc.mavlink.mission.verified_mission import MissionState

_AHEAD = 10  # tasks that are recorded: more are not flown before a bridge is started again


class MissionEvidence:
    """A read-only view of one vehicle's onboard mission for the checks of authority.

    Args:
        onboard: the mission of the vehicle.
        telemetry: of the vehicle.
        atomic: whether a new mission is flown from its own first item, without a command (PX4).
    """

    def __init__(self, onboard: OnboardMission, telemetry: Telemetry, atomic: bool) -> None:
        self._onboard, self._telemetry, self._atomic = onboard, telemetry, atomic
        self._checksum: tuple[tuple[Item, ...], int] | None = None
        self._uploading: tuple[tuple[Item, ...], int] | None = None  # and their checksum
        self._ahead: tuple[tuple[Item, ...], int | None, tuple[TaskMark, ...]] = (), None, ()

    def ended(self, since: float) -> bool:
        """Whether REACHED of the last item was received at `since` [s] or later."""
        return self._onboard.progress.ended_at >= since

    def rejected(self, now: float) -> bool:
        """Whether the vehicle reports no valid mission just after it accepted ours (PX4)."""
        telemetry, onboard = self._telemetry, self._onboard
        return (telemetry.mission.state == d.MISSION_STATE_NO_MISSION
                and now - telemetry.mission.current_at < LATE_REACHED
                and (onboard.latest_upload.taken
                     or now - onboard.mission.verified_at < LATE_REACHED))

    def returning(self) -> bool:
        """Whether the item that returns or lands is next, is being flown, or is flown."""
        return self._onboard.progress.returning

    def returned_before(self, now: float, since: float) -> bool:
        """Whether the mission that was just replaced had come to its return.

        Args:
            now: steady time [s].
            since: from which [s] a REACHED of its last item counts.
        """
        progress = self._onboard.progress
        return progress.previous_returned(now, progress.ended_at >= since)

    def has_landed(self) -> bool:
        """Whether the mission has ended with a landing (PX4, which then changes to Hold)."""
        return self._onboard.progress.finished and self.returning()

    def holds_at_end(self) -> bool:
        """Whether it holds in the air after the last item of a mission that does not return."""
        progress, telemetry = self._onboard.progress, self._telemetry
        return (progress.finished and not progress.returns and telemetry.airborne
                and telemetry.mode is ModeFunction.HOLD)

    def may_end(self) -> bool:
        """Whether the last item with a position is being flown, or is passed."""
        return self._onboard.progress.may_end(self._telemetry.link.received_at)

    def verified(self) -> bool:
        """Whether the list is VERIFIED on board."""
        return self._onboard.verified()

    def ours(self) -> bool:
        """Whether the mission read back holds a task of the list, so that it is ours."""
        onboard = self._onboard
        if not onboard.held or onboard.tasks is None or not onboard.tasks.stops:
            return False
        items = [item for item in onboard.wanted() if item.completes]
        return any(alike(item, held) for item in items for held in onboard.held)

    def foreign(self) -> bool:
        """Whether another station has changed the verified mission."""
        return self._onboard.mission.is_foreign

    def position_time(self) -> float:
        """Vehicle time [s] of the newest position."""
        return self._onboard.progress.path.newest

    def last_positions(self) -> tuple[float, ...]:
        """Vehicle time [s], position [m] and velocity [m/s] received last; (): on the ground.

        Those before a gap come first, if the current item has not changed since.
        """
        if not self._telemetry.airborne:
            return ()
        return tuple(round(value, 3) for sample in self._onboard.progress.last_positions()
                     for value in (
                         sample.t % (1e-3 * CLOCK_RANGE), *sample.position, *sample.velocity))

    def mission_position(self) -> tuple[int | None, int | None, bool]:
        """Checksum of the onboard mission, index of the item being flown, and whether it is there.

        Checksum and index are None where they are not known.
        """
        progress = self._onboard.progress
        held = progress.items  # also while they are read back
        if not held or progress.current is None:
            return None, None, False
        if self._checksum is None or self._checksum[0] is not held:
            self._checksum = held, checksum(held)
        passed, current = progress.passed.in_order(), progress.current
        if passed:  # credited by a restarted bridge
            current = next((n for n, item in enumerate(held[:current]) if item.task in passed),
                           current)
        return self._checksum[1], current, progress.has_arrived(current)

    def passed(self) -> tuple[int, ...]:
        """`AuthorityRecord.passed`; () where none is open."""
        progress = self._onboard.progress
        tasks, left = progress.passed_in_flight
        if not tasks or progress.current is None:
            return ()
        seen = {item.task for item in progress.passed.seen()}
        held = [(n, item) for n, item in enumerate(progress.items[:progress.current])
                if item.task in tasks]
        return () if not held else (held[0][0], held[-1][0] + 1, left, *(
            n for n, item in held if item.completes and item.task in seen))

    def pieces(self) -> tuple[PieceMark, ...]:
        """The tasks whose ways are partly flown."""
        progress = self._onboard.progress
        return progress.coverage.marks(progress.completed)

    def ahead(self, current: int | None) -> tuple[TaskMark, ...]:
        """Return the next tasks on board, at most _AHEAD, after those that it was seen to pass.

        Those are flown: their REACHED may follow, and no index would name them to a restarted
        bridge that finds another mission on board.

        Args:
            current: of `mission_position`; None: it is not known.
        """
        held, seen = self._onboard.progress.items, self._onboard.progress.passed.seen()
        if current is not None and (self._ahead[0] is not held or self._ahead[1] != current):
            marks = [TaskMark(item.task, *item.position, 0.0, False) for item in held[current:]
                     if item.completes and item.position is not None]
            self._ahead = held, current, tuple(marks[:_AHEAD])
        ahead = self._ahead[2] if current is not None else ()
        if not seen:
            return ahead
        passed = [TaskMark(item.task, *item.place, 0.0, True) for item in seen
                  if item.place is not None and not item.along]
        return (*passed, *(mark for mark in ahead if all(mark.task != p.task for p in passed)))

    def uploading(self) -> tuple[int, ...]:
        """`AuthorityRecord.uploading`; () where the current item is of the mission on board."""
        items, start = self._onboard.progress.items, self._unset_start()
        if (diff := self._onboard.latest_upload.unknown) is not None:
            items, start = diff.items, diff.start
        if start is None:
            return ()
        if self._uploading is None or self._uploading[0] is not items:
            self._uploading = items, checksum(items)
        return self._uploading[1], start

    def _unset_start(self) -> int | None:
        """The item to be set on an ArduPilot whose current item may be of the mission before."""
        onboard = self._onboard
        if self._atomic:
            return None
        if onboard.item_to_set.seq is not None or onboard.stored is MissionState.VERIFIED:
            return onboard.item_to_set.seq
        return onboard.progress.current or 0
