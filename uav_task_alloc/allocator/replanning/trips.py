# SPDX-License-Identifier: Apache-2.0
"""Trips of a plan: the present one of each UAV, which is published, and the later ones.

Between two trips the battery of a UAV is changed at its home. One whose battery is low, or being
changed, has later trips only.
"""
from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import replace
from itertools import chain

from uav_task_alloc.allocator.list_records import LaterTrips
from uav_task_alloc.allocator.state.flights import OVERDUE
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan, Uav
from uav_task_alloc.model.task import LONG


def present_trips(chosen: Plan, later_only: Collection[str]) -> tuple[Plan, LaterTrips]:
    """Divide a plan.

    Args:
        chosen: plan of all trips.
        later_only: UAVs without a present trip.

    Returns:
        The plan of the present trips, and the task ids of the later ones, by UAV.
    """
    routes, legs, later = dict[str, tuple[str, ...]](), dict(chosen.legs), LaterTrips({})
    for uav_id in chosen.routes:
        trips = chosen.trips_of(uav_id)
        if uav_id in later_only:
            trips = ((), *trips)
        routes[uav_id] = trips[0]
        legs[uav_id] = chosen.legs.get(uav_id, ())[:len(trips[0]) + 1]
        if any(trips[1:]):
            later[uav_id] = tuple(trip for trip in trips[1:] if trip)
    return replace(chosen, routes=routes, legs=legs), later


def with_later_trips(published: Plan, world: World) -> Plan:
    """Return the lists in force as a plan of all trips, to start a search from.

    Args:
        published: plan of the lists.
        world: with the later trips of the plan in force.

    Returns:
        The same plan where there are none. Of a UAV without tasks at its home the first later
        trip is the present one.
    """
    rows = {uav_id: trips for uav_id, trips in world.later.items() if uav_id in published.routes}
    if not rows:
        return published
    routes = {uav_id: (*tasks, *(name for trip in rows.get(uav_id, ()) for name in trip))
              for uav_id, tasks in published.routes.items()}
    trips = {}
    for uav_id, row in rows.items():
        present = published.routes[uav_id]
        begins = not present and world.flights.at_home_since(uav_id) is not None
        trips[uav_id] = row if begins else (present, *row)
    state = published.state and replace(published.state, trips=trips)
    return replace(published, routes=routes, state=state)


def remaining_trips(world: World, later: LaterTrips, planned: Iterable[str]) -> LaterTrips:
    """Return the later trips without the tasks that are planned already; none is planned twice.

    Args:
        world: as it is now.
        later: trips of UAVs, known or not; those of the first ones come first.
        planned: ids of tasks in lists.

    Returns:
        Trips of known UAVs, with tasks that are open and that they may fly.
    """
    taken, found = set(planned), LaterTrips()
    for uav_id, trips in later.items():
        if world.uav_record(uav_id) is None:
            continue
        rows = [tuple(task_id for task_id in trip if task_id not in taken
                      and world.can_fly(uav_id, task_id)) for trip in trips]
        taken.update(chain(*rows))
        if any(rows):
            found[uav_id] = tuple(filter(None, rows))
    return found


def waiting_uavs(world: World, stamp: float) -> dict[str, Uav]:
    """Return the UAVs that will have a full battery later, as they will be then.

    Args:
        world: as it is now.
        stamp: [s] published clock.

    Returns:
        At their homes with full batteries, `available_from` the end of the change; empty where
        a plan may have one trip only. A UAV that has waited at its home for three times its
        turnaround is not among them: nobody seems to change its battery.
    """
    if world.params.trips <= 1:
        return {}
    found = {}
    for uav_id, record in world.uav_records().items():
        report = record.report
        if not ((record.low or record.awaits_battery) and report.turnaround and report.full_range
                and uav_id not in world.fleet.switched_off and not record.blocked_on_ground
                and world.orders.of_uav(uav_id) is None):
            continue
        since = world.flights.at_home_since(uav_id)
        if since is None and record.silent:
            continue
        flight = world.flights.of(uav_id, stamp)
        landed = stamp + flight.pace.seconds((report.position, record.home)) if (
            since is None and flight) else since or stamp
        ready = max(1.0, landed + report.turnaround - stamp)
        if stamp - landed > OVERDUE * report.turnaround or ready > LONG:
            continue
        uav = world.uav(uav_id)
        found[uav_id] = replace(
            uav, position=record.home, range=uav.full_range or 0.0,
            endurance=math.inf if uav.full_endurance is None else uav.full_endurance,
            available_from=ready)
    return found
