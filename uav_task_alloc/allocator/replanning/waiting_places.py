# SPDX-License-Identifier: Apache-2.0
"""Idle UAVs in flight are sent to places where tasks are expected; in doubt they stay.

Lists without tasks lead there, see `UavList.waiting_place`.
"""
from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.order_records import OrderKind
from uav_task_alloc.allocator.replan_records import FleetOutlook
from uav_task_alloc.allocator.replanning.built_lists import way_to_place_is_clear
from uav_task_alloc.allocator.replanning.from_now import objective_of, separation_of
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.model import Point
from uav_task_alloc.params import BridgeParams

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from uav_task_alloc.allocator.replanning.waiting_choice import WaitingChoice
    from uav_task_alloc.anticipation.intensity import Cells

_CHECK = 1.0  # [s] between two checks of the places in force
_REVIEW, _LEAST_REVIEW = 30.0, 5.0  # [s] between two choices without an event, and with one
_FLYING = ('HOLD', 'ON_MISSION')  # modes of a UAV that may be sent to a place
_SHARE = 0.75  # of what a battery has above the reserve that the way there and home may take
_UPRIGHT = 0.5  # [m] horizontally: straight down
_CLIMB = 1.0  # [m] more than that is a climb of its own


class WaitingPlaces:
    """Chooses where idle UAVs wait, and ends that where it is not safe or not wanted any more.

    Args:
        world: of the allocator.

    Arguments of methods:
        now: [s] steady clock.
        stamp: [s] published clock.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._checked = self._chosen_at = -math.inf  # [s] steady clock
        self._event: object = None  # what the last choice was made for
        self._choice: WaitingChoice | None = None  # imported once it is wanted: it loads kernels
        self._stays: dict[str, str] = {}  # why a UAV was not sent, by id
        self._gives_way: dict[str, tuple[str, Point]] = {}  # the other UAV, and the place, by id

    @property
    def on(self) -> bool:
        """Whether idle UAVs are sent to places; never without an operator who approves plans."""
        params = self._world.params
        return params.anticipate != 'off' and params.approval == 'none'

    def texts(self) -> dict[str, str]:
        """Return where UAVs wait for tasks, and why others were not sent, by id."""
        found = dict(self._stays) if self.on else {}
        found.update(dict.fromkeys(self._world.fleet.awaiting_battery(),
                                   'gets another battery at its home'))
        for uav_id, each in sorted(self._world.lists_in_force().items()):
            if each.waiting_place is not None:
                x, y, z = each.waiting_place
                other = self._gives_way_to(each)
                found[uav_id] = f'waits at ({x:.0f}, {y:.0f}, {z:.0f}) m ' + (
                    f'to give way to {other}' if other else 'for demand')
        return found

    def give_way(self, uav_id: str, other: str, place: Point) -> None:
        """Note that a list leads a UAV out of the way: it stays there without `anticipate`, too.

        Args:
            uav_id: of the UAV.
            other: id of the UAV that it gives way to.
            place: [m] ENU, the last point of the list.
        """
        self._gives_way[uav_id] = other, place

    def _gives_way_to(self, each: UavList) -> str:
        """The UAV that one gives way to by a list; '': none."""
        other, place = self._gives_way.get(each.uav, ('', None))
        return other if each.waiting_place == place else ''

    def ended(self, now: float) -> dict[str, UavList]:
        """Return empty lists for UAVs that are not to fly to their places any more."""
        if now - self._checked < _CHECK:
            return {}
        world, self._checked, ended = self._world, now, dict[str, UavList]()
        for each in world.lists_in_force().values():
            why = self._why_ended(each) if each.waiting_place is not None else ''
            if why:
                world.note(f'{each.uav} stays where it is: {why}')
                ended[each.uav] = replace(each, end_via=())
        return ended

    def _why_ended(self, each: UavList) -> str:
        record = self._world.uav_record(each.uav)
        if not (self.on or self._gives_way_to(each)):
            return 'no waiting places are wanted'
        if record is None or not self._world.kernels_ready:
            return ''  # after a restart: it has not reported yet
        if record.awaits_battery:
            return ''  # the next plan sends it home
        why = self._why_not_idle(each.uav, record)
        if why or way_to_place_is_clear(self._world, each):
            return why
        return 'its way there is not clear any more'

    def _why_not_idle(self, uav_id: str, record: UavRecord) -> str:
        """Why a UAV may not be sent to a place; '': it may."""
        world, report = self._world, record.report
        if not world.usable(uav_id):
            return world.fleet.why_unusable(uav_id)
        if report.authority != 'HELD' or report.foreign:
            return f'authority {report.authority or "unknown"}'
        if report.standby or report.mode not in _FLYING:
            return f'mode {report.mode or "unknown"}'
        if record.inside_zone or uav_id in world.zone_checks.stranded:
            return 'a zone'
        if self.is_ordered(uav_id):
            return 'an order'
        each = world.list_of(uav_id)
        return 'it has tasks' if each.stops or each.returns or report.active_task else ''

    def is_ordered(self, uav_id: str) -> bool:
        """Return whether an operator holds a UAV, or has given it an order.

        Args:
            uav_id: of any UAV.
        """
        orders = self._world.orders
        hold = orders.holds.get(uav_id)
        return (hold is not None and hold.hold) or any(
            order.uav == uav_id and order.kind is not OrderKind.FORBID
            for order in orders.in_force.values())

    def idle(self) -> list[str]:
        """Return the UAVs in flight without tasks that may be sent elsewhere."""
        return [uav_id for uav_id, record in sorted(self._world.uav_records().items())
                if not self._why_not_idle(uav_id, record)]

    def demand(self, stamp: float) -> tuple[Cells, NDArray[np.float64]] | None:
        """Return the area of work, and the probability of the next task in each of its cells.

        Times the value of a task there; None while no area is known.
        """
        world, learnt = self._world, self._begun().demand
        learnt.follow(world.announced.seen, world.params)
        if learnt.demand is None:
            return None
        return learnt.demand.cells, learnt.weight(world.params.anticipate == 'learnt', stamp)

    def chosen(self, now: float, stamp: float) -> dict[str, UavList]:
        """Return lists of idle UAVs with other places, where it is time to choose."""
        world = self._world
        past = now - self._chosen_at
        if past < _LEAST_REVIEW or not self.on or world.restart_hold or not world.kernels_ready:
            return {}
        idle = self.idle()
        event = (tuple(idle), world.announced.seen.version, world.plan_revision,
                 world.airspace.paths(), world.params.anticipate)
        if past < _REVIEW and event == self._event:
            return {}
        self._chosen_at, self._event = now, event
        self._stays = {uav_id: text for uav_id, text in self._stays.items() if uav_id in idle}
        if not idle:
            return {}
        return self._sent(idle, self._begun(), stamp)

    def outlook(self, stamp: float) -> FleetOutlook | None:
        """Return where the next tasks are expected, for plans; None: that does not count."""
        world, params = self._world, self._world.params
        prices = objective_of(params)
        if not self.on or params.route_end == 'home' or not (
                prices.response > 0.0 and prices.finish == 0.0):
            return None
        return self._begun().outlook(world.announced.seen, params,
                                     world.lists_in_force().values(), stamp)

    def _begun(self) -> WaitingChoice:
        if self._choice is None:
            from uav_task_alloc.allocator.replanning.waiting_choice import WaitingChoice
            self._choice = WaitingChoice()
        return self._choice

    def _sent(self, idle: list[str], choice: WaitingChoice, stamp: float) -> dict[str, UavList]:
        """The lists of the UAVs that change their places."""
        world, lists = self._world, dict[str, UavList]()
        choice.demand.follow(world.announced.seen, world.params)
        places = choice.places(world.params.anticipate == 'learnt', {
            uav_id: (self._height(uav_id), *self._reach(uav_id)) for uav_id in idle},
            self._others(idle, stamp), self._present(idle), world.airspace.paths(), stamp)
        for uav_id, place in places.items():
            each = self.list_to(uav_id, place)
            why = (self.why_out_of_reach(each) if each is not None else 'no safe way') or (
                self._conflict(each, lists, stamp) if each is not None else '')
            self._stays.pop(uav_id, None)
            if why or each is None:
                self._stays[uav_id] = f'stays where it is: {why}'
            else:
                lists[uav_id] = each
        return lists

    def _height(self, uav_id: str) -> float:
        """The height [m] ENU at which a UAV flies to its place, and waits there.

        That of its take-offs at least, at which it may fly anywhere; never down.
        """
        params, record = self._world.params, self._world.uav_records()[uav_id]
        above = record.report.takeoff_height or BridgeParams.cruise_altitude
        wanted = max(record.report.position[2], record.home[2] + above)
        return min(max(wanted, params.altitude_min), params.altitude_max)

    def metres(self, uav_id: str) -> float:
        """Return what an idle UAV may fly before its battery is down to the reserve.

        Args:
            uav_id: of a known UAV.

        Returns:
            [m]; way there and home, and waiting, come out of it.
        """
        uav = self._world.uav(uav_id)
        seconds = self._world.flights.spendable(uav, self._height(uav_id)).endurance
        return min(uav.range, seconds * uav.cruise_speed)

    def _reach(self, uav_id: str) -> tuple[float, float]:
        """The metres of way that a battery allows, and the speed [m/s]."""
        return _SHARE * self.metres(uav_id), self._world.uav(uav_id).cruise_speed

    def _present(self, idle: list[str]) -> dict[str, tuple[Point, Point]]:
        """Where each idle UAV is, and where it waits or is sent to."""
        found = {}
        for uav_id in idle:
            position = self._world.uav_records()[uav_id].report.position
            found[uav_id] = position, self._world.list_of(uav_id).waiting_place or position
        return found

    def _others(self, idle: list[str], stamp: float) -> list[tuple[float, Point, float]]:
        """When [s] other usable UAVs are free, where, and their speeds [m/s]."""
        world, found = self._world, list[tuple[float, Point, float]]()
        for uav_id, record in sorted(world.uav_records().items()):
            flight = world.flights.of(uav_id, stamp)
            if uav_id in idle or flight is None or not world.usable(uav_id):
                continue
            each = world.lists.restamped(uav_id, stamp, flight)
            end = each.stops[-1].exit if each.stops else record.report.position
            found.append((finish_time(replace(each, returns=False), flight), end,
                          world.uav(uav_id).cruise_speed))
        return found

    def list_to(self, uav_id: str, place: Point) -> UavList | None:
        """Return a list that leads a UAV to a place.

        Args:
            uav_id: of a UAV in flight.
            place: [m] ENU; where it is higher, the UAV climbs first.

        Returns:
            None: no safe way was found.
        """
        world = self._world
        start = world.uav_records()[uav_id].report.position
        up = (start[0], start[1], place[2])
        climb = (up,) if abs(up[2] - start[2]) > _CLIMB else ()
        begin = climb[0] if climb else start
        leg = world.airspace.paths().leg(begin, place)
        if leg is None:
            return None
        via = leg.via
        while via and math.dist(via[-1][:2], place[:2]) < _UPRIGHT and via[-1][2] > place[2]:
            via, place = via[:-1], via[-1]  # no descent at the end: the ground may be there
        if not world.airspace.paths().leg_clear(start, *climb, *via, place):
            return None
        return replace(world.list_of(uav_id), end_via=(*climb, *via, place), distance=0.0)

    def why_out_of_reach(self, each: UavList, share: float = _SHARE) -> str:
        """Return why the battery of a UAV does not allow a place; '': it does.

        Args:
            each: list that leads there.
            share: of what the battery has above the reserve that the way there and home may take.
        """
        world, record = self._world, self._world.uav_records()[each.uav]
        place = each.end_via[-1]
        home = world.airspace.paths().leg(place, record.home)
        if home is None:
            return 'no safe way home from its place'
        way = polyline_length((record.report.position, *each.end_via))
        return '' if way + home.length <= share * self.metres(each.uav) else 'battery'

    def _conflict(self, each: UavList, sent: dict[str, UavList], stamp: float) -> str:
        """With which UAV the way to a place, and waiting there, is in conflict; '': none."""
        rule = separation_of(self._world.params)
        if not rule.on:
            return ''
        from uav_task_alloc.allocator.replanning.separated_lists import planned_flights
        from uav_task_alloc.separation.conflicts import find_conflicts
        from uav_task_alloc.separation.volumes import flight_volumes
        known = {uav_id: self._world.list_of(uav_id) for uav_id in self._world.uav_records()}
        lists = {**known, **sent, each.uav: each}
        flights = list(planned_flights(self._world, lists, stamp).values())
        for found in find_conflicts(flight_volumes(flights, rule), rule):
            pair = [flights[k].uav for k in found.flights]
            if each.uav in pair:
                return f'separation from {next(u for u in pair if u != each.uav)}'
        return ''
