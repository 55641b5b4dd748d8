# SPDX-License-Identifier: Apache-2.0
"""The book of UAVs: what each said last, who is silent, who may be given tasks."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.model import Point, Task, Uav

FASTEST = 10.0  # times the cruise speed: nobody flies so fast, not even in faster simulations
RECHARGED = 0.1  # above the reserve: a battery that was low is good again


@dataclass(frozen=True, slots=True)
class UavRecord:
    """One UAV that was heard."""

    report: UavReport
    heard: float  # [s] steady clock
    home: Point  # [m] ENU: as reported, else where it was first heard
    silent: bool = False
    zone: str = ''  # that it is inside
    home_zone: str = ''  # that its home is inside
    standing: str = ''  # why it gets no tasks on the ground: who stands inside which zone
    battery: float | None = None  # [0..1] last told
    low: bool = False  # the battery was below the reserve and is not recharged
    jumped: float = -math.inf  # [s] steady clock: the position last jumped

    @property
    def caught(self) -> bool:
        """It is inside a zone."""
        return bool(self.zone)

    @property
    def ready(self) -> bool:
        """It speaks, has battery, and says that it may be given tasks."""
        return self.report.available and not self.silent and not self.low

    @property
    def usable(self) -> bool:
        """It is ready, and does not stand inside a zone."""
        return self.ready and not self.standing


class Fleet:
    """UAVs by id; what an operator switched off stays off until he switches it on."""

    def __init__(self, off: Iterable[str] = (), active: Mapping[str, str] | None = None) -> None:
        self.records: dict[str, UavRecord] = {}
        self.off = set(off)
        self.active = dict(active or {})  # UAV -> the task it is known to be flying
        self.proven: set[str] = set()  # they hold lists of ours, or have told of a task

    def hear(self, report: UavReport, now: float, reserve: float = 0.0) -> UavRecord | None:
        """Take a report in; returns what was known before. reserve: of the battery [0..1]."""
        uav_id, before = report.uav_id, self.records.get(report.uav_id)
        battery, low = _battery(before, report.battery, reserve)
        if report.active_task:
            self.active[uav_id] = report.active_task
        self.records[uav_id] = UavRecord(
            report, now, report.home or (before.home if before else report.position),
            battery=battery, low=low)
        if before:
            self.records[uav_id] = replace(
                self.records[uav_id], zone=before.zone, home_zone=before.home_zone,
                standing=before.standing, jumped=before.jumped)
        return before

    def forget(self, uav_id: str) -> None:
        """It is not known any more; that it is switched off stays."""
        self.records.pop(uav_id, None)
        self.active.pop(uav_id, None)
        self.proven.discard(uav_id)

    def fall_silent(self, now: float, timeout: float) -> list[str]:
        """Mark those not heard for `timeout` [s]; returns the newly silent."""
        lost = [uav_id for uav_id, record in self.records.items()
                if not record.silent and now - record.heard > timeout]
        for uav_id in lost:
            self.records[uav_id] = replace(self.records[uav_id], silent=True)
            self.active.pop(uav_id, None)
        return lost

    def set_jumped(self, uav_id: str, now: float) -> None:
        """Its position jumped."""
        self.records[uav_id] = replace(self.records[uav_id], jumped=now)

    def set_zone(self, uav_id: str, zone: str, home_zone: str, standing: str) -> None:
        """The zones that it and its home are inside, and why it gets no tasks for that."""
        self.records[uav_id] = replace(self.records[uav_id], zone=zone, home_zone=home_zone,
                                       standing=standing)

    def usable(self, uav_id: str) -> bool:
        """It is heard, available, does not stand inside a zone, and is not switched off."""
        record = self.records.get(uav_id)
        return record is not None and record.usable and uav_id not in self.off

    def standing(self) -> list[UavRecord]:
        """Those that would be usable, if they did not stand inside a zone."""
        return [record for uav_id, record in self.records.items()
                if record.standing and record.ready and uav_id not in self.off]

    def uav(self, uav_id: str, default_range: float, default_cruise_speed: float) -> Uav:
        """As the solver sees it; an unknown range [m] or speed [m/s] is the default."""
        record = self.records[uav_id]
        report = record.report
        return Uav(uav_id, report.position,
                   range=default_range if report.range is None else report.range,
                   cruise_speed=report.cruise_speed or default_cruise_speed,
                   capabilities=report.capabilities, home=record.home)


def _battery(before: UavRecord | None, told: float | None,
             reserve: float) -> tuple[float | None, bool]:
    """What is left, and whether that is too little; a UAV that tells nothing stays as it was."""
    known, was_low = (before.battery, before.low) if before else (None, False)
    if told is None or (told == 0.0 and known is None):  # 0: a field that nobody has set
        return known, was_low
    return told, told < reserve + (RECHARGED if was_low else 0.0)


def may_fly(task: Task, failed_on: Iterable[str], uav: UavReport) -> bool:
    """The UAV is allowed to, able to, and has not failed at it before."""
    return ((task.allowed_uavs is None or uav.uav_id in task.allowed_uavs)
            and task.required_capabilities <= uav.capabilities and uav.uav_id not in failed_on)


def news_of(before: UavRecord | None, after: UavRecord) -> list[str]:
    """What in a report asks for a new plan."""
    report, found = after.report, []
    if before is None or before.silent:
        found += ['heard again' if before else 'heard'] if report.available else []
    elif before.report.available != report.available:
        found += ['available' if report.available else 'not available']
    elif before.report.capabilities != report.capabilities:
        found += ['has other capabilities']
    if after.low != (before is not None and before.low):
        found += [f'battery {100.0 * (after.battery or 0.0):.0f} %: ' + (
            'below the reserve, it goes home' if after.low else 'above the reserve again')]
    return found


def jump(before: UavRecord | None, report: UavReport, now: float, speed: float,
         most: float) -> float:
    """Metres since the last report, where they are `most` more than it can have flown; else 0."""
    if before is None or before.silent:
        return 0.0
    metres = math.dist(before.report.position, report.position)
    return metres if metres > most + FASTEST * speed * (now - before.heard) else 0.0
