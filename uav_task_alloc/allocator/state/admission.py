# SPDX-License-Identifier: Apache-2.0
"""Which UAVs are known: new ones up to a limit; unconfirmed ones are forgotten after a silence.

A UAV is confirmed when it reports that it holds a list with tasks of this allocator, or the
progress of one. A confirmed UAV is never removed, silent or not: a flood of invented ids cannot
displace it.
"""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.records import UavReport
from uav_task_alloc.allocator.state.callbacks import Note
from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.published_lists import PublishedLists

MAX_UAVS = 1000  # known at once
FORGET_AFTER = 300.0  # [s] of silence after which an unconfirmed UAV is forgotten
CHECK_PERIOD = 10.0  # [s] between two checks for such


class Admission:
    """Decides which UAVs are known. `full`: why no UAV is admitted, '' while there is room.

    `forget_uav(uav_id)` removes a UAV from the whole world.
    """

    def __init__(self, fleet: Fleet, lists: PublishedLists, note: Note,
                 forget_uav: Callable[[str], None]) -> None:
        self._fleet, self._lists = fleet, lists
        self._note, self._forget_uav = note, forget_uav
        self.full = ''
        self._began = self._next_check = 0.0  # [s] of the first check, and of the next one

    def admit(self, uav_id: str) -> str:
        """Make room for a UAV that is not known; returns why there is none, '' if there is.

        The unconfirmed UAV that is silent for longest is forgotten.
        """
        records = self._fleet.records
        if len(records) < MAX_UAVS:
            self.full = ''
            return ''
        silent = [known for known, record in records.items()
                  if record.silent and self._is_unconfirmed(known)]
        if silent:
            self._forget_uav(min(silent, key=lambda known: records[known].received))
            return ''
        if not self.full:
            self.full = (f'UAVs = {MAX_UAVS}: expected fewer; a new one is refused until another '
                         'is forgotten')
            self._note(f'{uav_id}: {self.full}', warning=True)
        return f'uav_id = {uav_id!r}: expected one of the {MAX_UAVS} UAVs known already'

    def confirm(self, report: UavReport) -> None:
        """Confirm a UAV that holds the list in force, if that has tasks."""
        published = self._lists.get(report.uav_id)
        if published.stops and report.list_revision == published.revision:
            self._fleet.confirmed.add(report.uav_id)

    def forget_unconfirmed(self, now: float) -> None:
        """Forget UAVs after a long silence, and lists of the journal whose UAVs never reported."""
        if now < self._next_check:
            return
        first, self._next_check = self._next_check == 0.0, now + CHECK_PERIOD
        if first:
            self._began = now
        records = self._fleet.records
        for uav_id in {*records, *self._lists.lists}:
            received = records[uav_id].received if uav_id in records else self._began
            if now - received > FORGET_AFTER and self._is_unconfirmed(uav_id):
                self._forget_uav(uav_id)

    def _is_unconfirmed(self, uav_id: str) -> bool:
        return uav_id not in self._fleet.confirmed and not self._lists.get(uav_id).stops
