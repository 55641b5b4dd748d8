# SPDX-License-Identifier: Apache-2.0
"""The lists of a plan made apart: transit heights as detour points, waits, heights of returns."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import count

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.stop_times import slower_along, timed_stops
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.geometry.polyline import points_passed, polyline_length
from uav_task_alloc.model import Leg, Point
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, leg_times
from uav_task_alloc.separation.leg_changes import TransitLimits
from uav_task_alloc.separation.prediction import NEARER, rule_to_go_on
from uav_task_alloc.separation.resolution import STOPPED, Resolution, resolve
from uav_task_alloc.separation.rule import Separation

_MOST_CHANGES = 10_000  # tried in a plan, so that a callback ends: half a second without zones
_CHANGES = 20_000  # tried for each second of `solve_budget`, where the next plan goes on
# times the horizon of the uncertainty: what is later is left to later plans, where there are any
_AHEAD = 2.0
_DEAREST = 15.0  # [s] of flight that a return may cost; the monitor holds for about that time
_MOST_MOVERS = 4  # of the UAVs that hold for each other, tried in turn
_NEAREST = 1.0  # [m] horizontally, from where a UAV may fly off
_LEAST = 1.0  # [s] of a wait; a shorter one is no change
_RESTS = 1.0  # [m/s] below that a UAV stands
_AT_PLACE = 2.0  # [m] it is at its waiting place
_LEAST_ERROR = 0.05  # share by which times may be off, however exact they were


def with_separation(world: World, built: BuiltLists, stamp: float) -> BuiltLists:
    """Return the lists of a plan with heights and waits that keep the UAVs apart.

    Args:
        world: with the lists in force, whose first legs under way stay as they are; separation
            is on.
        built: the lists that would be put in force.
        stamp: [s] published clock.

    Returns:
        The same lists where nothing is in conflict.
    """
    lists = {uav_id: _with_high_return(world, each) for uav_id, each in built.lists.items()}
    params, tried, most = world.params, count(), _MOST_CHANGES
    if params.background_budget > 0.0:
        most = min(most, round(_CHANGES * params.solve_budget))
    limits = TransitLimits(
        params.altitude_min, params.altitude_max,
        lambda points: world.airspace.paths().leg_clear(*points), lambda: next(tried) >= most,
        _DEAREST)
    movers, chosen = _movers(world, lists)[:_MOST_MOVERS], None
    for mover in movers or ('',):
        flights = planned_flights(world, lists, stamp, mover)
        found = resolve(list(flights.values()), separation_of(params), limits)
        changed = {each.uav: each for each in found.flights}
        goes_on = not mover or _lets_go_on(world, mover, changed, limits)
        if chosen is None or goes_on:
            chosen = flights, found, changed
        if goes_on:
            break
    assert chosen is not None  # there is a mover, or ''
    flights, found, changed = chosen
    for uav_id, before in flights.items():
        if changed[uav_id] is not before:
            lists[uav_id] = _changed_list(world, lists[uav_id], before, changed[uav_id], stamp)
    return replace(built, lists=lists, together=_not_apart(found, flights))


def _lets_go_on(world: World, mover: str, changed: dict[str, Flight],
                limits: TransitLimits) -> bool:
    """Change the leg of a UAV that holds so that the monitor lets it go on; whether it does.

    Its way has to be free by more than the rule; it may fly off from where it is too near already.
    """
    held = [each for uav_id, each in changed.items() if uav_id in world.stuck]
    rule, own = rule_to_go_on(separation_of(world.params)), changed[mover].position
    now = min((math.dist(own[:2], each.position[:2]) for each in held if each.uav != mover
               and abs(own[2] - each.position[2]) < rule.vertical), default=math.inf)
    if now < rule.horizontal:
        rule = replace(rule, horizontal=max(_NEAREST, now - NEARER))
    found = resolve(held, rule, limits)
    changed |= {each.uav: each for each in found.flights}
    return not found.left


def _not_apart(found: Resolution, flights: Mapping[str, Flight]) -> tuple[str, ...]:
    """A sentence for each two UAVs that the lists do not keep apart."""
    texts = dict[str, str]()
    for each in found.conflicts:
        pair = ' and '.join(sorted(each.uavs))
        if each.resolution:
            continue
        if each.detail == STOPPED:
            texts.setdefault(pair, f'{STOPPED} to keep {pair} apart: the next plan goes on')
        elif '' in each.tasks and all(flights[uav_id].legs[-1:] and flights[uav_id].legs[-1].lands
                                    for uav_id in each.uavs):
            texts.setdefault(pair, f'{pair} return at the same time: one of them will hold')
        else:
            texts[pair] = f'the plan cannot keep {pair} apart'
    return tuple(sorted(texts.values()))


def _with_high_return(world: World, each: UavList) -> UavList:
    """A list whose return ends above the home at the height of its last point.

    A vehicle's own return would climb to a height that the plan does not know.
    """
    record = world.uav_record(each.uav)
    if record is None or not each.returns or not each.stops:
        return each
    home, last = record.home, (each.stops[-1].exit, *each.end_via)[-1]
    above = home[0], home[1], last[2]
    if last[2] <= home[2] or last[:2] == home[:2] or not world.airspace.paths().leg_clear(
            last, above, home):
        return each
    return replace(each, end_via=(*each.end_via, above))


def planned_flights(world: World, lists: Mapping[str, UavList], stamp: float,
                    mover: str | None = None) -> dict[str, Flight]:
    """Return what each known UAV flies by its list.

    Args:
        world: as it is now; separation is on.
        lists: by UAV.
        stamp: [s] published clock.
        mover: the one of the UAVs that hold for each other whose leg can change; None: the first.

    Returns:
        By UAV, also of those that hover without a list; up to about twice the horizon of the
        rule where plans follow each other.
    """
    flights, rule = {}, separation_of(world.params)
    until = _AHEAD * rule.horizon if world.params.background_budget > 0.0 else math.inf
    mover = next(iter(_movers(world, lists)), '') if mover is None else mover
    for uav_id, each in lists.items():
        flight = world.flights.of(uav_id, stamp)
        if flight is None or world.flights.is_forgotten(uav_id, stamp):
            continue
        if mover and uav_id != mover and uav_id in world.stuck:  # it stands until that has passed
            flights[uav_id] = _empty(uav_id, flight, rule)
            continue
        flights[uav_id] = _flight(each, world.list_of(uav_id), flight, stamp, rule, until,
                                  uav_id == mover)
    for uav_id in sorted(world.uav_records().keys() - lists.keys()):  # as a pilot has all along
        flight = world.flights.of(uav_id, stamp)
        if flight is not None and not flight.on_ground and not world.flights.is_forgotten(
                uav_id, stamp) and math.hypot(*(flight.velocity or (0.0,))) < _RESTS:
            flights[uav_id] = _empty(uav_id, flight, rule)
    return flights


def _movers(world: World, lists: Mapping[str, UavList]) -> list[str]:
    """The UAVs that hold for each other whose legs can change."""
    movers = []
    for uav_id in sorted(world.stuck & lists.keys()):
        record, stops = world.uav_record(uav_id), lists[uav_id].stops
        if record and stops and not _is_on_path(record.report.position, stops[0]) and (
                math.hypot(*(record.report.velocity or (0.0,))) < _RESTS):
            movers.append(uav_id)
    return movers


def _is_on_path(place: Point, stop: ListStop) -> bool:
    """Whether a UAV at a place [m] is on the path of a stop, not on the leg to it."""
    return bool(stop.task.path) and points_passed(place, stop.line) > len(stop.leg.via)


def _flight(each: UavList, published: UavList, flight: UavFlight, stamp: float,
            rule: Separation, until: float, stands: bool) -> Flight:
    """What a UAV flies by its list, up to a leg that ends after `until` [s] from now.

    Where it stands, the leg under way can change its height.
    """
    own, legs, place = _empty(each.uav, flight, rule), list[FlightLeg](), flight.position
    clock = 0.0  # [s] from now
    if each.stops and flight.waiting == each.stops[0].task.id:  # it has not set out
        own = replace(own, waits=True, share=0.0)
    for k, stop in enumerate(each.stops):
        takes_off = k == 0 and flight.on_ground
        under_way = k == 0 and _same_leg(published, stop) and not (
            flight.on_ground or flight.climbing or own.waits)
        along = bool(stop.task.path) and (stands or not under_way)  # the path is another leg
        line = (*stop.leg.via, stop.entry) if along else stop.line
        ahead = line[flight.passed(line):] if under_way else line
        served = stop.served if under_way else 0.0
        begins = stop.begin_after - stamp
        climbs = takes_off or (k == 0 and flight.climbing)
        leg = FlightLeg((place, *ahead), stop.task.id,
                        0.0 if along else max(0.0, stop.task.stay - served),
                        stop.task.earliest - stamp, stop.task.latest - stamp,
                        stop.task.release - stamp,
                        takes_off=takes_off, movable=stands or not under_way,
                        top=flight.takeoff_top if climbs else -math.inf)
        if begins > 0.0:  # it keeps the wait that it had, or less
            leg = replace(leg, hold_until=begins - own.leg_seconds(leg))
        legs.append(leg)
        clock = leg_times(own, leg, clock, k == 0).end
        if along:
            stay = max(0.0, stop.task.stay + slower_along(stop, flight.pace))
            legs.append(FlightLeg(stop.way, '', stay, movable=False, may_wait=False))
            clock = leg_times(own, legs[-1], clock, False).end
        place = stop.exit
        if clock > until and k + 1 < len(each.stops):
            return replace(own, legs=tuple(legs), goes_on=True)
    if each.returns and flight.home is not None and not (flight.on_ground and not each.stops):
        climbs = flight.climbing and not each.stops
        legs.append(FlightLeg((place, *each.end_via, flight.home), lands=True,
                              top=flight.takeoff_top if climbs else -math.inf,
                              movable=bool(each.stops), may_wait=False))
    legs += _leg_to_wait(each, flight)
    return replace(own, legs=tuple(legs))


def _leg_to_wait(each: UavList, flight: UavFlight) -> list[FlightLeg]:
    """The leg to a waiting place, where the UAV stays."""
    place, line = flight.position, each.end_via
    if each.waiting_place is None or flight.on_ground or (
            math.dist(place, each.waiting_place) < _AT_PLACE):
        return []
    ahead = line[flight.passed(line):]
    return [FlightLeg((place, *ahead), movable=False, may_wait=False)]


def _same_leg(published: UavList, stop: ListStop) -> bool:
    """Whether the first leg of the list in force is that of a stop."""
    first = published.stops[0] if published.stops else None
    return first is not None and (first.task.id, first.leg.via) == (stop.task.id, stop.leg.via)


def _empty(uav_id: str, flight: UavFlight, rule: Separation) -> Flight:
    """The flight of a UAV without legs, with its pace and errors as measured."""
    pace = flight.pace
    return Flight(
        uav_id, (), flight.position, pace.mean_speed, pace.climb, pace.descent,
        in_air=not flight.on_ground, late=flight.late, pace=pace,
        speed_error=max(_LEAST_ERROR, min(rule.speed_error, flight.time_error)),
        share=0.0 if flight.velocity is None else min(
            1.0, math.hypot(*flight.velocity[:2]) / pace.speed))


def _changed_list(world: World, each: UavList, before: Flight, after: Flight,
                  stamp: float) -> UavList:
    """A list with the heights and waits of a flight."""
    flight = world.flights.of(each.uav, stamp)
    assert flight is not None  # it has a flight
    stops = list[ListStop]()
    legs = ((old, new) for old, new in zip(before.legs, after.legs, strict=False)
            if not _is_path(old))
    for stop, (old, new) in zip(each.stops, legs, strict=False):
        if new is old:
            stops.append(stop)
            continue
        leg = stop.leg if new.points == old.points else Leg(
            new.points[1:-1], polyline_length(new.points))
        begin = stop.begin_after
        if new.hold_until == -math.inf:
            begin = 0.0
        elif abs(new.hold_until - old.hold_until) > _LEAST:
            begin = max(0.0, round(stamp + new.hold_until + after.leg_seconds(new), 1))
        stops.append(replace(stop, leg=leg, begin_after=begin))
    timed = timed_stops([*stops, *each.stops[len(stops):]], flight)
    end_via = _end_via(each, after)
    return replace(each, stops=timed, end_via=end_via,
                   distance=_length(timed, end_via, flight.home if each.returns else None))


def _is_path(leg: FlightLeg) -> bool:
    """Whether a leg is the path of a task, not the leg to one."""
    return not (leg.movable or leg.may_wait or leg.lands)


def _end_via(each: UavList, after: Flight) -> tuple[Point, ...]:
    if not each.returns or not after.legs or not after.legs[-1].lands:
        return each.end_via
    return after.legs[-1].points[1:-1]


def _length(stops: tuple[ListStop, ...], end_via: tuple[Point, ...],
            home: Point | None) -> float:
    """Length of all legs [m]; 0 without stops."""
    if not stops:
        return 0.0
    metres = math.fsum(stop.length for stop in stops)
    return metres if home is None else metres + polyline_length(
        (stops[-1].exit, *end_via, home))
