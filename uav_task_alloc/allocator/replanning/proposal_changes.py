# SPDX-License-Identifier: Apache-2.0
"""What a proposal changes: tasks, metres and seconds of UAVs against the lists in force."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.model import Plan, Task

_MOST_NAMED = 20  # tasks of one UAV in a sentence


def new_proposal(world: World, chosen: Plan, built: BuiltLists, held: Iterable[str],
                 trigger: str, stamp: float) -> Proposal:
    """Return the proposal of lists against those in force, with what it changes in words.

    Args:
        world: as it is now.
        chosen: plan of the lists.
        built: its lists.
        held: ids of the UAVs whose lists wait.
        trigger: what required the plan.
        stamp: [s] clock of the node.

    Returns:
        The proposal, without its revision.
    """
    before = present_routes(world, world.lists_in_force())
    new = {uav_id: built.lists[uav_id] for uav_id in sorted(held)}
    metres = {uav_id: _metres(world, each) - _metres(world, world.list_of(uav_id))
              for uav_id, each in new.items()}
    distance = math.fsum(metres.values())
    finish = _finish(world, new, stamp) - _finish(world, {}, stamp)
    late = {task_id: by for task_id, by in chosen.timetable().late.items() if any(
        task_id in each.task_ids for each in new.values())}
    owner = {task_id: uav_id for uav_id, ids in before.items() for task_id in ids}
    changes = [_change(each, before.get(uav_id, ()), owner, metres[uav_id])
               for uav_id, each in new.items()]
    changes += [f'in all {distance:+.0f} m, the last UAV ends {finish:+.0f} s']
    changes += [f'late: {first_of(f"{task_id} by {by:.0f} s" for task_id, by in late.items())}'
                ] if late else []
    params = world.params
    return Proposal(0, world.revision, tuple(new.values()), trigger, stamp,
                    stamp + params.approval_timeout, params.approval_on_timeout == 'accept',
                    tuple(changes), distance, finish, tuple(sorted(late)),
                    {uav_id: built.later[uav_id] for uav_id in new if uav_id in built.later})


def _change(new: UavList, before: tuple[str, ...], owner: Mapping[str, str],
            metres: float) -> str:
    """What one UAV gains and loses."""
    after = new.task_ids
    gains = [f'{task_id} from {owner[task_id]}' if task_id in owner else f'{task_id} (new)'
             for task_id in after if task_id not in before]
    loses = [task_id for task_id in before if task_id not in after]
    parts = [f'{word} {first_of(tasks, _MOST_NAMED)}'
             for word, tasks in (('gains', gains), ('loses', loses)) if tasks]
    kept = ([t for t in before if t in after], [t for t in after if t in before])
    parts += ['flies its tasks in another order'] if kept[0] != kept[1] else []
    parts = parts or ['returns home' if new.returns else 'holds']
    return (f'{new.uav} {", ".join(parts)}: {len(before)} -> '
            f'{counted(len(after), "task")}, {metres:+.0f} m')


def _metres(world: World, each: UavList) -> float:
    """Length [m] of a list from where its UAV is now."""
    record = world.uav_record(each.uav)
    if not each.stops or record is None:
        return 0.0
    first = each.stops[0]
    rest = world.airspace.paths().rest(record.report.position, first.through, first.exit)
    return each.distance if rest is None else each.distance - first.length + rest


def _finish(world: World, new: Mapping[str, UavList], stamp: float) -> float:
    """When the last UAV ends [s], with other lists for some."""
    ends = [0.0]
    for uav_id in {**world.lists_in_force(), **new}:
        flight = world.flights.of(uav_id, stamp)
        if flight is not None:
            each = new.get(uav_id) or world.lists.restamped(uav_id, stamp, flight)
            ends.append(finish_time(each, flight))
    return max(ends)


def present_routes(world: World, lists: Mapping[str, UavList]) -> TaskIdsByUav:
    """Return the routes of lists without the tasks that are not to be flown any more.

    Args:
        world: as it is now.
        lists: by UAV.
    """
    return {uav_id: tuple(task_id for task_id in each.task_ids if uav_id in world.fleet.records
                          and world.can_fly(uav_id, task_id)) for uav_id, each in lists.items()}


def same_proposal(world: World, one: Proposal, other: Proposal) -> bool:
    """Return whether two proposals ask for the same, but for tasks that have ended.

    Args:
        world: as it is now.
        one, other: proposals.
    """
    return _present_stops(world, one) == _present_stops(world, other)


def _present_stops(world: World, proposal: Proposal) -> dict[str, list[Task]]:
    """The tasks of its lists that are still to be flown, as they were announced by then."""
    routes = present_routes(world, {each.uav: each for each in proposal.lists})
    return {each.uav: [stop.task for stop in each.stops if stop.task.id in routes[each.uav]]
            for each in proposal.lists}
