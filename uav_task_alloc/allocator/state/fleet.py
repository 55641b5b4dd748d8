# SPDX-License-Identifier: Apache-2.0
"""The known UAVs: the last report of each, which are silent, which may be given tasks."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.orders import Orders
from uav_task_alloc.errors import first_of
from uav_task_alloc.model import Point, Task, Uav
from uav_task_alloc.params import AllocatorParams

_MAX_NAMED = 5  # UAVs in a reason
LEAST_ENDURANCE = 1.0  # [s] of a UAV that has none left
_RECHARGED = 0.1  # [0..1] above the reserve: a battery that was low is good again


@dataclass(frozen=True, slots=True)
class UavRecord:
    """One UAV that has reported."""

    report: UavReport  # the last one
    received: float  # [s] steady clock: of the last report
    home: Point  # [m] ENU: as reported, else the position of the first report
    silent: bool = False  # for longer than `uav_timeout`
    zone: str = ''  # id of the zone that it is inside
    home_zone: str = ''  # id of the zone that its home is inside
    blocked_on_ground: str = ''  # why it gets no tasks: it or its home is inside a zone
    battery: float | None = None  # [0..1] last reported
    low: bool = False  # the battery was below the reserve and is not recharged
    turned: bool = False  # its battery required the way home; until it is on the ground
    # [0..1] charge from which on its battery was changed, for which it was sent home; None: it
    # was not sent, or has it
    change_from: float | None = None

    @property
    def inside_zone(self) -> bool:
        """Whether it is inside a zone."""
        return bool(self.zone)

    @property
    def ready(self) -> bool:
        """Whether it reports, has battery, and is available for tasks."""
        return self.report.available and not (self.silent or self.low or self.awaits_battery)

    @property
    def awaits_battery(self) -> bool:
        """Whether it was sent home for another battery, and does not have it yet."""
        return self.change_from is not None

    @property
    def usable(self) -> bool:
        """Whether it is ready, and not on the ground inside a zone."""
        return self.ready and not self.blocked_on_ground


class Fleet:
    """UAVs by id; what an operator switched off stays off until it is switched on.

    Args:
        off: ids of UAVs that an operator has switched off.
        active: by UAV id the task that it is known to fly.
        orders: of operators; None: there are none.
        change_from: as restored, see `UavRecord.change_from`, by UAV id.

    Attributes:
        unsaved: ids of the UAVs whose `change_from` is not on disk.

    Arguments of methods:
        uav_id: of a UAV, known or not.
        task: with allowed UAVs and required capabilities.
        failed_on: ids of the UAVs that failed at it.
        params: of the allocator.
    """

    def __init__(self, off: Iterable[str] = (), active: Mapping[str, str] | None = None,
                 orders: Orders | None = None,
                 change_from: Mapping[str, float] | None = None) -> None:
        self.records: dict[str, UavRecord] = {}
        self.switched_off = set(off)
        self.orders = orders or Orders()
        self.change_from, self.unsaved = dict(change_from or {}), set[str]()
        self.active = dict(active or {})  # UAV -> task it is known to be flying
        self.confirmed: set[str] = set()  # held a list of ours, or reported progress of a task

    def update(self, report: UavReport, now: float, reserve: float = 0.0) -> UavRecord | None:
        """Store a report.

        Args:
            report: of a UAV, known or not.
            now: [s] steady clock.
            reserve: battery [0..1] below which a UAV gets no tasks.

        Returns:
            The record before; None where the UAV was not known.
        """
        uav_id, before = report.uav_id, self.records.get(report.uav_id)
        battery, low = _battery(before, report.battery, reserve)
        turned = before is not None and before.turned and not report.standby
        if report.active_task:
            self.active[uav_id] = report.active_task
        self.records[uav_id] = UavRecord(
            report, now, report.home or (before.home if before else report.position),
            battery=battery, low=low or turned, turned=turned,
            change_from=self.change_from.get(uav_id))
        if before:
            self.records[uav_id] = replace(
                self.records[uav_id], zone=before.zone, home_zone=before.home_zone,
                blocked_on_ground=before.blocked_on_ground)
        if battery is not None and battery >= self.change_from.get(uav_id, math.inf):
            self.end_change(uav_id)
        return before

    def forget(self, uav_id: str) -> None:
        """Remove a UAV; that it is switched off stays."""
        self.records.pop(uav_id, None)
        self.active.pop(uav_id, None)
        self.confirmed.discard(uav_id)
        if self.change_from.pop(uav_id, None) is not None:
            self.unsaved.add(uav_id)

    def mark_silent(self, now: float, timeout: float) -> list[str]:
        """Mark UAVs without a report for `timeout` [s]; returns the newly silent ones."""
        lost = [uav_id for uav_id, record in self.records.items()
                if not record.silent and now - record.received > timeout]
        for uav_id in lost:
            self.records[uav_id] = replace(self.records[uav_id], silent=True)
            self.active.pop(uav_id, None)
        return lost

    def turn(self, uav_id: str) -> None:
        """Send a UAV in flight home: its battery lasts for that, and for the reserve."""
        self.records[uav_id] = replace(self.records[uav_id], low=True, turned=True)

    def send_for_battery(self, uav_id: str) -> None:
        """Send a UAV in flight home for another battery; it gets no tasks until it has it."""
        self._set_change(uav_id, min(1.0, (self.records[uav_id].battery or 0.0) + _RECHARGED))

    def awaiting_battery(self) -> dict[str, UavRecord]:
        """Return the UAVs that were sent home for another battery, and do not have it yet."""
        return {uav_id: record for uav_id, record in self.records.items()
                if record.awaits_battery}

    def end_change(self, uav_id: str) -> None:
        """Let a UAV have tasks with the battery that it has."""
        self._set_change(uav_id, None)

    def _set_change(self, uav_id: str, change_from: float | None) -> None:
        self.records[uav_id] = replace(self.records[uav_id], change_from=change_from)
        self.unsaved.add(uav_id)
        if change_from is None:
            self.change_from.pop(uav_id, None)
        else:
            self.change_from[uav_id] = change_from

    def set_zone(self, uav_id: str, zone: str, home_zone: str, blocked_on_ground: str) -> None:
        """Record the zones that a UAV and its home are inside, and why it gets no tasks."""
        self.records[uav_id] = replace(self.records[uav_id], zone=zone, home_zone=home_zone,
                                       blocked_on_ground=blocked_on_ground)

    def ready(self, uav_id: str) -> bool:
        """Return whether a UAV could fly tasks: known, usable, and not switched off."""
        record = self.records.get(uav_id)
        return record is not None and record.usable and uav_id not in self.switched_off

    def usable(self, uav_id: str) -> bool:
        """Return whether a UAV may be given tasks: ready, and neither paused nor ordered home."""
        return self.ready(uav_id) and self.orders.of_uav(uav_id) is None

    def why_unusable(self, uav_id: str) -> str:
        """Return why a UAV may not be given tasks; '' if it may."""
        record, order = self.records.get(uav_id), self.orders.of_uav(uav_id)
        if record is None:
            return f'{uav_id} has not reported yet'
        if record.silent:
            return f'{uav_id} is silent'
        if order is not None:
            return f'{uav_id} has the order to {order.kind.value} ({order.name})'
        if record.low:
            return f'{uav_id} is low on battery'
        if record.awaits_battery:
            return f'{uav_id} goes home for another battery'
        return '' if self.usable(uav_id) else (
            record.blocked_on_ground or f'{uav_id} is not available')

    def usable_ids(self) -> list[str]:
        """Return the UAVs that may be given tasks."""
        return [uav_id for uav_id in self.records if self.usable(uav_id)]

    def why_none_usable(self) -> str:
        """Return that no UAV may be given tasks, and why each of the first may not."""
        why = [self.why_unusable(uav_id) for uav_id in sorted(self.records)]
        return f'no UAV available: {first_of(why, _MAX_NAMED)}'

    def blocked_on_ground(self) -> list[UavRecord]:
        """Return those that would be usable, were they or their homes not inside a zone."""
        return [record for uav_id, record in self.records.items()
                if record.blocked_on_ground and record.ready
                and uav_id not in self.switched_off]

    def uav(self, uav_id: str, params: AllocatorParams) -> Uav:
        """Return a UAV for the solver; an unknown range or speed is that of the parameters.

        Range and endurance are those above the reserve of its battery.
        """
        record = self.records[uav_id]
        report, reserve = record.report, params.battery_reserve
        metres, seconds = above_reserve(report, record.battery, reserve)
        full = 1.0 if record.battery is None else 1.0 - reserve
        full_seconds = _full_endurance(report)
        return Uav(uav_id, report.position,
                   range=params.default_range if metres is None else metres,
                   cruise_speed=report.cruise_speed or params.default_cruise_speed,
                   capabilities=report.capabilities, home=record.home,
                   climb_speed=report.climb_speed or params.default_climb_speed,
                   descent_speed=report.descent_speed or params.default_descent_speed,
                   endurance=math.inf if seconds is None else seconds,
                   payload_capacity=report.payload_capacity or 0.0,
                   full_range=report.full_range and full * report.full_range,
                   turnaround=report.turnaround or math.inf,
                   full_endurance=full_seconds and full * full_seconds)

    def may_fly(self, uav_id: str, task: Task, failed_on: Iterable[str]) -> bool:
        """Return whether a known UAV may be given a task, see `may_fly`, and orders allow it."""
        return self.orders.allows(uav_id, task.id) and may_fly(
            task, failed_on, self.records[uav_id].report)


def above_reserve(report: UavReport, battery: float | None,
                  reserve: float) -> tuple[float | None, float | None]:
    """Return what a UAV may fly before its battery is down to the reserve.

    Args:
        report: with its range, endurance and range with a full battery.
        battery: [0..1]; None: unknown, and all that it reports may be flown.
        reserve: [0..1].

    Returns:
        Metres and seconds; None where they are not known.
    """
    if battery is None:
        return report.range, report.endurance
    share = max(0.0, 1.0 - reserve / max(battery, 1e-6))
    metres = None if report.range is None else share * report.range
    if report.range and report.full_range:
        metres = max(0.0, report.range - reserve * report.full_range)
        share = metres / report.range
    return metres, None if report.endurance is None else max(LEAST_ENDURANCE,
                                                              share * report.endurance)


def _full_endurance(report: UavReport) -> float | None:
    """With a full battery [s]; it grows as the range does. None: unknown."""
    if report.endurance is None or not report.range or report.full_range is None:
        return None
    return report.endurance * max(1.0, report.full_range / report.range)


def _battery(before: UavRecord | None, reported: float | None,
             reserve: float) -> tuple[float | None, bool]:
    """The charge, and whether it is too low; without a reported one they stay as they were."""
    known, was_low = (before.battery, before.low) if before else (None, False)
    if reported is None or (reported == 0.0 and known is None):  # 0: a field that was never set
        return known, was_low
    return reported, reported < reserve + (_RECHARGED if was_low else 0.0)


def may_fly(task: Task, failed_on: Iterable[str], uav: UavReport) -> bool:
    """Return whether a UAV is allowed and able to fly a task, and has not failed at it before.

    Args:
        task: with its allowed UAVs and required capabilities.
        failed_on: ids of the UAVs that failed at it.
        uav: last report.

    Returns:
        Range and availability are not considered.
    """
    return ((task.allowed_uavs is None or uav.uav_id in task.allowed_uavs)
            and task.required_capabilities <= uav.capabilities and uav.uav_id not in failed_on)


def replan_reasons(before: UavRecord | None, after: UavRecord,
                   unlisted: Callable[[], bool]) -> list[str]:
    """Return what in a new report requires a plan; `unlisted`: whether a task is in no list."""
    report, reasons = after.report, []
    if before is None or before.silent:
        reasons += ['reports again' if before else 'reports'] if report.available else []
    elif before.report.available != report.available:
        reasons += ['available' if report.available else 'not available']
    elif before.report.capabilities != report.capabilities:
        reasons += ['has other capabilities']
    if before is not None and before.awaits_battery and not after.awaits_battery:
        reasons += ['has another battery']
    if after.low != (before is not None and before.low):
        reasons += [f'battery {100.0 * (after.battery or 0.0):.0f} %: ' + (
            'below the reserve, it returns home' if after.low else 'above the reserve again')]
    if before is None or reasons:
        return reasons
    can_more = _can_more(before, after)
    return [can_more] if can_more and unlisted() else []


def _can_more(before: UavRecord, after: UavRecord) -> str:
    """Why a UAV may be able to fly tasks that it could not fly before; '' where it is not."""
    if after.report.standby and not before.report.standby:
        return 'is on the ground'  # it takes payloads on
    if after.battery is not None and before.battery is not None and (
            after.battery >= before.battery + _RECHARGED):
        return 'has another battery'
    return ''
