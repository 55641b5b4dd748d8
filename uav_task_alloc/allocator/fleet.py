# SPDX-License-Identifier: Apache-2.0
"""The book of UAVs: what each said last, who is silent, who may be given tasks."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.model import Point, Task, Uav


@dataclass(frozen=True, slots=True)
class UavRecord:
    """One UAV that was heard."""

    report: UavReport
    heard: float  # [s] steady clock
    home: Point  # [m] ENU: as reported, else where it was first heard
    silent: bool = False
    active: str = ''  # the task it is known to be flying
    caught: bool = False  # inside a zone

    @property
    def usable(self) -> bool:
        """It speaks and says that it may be given tasks."""
        return self.report.available and not self.silent


class Fleet:
    """UAVs by id; what an operator switched off stays off until he switches it on."""

    def __init__(self, off: Iterable[str] = ()) -> None:
        self.records: dict[str, UavRecord] = {}
        self.off = set(off)

    def hear(self, report: UavReport, now: float) -> UavRecord | None:
        """Take a report in; returns what was known before."""
        before = self.records.get(report.uav_id)
        home = report.home or (before.home if before else report.position)
        active = report.active_task or (before.active if before else '')
        self.records[report.uav_id] = UavRecord(
            report, now, home, active=active, caught=before.caught if before else False)
        return before

    def fall_silent(self, now: float, timeout: float) -> list[str]:
        """Mark those not heard for `timeout` [s]; returns the newly silent."""
        lost = [uav_id for uav_id, record in self.records.items()
                if not record.silent and now - record.heard > timeout]
        for uav_id in lost:
            self.records[uav_id] = replace(self.records[uav_id], silent=True, active='')
        return lost

    def set_active(self, uav_id: str, task_id: str) -> None:
        """It is known to fly this task now; '' where to none."""
        self.records[uav_id] = replace(self.records[uav_id], active=task_id)

    def set_caught(self, uav_id: str, caught: bool) -> None:
        """It is inside a zone, or out again."""
        self.records[uav_id] = replace(self.records[uav_id], caught=caught)

    def usable(self, uav_id: str) -> bool:
        """It is heard, available, and not switched off."""
        record = self.records.get(uav_id)
        return record is not None and record.usable and uav_id not in self.off

    def uav(self, uav_id: str, default_range: float, default_cruise_speed: float) -> Uav:
        """As the solver sees it; an unknown range [m] or speed [m/s] is the default."""
        record = self.records[uav_id]
        report = record.report
        return Uav(uav_id, report.position,
                   range=default_range if report.range is None else report.range,
                   cruise_speed=report.cruise_speed or default_cruise_speed,
                   capabilities=report.capabilities, home=record.home)


def may_fly(task: Task, failed_on: Iterable[str], uav: UavReport) -> bool:
    """The UAV is allowed to, able to, and has not failed at it before."""
    return ((task.allowed_uavs is None or uav.uav_id in task.allowed_uavs)
            and task.required_capabilities <= uav.capabilities and uav.uav_id not in failed_on)
