# SPDX-License-Identifier: Apache-2.0
"""Which UAVs are known: new ones up to a limit; what was never proven to be one is forgotten.

A UAV is proven once it says that it holds a list with tasks of ours, or what became of one. A
proven one keeps its place, silent or not; a flood of made-up ids cannot push it out.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uav_task_alloc.allocator.records import UavReport
    from uav_task_alloc.allocator.state.world import World

MOST_UAVS = 1000  # a flood of made-up ids ends here
FORGET = 300.0  # [s] of silence after which one that is not proven is forgotten
LOOK = 10.0  # [s] between two looks for such


def admit(world: World, uav_id: str) -> bool:
    """Whether there is room for a UAV that is not known; the longest silent stranger goes."""
    records = world.fleet.records
    if len(records) < MOST_UAVS:
        world.full = ''
        return True
    silent = [known for known, record in records.items()
              if record.silent and _is_stranger(world, known)]
    if silent:
        forget(world, min(silent, key=lambda known: records[known].heard))
        return True
    if not world.full:
        world.full = (f'UAVs = {MOST_UAVS}: expected fewer; a new one is refused until another '
                      'is forgotten')
        world.note(f'{uav_id}: {world.full}', warning=True)
    return False


def prove(world: World, report: UavReport) -> None:
    """It holds a list with tasks that only we can have told it."""
    held = world.lists.get(report.uav_id)
    if held.stops and report.list_revision == held.revision:
        world.fleet.proven.add(report.uav_id)


def forget_strangers(world: World, now: float) -> None:
    """Those that are silent for long, and lists of the life before whose UAVs never came."""
    if now < world.next_look:
        return
    first, world.next_look = world.next_look == 0.0, now + LOOK
    if first:
        world.began = now
    records = world.fleet.records
    for uav_id in {*records, *world.lists.lists}:
        heard = records[uav_id].heard if uav_id in records else world.began
        if now - heard > FORGET and _is_stranger(world, uav_id):
            forget(world, uav_id)


def forget(world: World, uav_id: str) -> None:
    """Nothing of it is kept, neither its list and row in the journal nor its publishers."""
    world.fleet.forget(uav_id)
    world.lists.forget_uav(uav_id)
    world.again.discard(uav_id)
    world.outbox.lists.pop(uav_id, None)
    world.outbox.forgotten.add(uav_id)
    for book in (world.laid, world.stranded, world.looked, world.answered):
        book.pop(uav_id, None)


def _is_stranger(world: World, uav_id: str) -> bool:
    return uav_id not in world.fleet.proven and not world.lists.get(uav_id).stops
