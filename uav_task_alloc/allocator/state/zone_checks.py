# SPDX-License-Identifier: Apache-2.0
"""UAVs and homes inside zones: who gets no tasks, who has no safe way home, whose way is cut."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from uav_task_alloc.model import Point

if TYPE_CHECKING:
    from uav_task_alloc.allocator.state.fleet import UavRecord
    from uav_task_alloc.allocator.state.world import World

_CLIMB = 5.0  # [m] above the ground: as high as everybody climbs first, and heights are as wrong
NAMED = 5  # in one sentence


def look(world: World, uav_id: str, now: float) -> None:
    """Which zones a UAV and its home are in; what is new asks for a plan.

    A UAV that stands on the ground inside a zone, or whose home is inside one, gets no tasks: it
    would climb into the zone, or come home into it.
    """
    record, ways = world.fleet.records[uav_id], world.ways()
    stands, position = record.report.standby, record.report.position
    # a position on the ground wanders: out of a zone is who is well out of it
    zone = ways.around(position, _CLIMB, bool(record.zone)) if stands else ways.around(position)
    home_zone = ways.around(record.home, _CLIMB, bool(record.home_zone))
    standing = _standing(uav_id, zone, home_zone) if stands else ''
    world.fleet.set_zone(uav_id, zone, home_zone, standing)
    if standing != record.standing:
        world.note(f'{standing}: it gets no tasks' if standing else
                   f'{uav_id} may get tasks again: it stands inside no zone', bool(standing))
        world.touch(standing or f'{uav_id} stands inside no zone', now)
    elif bool(zone) != record.caught:
        word = 'inside' if zone else 'out of'
        world.note(f'{uav_id} is {word} a zone', warning=bool(zone))
        world.touch(f'{uav_id} {"caught in" if zone else word} a zone', now)
    elif bool(home_zone) != bool(record.home_zone):
        world.touch(f'home of {uav_id} {"inside" if home_zone else "out of"} a zone', now)


def _standing(uav_id: str, zone: str, home_zone: str) -> str:
    if zone:
        return f'{uav_id} stands inside zone {zone}'
    return f'the home of {uav_id} is inside zone {home_zone}' if home_zone else ''


def look_at_all(world: World, now: float) -> None:
    """All UAVs, where the zones are new to them."""
    if world.awake and not world.looked_at_all:
        world.looked_at_all = True
        for uav_id in world.fleet.records:
            look(world, uav_id, now)


def look_ahead(world: World, uav_id: str, now: float) -> None:
    """A way cut by a zone asks for a new plan, too."""
    look(world, uav_id, now)
    record, stops = world.fleet.records[uav_id], world.lists.get(uav_id).stops
    if (stops and not record.caught and world.ways().rest(
            record.report.position, stops[0].leg, stops[0].task.position) is None):
        world.touch(f'way of {uav_id} cut', now)


def note_way_home(world: World, uav_id: str, there: bool, place: Point) -> None:
    """Whether a UAV has a safe way home from `place` [m]; said once, until that changes."""
    record = world.fleet.records[uav_id]
    why = '' if there else world.ways().why_none(place, record.home)
    before = world.stranded.pop(uav_id, '')
    if why:
        world.stranded[uav_id] = why
    if why == before:
        return
    if why:
        world.note(f'{uav_id} has no safe way home ({why}): its list ends with HOLD', warning=True)
    else:
        world.note(f'{uav_id} has a safe way home again')


def standing(records: Iterable[UavRecord]) -> str:
    """Who stands inside which zone, in words; '' where nobody does."""
    found = sorted(record.standing for record in records if record.standing)
    more = len(found) - NAMED
    return '; '.join(found[:NAMED]) + (f' and {more} more' if more > 0 else '')
