# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs that others hold for fly out of their way; in doubt they stay where they are."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.waiting_places import WaitingPlaces
from uav_task_alloc.allocator.separation_watch import SeparationWatch
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Point

_CHECK = 1.0  # [s] of the steady clock between two checks
_PATIENCE = 3.0  # [s] in the way before it is sent away: the others may hold for another reason
_AGAIN = 10.0  # [s] between two searches for a place for one UAV
_DISTANCES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0)  # times the horizontal distance, tried in this order
_DIRECTIONS = 16
_SHARE = 0.95  # of what a battery has above the reserve that the way there and home may take
_RESTS = 1.0  # [m/s] below that it stands


class GivingWay:
    """Sends idle UAVs out of the way of those that hold for them.

    Never without an operator who approves plans.

    Args:
        world: of the allocator.
        waiting: which UAVs are idle, and their lists without tasks.
        watch: which UAVs hold for which ones.
    """

    def __init__(self, world: World, waiting: WaitingPlaces, watch: SeparationWatch) -> None:
        self._world, self._waiting, self._watch = world, waiting, watch
        self._checked = -math.inf  # [s] steady clock
        self._since: dict[str, float] = {}  # [s] steady clock when it got into the way, by id
        self._searched: dict[str, float] = {}  # [s] steady clock of the last search, by id

    def lists(self, now: float, stamp: float) -> dict[str, UavList]:
        """Return a list for one UAV that is in the way, where a place was found for it.

        Args:
            now: [s] steady clock.
            stamp: [s] published clock.

        Returns:
            By id; without tasks, see `UavList.waiting_place`.
        """
        world = self._world
        if now - self._checked < _CHECK:
            return {}
        self._checked = now
        if world.params.approval != 'none' or world.restart_hold or not world.kernels_ready:
            return {}
        waited_for = self._watch.waited_for()
        self._since = {uav_id: self._since.get(uav_id, now) for uav_id in waited_for}
        self._searched = {uav_id: at for uav_id, at in self._searched.items()
                          if uav_id in waited_for}
        idle = self._waiting.idle() if waited_for else ()
        for uav_id in sorted(waited_for.keys() & {*idle}):
            if self._is_due(uav_id, now):
                self._searched[uav_id] = now
                return self._sent_away(uav_id, waited_for[uav_id], stamp)
        return {}

    def _is_due(self, uav_id: str, now: float) -> bool:
        velocity = self._world.uav_records()[uav_id].report.velocity
        return (now - self._since[uav_id] >= _PATIENCE
                and now - self._searched.get(uav_id, -math.inf) >= _AGAIN
                and math.hypot(*(velocity or (0.0,))) < _RESTS)

    def _sent_away(self, uav_id: str, other: str, stamp: float) -> dict[str, UavList]:
        """The list of a UAV to the first place that is in nobody's way; {}: there is none."""
        world = self._world
        allows, why = self._free_places(uav_id, stamp), 'all places near it are in the way'
        for place in self._places(uav_id, other):
            if not allows(place):
                continue
            each = self._waiting.list_to(uav_id, place)
            if each is None:
                continue
            battery = self._waiting.why_out_of_reach(each, _SHARE)
            if not battery and self._watch.is_free(uav_id, each.end_via):
                self._waiting.give_way(uav_id, other, each.end_via[-1])
                return {uav_id: each}
            why = battery or why
        world.note(f'{uav_id} stays in the way of {other}: {why}', warning=True)
        return {}

    def _places(self, uav_id: str, other: str) -> Iterator[Point]:
        """Places around a UAV at its height [m] ENU: near ones first, then away from the other."""
        world = self._world
        x, y, z = world.uav_records()[uav_id].report.position
        from_x, from_y, _ = world.uav_records()[other].report.position
        away = math.atan2(y - from_y, x - from_x)
        turns = sorted((2.0 * math.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)),
                       key=math.cos, reverse=True)
        for distance in _DISTANCES:
            radius = distance * separation_of(world.params).horizontal
            for turn in turns:
                yield x + radius * math.cos(away + turn), y + radius * math.sin(away + turn), z

    def _free_places(self, uav_id: str, stamp: float) -> Callable[[Point], bool]:
        """Whether a UAV that stays at a place is in conflict with no list in force."""
        from uav_task_alloc.allocator.replanning.separated_lists import planned_flights
        from uav_task_alloc.separation.conflicts import AcceptedRows
        from uav_task_alloc.separation.volumes import end_rows, rows_of_legs
        world, rule = self._world, separation_of(self._world.params)
        flights = planned_flights(
            world, {name: world.list_of(name) for name in world.uav_records()}, stamp)
        mine, rows = flights.pop(uav_id), AcceptedRows(rule)
        for k, flight in enumerate(flights.values()):
            for n, leg in enumerate(rows_of_legs(flight, rule)):
                rows.add(leg, (k, n))
        return lambda place: rows.conflict(end_rows(mine, rule, 0.0, place), -1) is None
