# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs whose batteries allow few of the tasks expected go home for another battery.

They would stay in the air where tasks are expected and could not fly them; what is left of their
batteries is worth less than that they are back sooner.
"""
from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.allocator.replanning.waiting_places import WaitingPlaces
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.allocator.state.flights import OVERDUE
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Point

_CHECK = 5.0  # [s] between two checks
_SPENT = 0.5  # of a full battery: one with more than that above its way home is not changed
_ABLE = 0.5  # of the tasks that a full battery allows: with fewer it is changed
_AWAY = 1  # others that may be on their way to another battery, or get it, when one is sent
_LATEST = 100  # tasks of which the mean time at a task is taken


class BatteryChanges:
    """Sends idle UAVs home for another battery, and ends that where nobody changes it.

    Only UAVs that report a `turnaround` and a `full_range` and have had a list, and only where
    idle UAVs are sent to waiting places.

    Args:
        world: of the allocator.
        waiting: says which UAVs are idle, and where tasks are expected.

    Arguments of methods:
        now: [s] steady clock.
        stamp: [s] published clock.
    """

    def __init__(self, world: World, waiting: WaitingPlaces) -> None:
        self._world, self._waiting = world, waiting
        self._checked = -math.inf  # [s] steady clock

    def end(self, now: float, stamp: float) -> None:
        """Let UAVs have tasks that will not get another battery, or have an order.

        Those on their way home go on until they have tasks.
        """
        world = self._world
        for uav_id, record in world.fleet.awaiting_battery().items():
            why = self._why_ended(record, stamp)
            if why:
                world.fleet.end_change(uav_id)
                world.request_replan(f'{uav_id} waits for no other battery: {why}', now)

    def _why_ended(self, record: UavRecord, stamp: float) -> str:
        world, report = self._world, record.report
        if record.silent:
            return ''
        if report.standby:
            landed = world.flights.at_home_since(report.uav_id)
            overdue = landed is None or stamp - landed > OVERDUE * (report.turnaround or 0.0)
            return 'nobody changes it' if overdue else ''
        if not self._waiting.on:
            return 'no waiting places are wanted'
        if report.uav_id in world.zone_checks.stranded:
            return 'it has no safe path home'
        return 'an order' if self._waiting.is_ordered(report.uav_id) else ''

    def send(self, now: float, stamp: float) -> None:
        """Send one UAV at most home for another battery."""
        world = self._world
        if (now - self._checked < _CHECK or not world.kernels_ready or world.restart_hold
                or not self._waiting.on):
            return
        self._checked = now
        uav_id = self._least_able(stamp) if self._away(stamp) <= _AWAY else ''
        if uav_id:
            world.fleet.send_for_battery(uav_id)
            battery = world.uav_records()[uav_id].battery or 0.0
            world.note(f'{uav_id} goes home for another battery ({100.0 * battery:.0f} %)')
            world.request_replan(f'{uav_id} goes home for another battery', now)

    def _away(self, stamp: float) -> int:
        """UAVs that are on their way to another battery, or get it now."""
        world, found = self._world, 0
        for uav_id, record in world.uav_records().items():
            flies = not (record.report.standby or record.silent)
            found += bool(record.report.turnaround) and (record.low or record.awaits_battery) and (
                flies or world.flights.in_battery_change(uav_id, stamp))
        return found

    def _least_able(self, stamp: float) -> str:
        """The idle UAV to be sent: that with the least above its way home; '': none."""
        world, left = self._world, dict[str, float]()
        for uav_id in self._waiting.idle():
            record, uav = world.uav_records()[uav_id], world.uav(uav_id)
            if (record.battery is None or not record.report.turnaround or not uav.full_range
                    or uav_id not in world.lists_in_force()):
                continue
            metres = self._waiting.metres(uav_id) - math.dist(uav.position, record.home)
            if metres < _SPENT * uav.full_range:
                left[uav_id] = metres
        demand = self._waiting.demand(stamp) if left else None
        if demand is None:
            return ''
        places, weight = np.stack([demand[0].x, demand[0].y]), demand[1]
        stay = self._mean_stay()
        for uav_id in sorted(left, key=left.__getitem__):
            uav, home = world.uav(uav_id), world.uav_records()[uav_id].home
            stop = stay * uav.cruise_speed
            if world.airspace.paths().leg(uav.position, home) is None:
                continue
            here = _able(places, weight, uav.position, home, self._waiting.metres(uav_id) - stop)
            full = _able(places, weight, home, home, (uav.full_range or 0.0) - stop)
            if here < _ABLE * full:
                return uav_id
        return ''

    def _mean_stay(self) -> float:
        """The mean time at a task [s] of those known last."""
        records = tuple(self._world.task_records().values())
        known = [record.task.stay for record in records[-_LATEST:]]
        return math.fsum(known) / len(known) if known else 0.0


def _able(places: NDArray[np.float64], weight: NDArray[np.float64], start: Point, home: Point,
          metres: float) -> float:
    """The share of tasks to which a UAV can fly, and home from there, within metres."""
    there, back = (np.hypot(places[0] - x, places[1] - y) for x, y, _ in (start, home))
    return float(weight[there + back <= metres].sum())
