# SPDX-License-Identifier: Apache-2.0
"""UAVs and homes inside zones: which UAV gets no tasks, has no safe path home, or a cut leg."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.allocator.state.callbacks import Note, RequestReplan
from uav_task_alloc.allocator.state.fleet import Fleet, UavRecord
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import GetSafePaths
from uav_task_alloc.errors import first_of
from uav_task_alloc.model import Point

_CLIMB = 5.0  # [m] above the ground: the first climb of every UAV, and the error of heights
_PERIOD = 0.5  # [s] between two checks of one UAV


class ZoneChecks:
    """Checks UAVs against the present zones; what is new requests a plan."""

    def __init__(self, fleet: Fleet, lists: PublishedLists, paths: GetSafePaths, note: Note,
                 request_replan: RequestReplan) -> None:
        self._fleet, self._lists, self._paths = fleet, lists, paths
        self._note, self._request_replan = note, request_replan
        self.stranded: dict[str, str] = {}  # UAV -> why it has no safe path home
        self._checked: dict[str, float] = {}  # UAV -> [s] of its last check
        self._zones_are_new = False

    def zones_changed(self) -> None:
        """Check all UAVs with the next `check_all`."""
        self._zones_are_new = True

    def check_all(self, now: float) -> None:
        """Check all UAVs if the zones changed."""
        if self._zones_are_new:
            self._zones_are_new = False
            for uav_id in self._fleet.records:
                self._check(uav_id, now)

    def check_reported(self, uav_id: str, now: float) -> None:
        """Check a UAV that has just reported, and its leg under way; twice a second at most."""
        if now - self._checked.get(uav_id, -_PERIOD) < _PERIOD:
            return
        self._checked[uav_id] = now
        self._check(uav_id, now)
        record, stops = self._fleet.records[uav_id], self._lists.get(uav_id).stops
        if (stops and not record.inside_zone and self._paths().rest(
                record.report.position, stops[0].through, stops[0].exit) is None):
            self._request_replan(f'leg of {uav_id} cut', now)

    def _check(self, uav_id: str, now: float) -> None:
        """Find which zones a UAV and its home are in.

        A UAV on the ground inside a zone, or with its home inside one, gets no tasks: it would
        climb into the zone, or return into it.
        """
        record, paths = self._fleet.records[uav_id], self._paths()
        on_ground, position = record.report.standby, record.report.position
        # a position on the ground drifts: a UAV has left a zone when it is well outside
        zone = (paths.around(position, _CLIMB, record.inside_zone) if on_ground
                else paths.around(position))
        home_zone = paths.around(record.home, _CLIMB, bool(record.home_zone))
        blocked = _blocked_on_ground(uav_id, zone, home_zone) if on_ground else ''
        self._fleet.set_zone(uav_id, zone, home_zone, blocked)
        if blocked != record.blocked_on_ground:
            self._note(f'{blocked}: it gets no tasks' if blocked else
                       f'{uav_id} may get tasks again: it is on the ground outside all zones',
                       bool(blocked))
            self._request_replan(blocked or f'{uav_id} is on the ground outside all zones', now)
        elif bool(zone) != record.inside_zone:
            where = 'inside' if zone else 'out of'
            self._note(f'{uav_id} is {where} a zone', warning=bool(zone))
            self._request_replan(f'{uav_id} {where} a zone', now)
        elif bool(home_zone) != bool(record.home_zone):
            where = 'inside' if home_zone else 'out of'
            self._request_replan(f'home of {uav_id} {where} a zone', now)

    def set_path_home(self, uav_id: str, exists: bool, start: Point) -> None:
        """Record whether a UAV has a safe path home from `start` [m]; logged when it changes."""
        record = self._fleet.records[uav_id]
        why = '' if exists else self._paths().why_none(start, record.home)
        before = self.stranded.pop(uav_id, '')
        if why:
            self.stranded[uav_id] = why
        if why == before:
            return
        if why:
            self._note(f'{uav_id} has no safe path home ({why}): its list ends with HOLD',
                       warning=True)
        else:
            self._note(f'{uav_id} has a safe path home again')

    def forget(self, uav_id: str) -> None:
        """Drop what is kept of a UAV."""
        self.stranded.pop(uav_id, None)
        self._checked.pop(uav_id, None)


def _blocked_on_ground(uav_id: str, zone: str, home_zone: str) -> str:
    if zone:
        return f'{uav_id} is on the ground inside zone {zone}'
    return f'the home of {uav_id} is inside zone {home_zone}' if home_zone else ''


def blocked_text(records: Iterable[UavRecord]) -> str:
    """Return which UAVs are on the ground inside which zones; '' if there are none.

    Args:
        records: of all UAVs.

    Returns:
        At most five UAVs by name, and how many more there are.
    """
    texts = sorted(record.blocked_on_ground for record in records if record.blocked_on_ground)
    return first_of(texts, separator='; ')
