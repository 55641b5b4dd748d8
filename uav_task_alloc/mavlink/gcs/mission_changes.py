# SPDX-License-Identifier: Apache-2.0
"""What has to change in the mission on board of a vehicle so that its list is flown."""
from __future__ import annotations

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.diff import DiffKind, LatestDiff, MissionDiff, diff_missions
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.wanted_mission import WantedMission


class MissionChanges:
    """Compares the list of a vehicle with the items on board.

    Args:
        wanted: the list, as mission items.
        progress: of the mission on board.
        telemetry: of the vehicle.
        profile: of its autopilot.
    """

    def __init__(self, wanted: WantedMission, progress: ProgressTable, telemetry: Telemetry,
                 profile: Profile) -> None:
        self._list, self._progress = wanted, progress
        self._telemetry, self._profile = telemetry, profile
        self._latest = LatestDiff()

    def needed(self, held: tuple[Item, ...]) -> MissionDiff:
        """Return what to change on board.

        Args:
            held: the items on board, without home.
        """
        wanted, current, telemetry = self._list.items(), self._progress.current, self._telemetry
        holds = telemetry.mode is ModeFunction.HOLD and telemetry.airborne
        if holds and telemetry.has_position and self._progress.coverage.must_begin(
                self._progress.active, telemetry.position):
            current = None  # it would fly on along a way from where it was held
        diff = self._latest.of(held, current, wanted, self._progress.done)
        if self._list.horizon.stops is not None and diff.kind is not DiffKind.KEEP:
            if self._list.has_enough(held):
                return MissionDiff(DiffKind.KEEP, held, current or 0)
            if self._list.horizon.grow():
                return self.needed(held)
        if 0 < diff.start == len(diff.items) - 1 and self._profile.atomic and (
                telemetry.disarmed_since_mission):
            return MissionDiff(DiffKind.REPLACE, wanted, 0)  # PX4 would begin at its first item
        room = self._profile.rules.capacity - int(self._profile.rules.home_first)
        if diff.kind is DiffKind.APPEND and (self._profile.atomic or len(diff.items) > room):
            return diff_missions(held, current, wanted, append=False)
        return diff

    def can_continue(self, held: tuple[Item, ...]) -> bool:
        """Whether the list can be flown with a mission without replacing it.

        Args:
            held: its items, without home.
        """
        wanted = self._list.items()
        return bool(wanted) and diff_missions(
            held, None, wanted, done=self._progress.completed).kind is not DiffKind.REPLACE
