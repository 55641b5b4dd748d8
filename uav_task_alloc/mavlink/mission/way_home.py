# SPDX-License-Identifier: Apache-2.0
"""How a list ends that returns: by the vehicle's own return, along the list, or not at all.

A return by the autopilot climbs to its own height and knows no zone. Where it would enter one, the
mission goes home at the height of its last point and lands there; where a zone is in that way,
too, it ends with a hold.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from uav_task_alloc.geometry.level_paths import zone_at_heights, zone_on_return
from uav_task_alloc.geometry.zones_on_path import zone_across_path
from uav_task_alloc.mavlink.mission.task_list import TaskList
from uav_task_alloc.model import Point, ThreatZone

_ABOVE_HOME = 1.0  # [m] horizontally: a way that ends there ends with a landing
_DESCENDS = 5.0  # [m] horizontally from home: a return does not climb any more
_LEAST_HEIGHT = 5.0  # [m] above home of a level way to it


class WayHome:
    """The end of the list of one vehicle.

    Args:
        lands: whether a mission of it can end with a landing.
        home: [m] ENU; None: not known.
    """

    def __init__(self, lands: bool, home: Callable[[], Point | None]) -> None:
        self.zones: Callable[[], tuple[ThreatZone, ...]] = tuple  # in force
        # [m] above home to which it returns; NaN: not known
        self.return_height: Callable[[], float] = lambda: math.nan
        self.blocked = ''  # why it does not go home; '': it does, or is not to
        self._lands, self._home = lands, home
        self._added: tuple[Point, ...] = ()  # [m] to the end of the list
        self._start: Point | None = None  # [m] of the vehicle when it got the list
        self._last: Point | None = None  # [m] of the list, before its way home

    @property
    def key(self) -> object:
        """What the end of a list depends on, besides the list."""
        return self.zones(), self._home(), self.return_height()

    def begin(self, place: Point | None) -> None:
        """Take another list.

        Args:
            place: of the vehicle [m] ENU; None: not known.
        """
        self._start, self._last = place, None

    def of(self, tasks: TaskList) -> TaskList:
        """Return what is still to be flown with an end that enters no zone.

        Args:
            tasks: the rest of the list.

        Returns:
            The rest itself where its own end is safe.
        """
        self.blocked, home = '', self._home()
        points = [stop.end for stop in tasks.stops[-1:]] + list(tasks.tail)
        self._last = points[-1] if points else self._last
        last = self._last or self._start
        zone = self._zone_in_way(tasks, last, home)
        if zone is None or last is None or home is None:
            self._added = ()
            return tasks
        self._added = self._level_way(last, home)
        if self._added:
            return replace(tasks, end_via=(*tasks.tail, *self._added))
        self.blocked = f'zone {zone.id} is in its way home: it holds at the end of its list'
        # without points the vehicle holds where it is: see `EndOfList`
        return replace(tasks, returns=False, end_via=()) if points else tasks

    def _zone_in_way(self, tasks: TaskList, last: Point | None,
                     home: Point | None) -> ThreatZone | None:
        """The zone that the end of a list enters; None: none, or nothing is known."""
        if not (self.zones() and tasks.returns) or last is None or home is None:
            return None
        if self._last is not None and math.isnan(self.return_height()):
            return None  # it is read soon
        if self._lands and tasks.end_via and math.dist(last[:2], home[:2]) <= _ABOVE_HOME:
            return None
        return self.zone_on_return(last, home)

    def zone_on_return(self, place: Point, home: Point) -> ThreatZone | None:
        """Find a zone that the vehicle's own return enters.

        Args:
            place: where it begins [m] ENU.
            home: [m] ENU.

        Returns:
            The first one; at any height where that of its return is not known. None: it is clear.
        """
        height = self.return_height()
        if math.isnan(height):
            return zone_across_path(place, home, self.zones())
        return zone_on_return(place, home, height, self.zones())

    def zone_before(self, place: Point, home: Point) -> ThreatZone | None:
        """Find a zone, without its margin, that a return which is being flown still enters.

        A zone around the vehicle does not count, as its way leads out of it. Above home it only
        descends.

        Args:
            place: of the vehicle [m] ENU.
            home: [m] ENU.

        Returns:
            The first one; None: the rest of the return is clear.
        """
        bare = [replace(zone, margin=0.0) for zone in self.zones()]
        zones = [zone for zone in bare
                 if zone_at_heights(place, place, place[2], place[2], (zone,)) is None]
        if math.dist(place[:2], home[:2]) <= _DESCENDS:
            low, high = sorted((place[2], home[2]))
            return zone_at_heights(place, home, low, high, zones)
        height = self.return_height()
        if math.isnan(height):
            return zone_across_path(place, home, zones)
        return zone_on_return(place, home, height, zones)

    def _level_way(self, last: Point, home: Point) -> tuple[Point, ...]:
        """Where it descends, above home; (): there is a zone in that way, too."""
        above, zones = self._added or ((home[0], home[1], last[2]),), self.zones()
        height = above[-1][2]
        if not self._lands or height < home[2] + _LEAST_HEIGHT:
            return ()
        low, high = sorted((last[2], height))
        if zone_at_heights(last, home, low, high, zones) is not None or (
                zone_at_heights(home, home, home[2], height, zones) is not None):
            return ()
        return above
