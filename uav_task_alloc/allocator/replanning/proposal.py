# SPDX-License-Identifier: Apache-2.0
"""Plans that wait for an operator: which lists need approval, and what a proposal changes."""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from uav_task_alloc.allocator.list_records import LaterTrips, UavList
from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists
from uav_task_alloc.allocator.replanning.plan_acceptance import TaskIdsByUav, exchange_groups
from uav_task_alloc.allocator.replanning.planning import BuiltLists, build_lists
from uav_task_alloc.allocator.state.published_lists import shifted_list
from uav_task_alloc.allocator.state.stop_times import finish_time
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.model import Plan, Task

_MOST_NAMED = 20  # tasks of one UAV in a sentence


@dataclass(frozen=True, slots=True)
class SplitPlan:
    """A plan, divided by what needs the approval of an operator."""

    built: BuiltLists  # that go out at once
    at_once: str  # why some of them need no approval; '' where none is of that kind
    proposal: Proposal | None  # the rest, without its revision; None where there is none
    waiting: frozenset[str] = frozenset()  # tasks that only the proposal has in a list


def split_plan(world: World, chosen: Plan, trigger: str, stamp: float) -> SplitPlan:
    """Divide a plan by what needs the approval of an operator.

    Never held up are lists that cannot be flown on as they are (a zone, a lost UAV, a battery, an
    order), those of UAVs that get tasks by an order, and those that exchange tasks with them.
    With `approval: replan` the first tasks of UAVs without any need none either.

    Args:
        world: as it is now.
        chosen: plan, for this world or an earlier one.
        trigger: what required it.
        stamp: [s] clock of the node.

    Returns:
        Lists to publish, and a proposal.
    """
    built = _held(world, build_lists(world, chosen, stamp), stamp)
    if world.params.approval == 'none':
        return SplitPlan(built, '', None)
    before = present_routes(world, world.lists_in_force())
    after = {uav_id: each.task_ids for uav_id, each in built.lists.items()}
    held, reasons = set[str](), dict[str, str]()
    for group in exchange_groups(_open_routes(world, after), after):
        why = next(filter(None, (_why_at_once(world, uav_id, before, after)
                                 for uav_id in sorted(group))), '')
        first = not any(before.get(uav_id) for uav_id in group)
        if all(world.lists.is_void(built.lists[uav_id]) for uav_id in group):
            continue
        if why:
            reasons.update(dict.fromkeys(sorted(group), why))
        elif not (first and world.params.approval == 'replan'):
            held |= group
    text = '; '.join(f'{uav_id}: {why}' for uav_id, why in reasons.items())
    if not held:
        return SplitPlan(built, text, None)
    routes = {**after, **{uav_id: before.get(uav_id, ()) for uav_id in held}}
    proposal = _proposal(world, chosen, built, held, before, trigger, stamp)
    at_once = _plan_at_once(world, chosen, built, proposal, routes)
    now = _held(world, build_lists(world, at_once, stamp), stamp)
    waiting = set(_tasks_of(proposal)) - {
        task_id for task_ids in before.values() for task_id in task_ids}
    return SplitPlan(now, text, proposal, frozenset(waiting))


def _open_routes(world: World, uav_ids: Iterable[str]) -> TaskIdsByUav:
    """The open tasks of lists in force, also those that their UAVs may not fly any more."""
    return {uav_id: tuple(filter(world.tasks.is_open, world.list_of(uav_id).task_ids))
            for uav_id in uav_ids}


def _why_at_once(world: World, uav_id: str, before: TaskIdsByUav, after: TaskIdsByUav) -> str:
    """Why a UAV may not wait for another list; '' if it may."""
    gained = {*after[uav_id]}.difference(before.get(uav_id, ()))
    ordered = any(world.orders.owner(task_id) == uav_id for task_id in gained)
    return world.validity.why_change(uav_id) or ('an order' if ordered else '')


def _tasks_of(proposal: Proposal) -> Iterator[str]:
    """The tasks of its lists, and of the later trips of their UAVs."""
    for each in proposal.lists:
        yield from each.task_ids
    for trips in proposal.later.values():
        yield from chain(*trips)


def _plan_at_once(world: World, chosen: Plan, built: BuiltLists, proposal: Proposal,
                  routes: TaskIdsByUav) -> Plan:
    """A plan in which the UAVs of a proposal keep their lists and their later trips.

    routes: of the lists that go out at once, and those in force of the UAVs that wait.
    """
    held = [world.list_of(each.uav) for each in proposal.lists]
    mine = {task_id for each in held for task_id in each.task_ids}
    later = _later_at_once(world, built, proposal, routes)
    trips = {uav_id: (task_ids if world.usable(uav_id) else (), *later.get(uav_id, ()))
             for uav_id, task_ids in routes.items()}
    first = {**chosen.routes, **{uav_id: rows[0] for uav_id, rows in chosen.trips.items()}}
    return replace(
        chosen, routes=routes, timetable=lambda: replace(chosen.timetable(), trips=trips),
        legs={uav_id: legs for uav_id, legs in chosen.legs.items()
              if first.get(uav_id) == routes.get(uav_id)},
        reversed=(chosen.reversed - mine) | {
            stop.task.id for each in held for stop in each.stops if stop.reversed})


def _later_at_once(world: World, built: BuiltLists, proposal: Proposal,
                   routes: TaskIdsByUav) -> LaterTrips:
    """The later trips with such a plan: those in force first; no task is planned twice."""
    waits = {each.uav: each.task_ids for each in proposal.lists}
    planned, later = {*chain(*routes.values(), *waits.values())}, LaterTrips()
    for uav_id in (*waits, *(each for each in built.later if each not in waits)):
        if world.uav_record(uav_id) is None:
            continue
        source = world.later if uav_id in waits else built.later
        rows = [[task_id for task_id in trip if task_id not in planned
                 and world.can_fly(uav_id, task_id)] for trip in source.get(uav_id, ())]
        planned.update(chain(*rows))
        if any(rows):
            later[uav_id] = tuple(tuple(row) for row in rows if row)
    return later


def _held(world: World, built: BuiltLists, stamp: float) -> BuiltLists:
    """Lists that are apart, without those that would break a deadline that is accepted."""
    lists, why = held_lists(world, built.lists, stamp)
    built = replace(built, lists=lists, left_out={**built.left_out, **why})
    if not separation_of(world.params).on:
        return built
    from uav_task_alloc.allocator.replanning.separated_lists import (  # imports numba
        with_separation,
    )
    return with_separation(world, built, stamp)


def holding_plan(world: World, plans: Sequence[Plan], stamp: float) -> Plan:
    """Return the first plan that breaks no deadline which the lists in force keep.

    Args:
        world: as it is now.
        plans: in the order of preference.
        stamp: [s] published clock.

    Returns:
        The first of all where each breaks one: its lists are held back, see `held_lists`.
    """
    if all(math.isinf(record.task.latest) for record in world.tasks.open()):
        return plans[0]
    for each in plans:
        lists = build_lists(world, each, stamp).lists
        held, _ = held_lists(world, lists, stamp)
        if all(held[uav_id] is lists[uav_id] for uav_id in lists):
            return each
    return plans[0]


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


def _proposal(world: World, chosen: Plan, built: BuiltLists, held: Iterable[str],
              before: TaskIdsByUav, trigger: str, stamp: float) -> Proposal:
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


def _waits(proposal: Proposal) -> str:
    return f'waits for the approval of plan {proposal.revision}'


class Approvals:
    """The proposal that is open, and what was rejected last.

    Args:
        world: whose `proposal` is the open one.

    Arguments of methods:
        stamp: [s] clock of the node.
        operator: who decides; '' for the deadline.
        proposal: of a plan, without its revision.
        revision: of a proposal.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._rejected: Proposal | None = None
        self._rejected_version = -1  # of the world
        if world.proposal is not None:
            world.outbox.proposal = world.proposal

    @property
    def quiet(self) -> bool:
        """Whether no plan is sought without an event: one is open, or was just rejected."""
        return (self._world.proposal is not None
                or self._rejected_version == self._world.version)

    def propose(self, proposal: Proposal | None) -> str:
        """Open a proposal, which replaces an open one; None: no change is proposed any more.

        Returns:
            Why a task that only the proposal has in a list has no UAV yet.
        """
        world, known, rejected = self._world, self._world.proposal, self._rejected
        if proposal is None:
            if known is not None:
                self.withdraw('a newer plan needs no approval')
            return ''
        if known is not None and same_proposal(world, proposal, known):
            return _waits(known)
        if rejected is not None and same_proposal(world, proposal, rejected):
            if known is not None:
                self.withdraw('the newer plan was rejected before')
            return f'plan {rejected.revision} with it was rejected'
        replaces = f', replaces {known.revision}' if known else ''
        changes = (f'replaces plan {known.revision}',) if known else ()
        proposal = replace(proposal, revision=world.next_revision(),
                           changes=(*proposal.changes, *changes))
        self._set(proposal)
        world.note(f'plan {proposal.revision} ({proposal.trigger}) waits for approval{replaces}: '
                   f'{first_of(proposal.changes, separator="; ")}')
        return _waits(proposal)

    def refusal(self, revision: int) -> str:
        """Return why the proposal of a revision cannot be decided; '' if it can."""
        known = self._world.proposal
        if known is None:
            return 'no plan waits for approval'
        if revision != known.revision:
            return (f'revision = {revision}: expected {known.revision}, that of the plan that '
                    'waits for approval')
        return ''

    def reject(self, operator: str) -> None:
        """Drop the open proposal."""
        # the rejection itself requests a plan, so that each task has its reason
        self._rejected, self._rejected_version = self._world.proposal, self._world.version + 1
        self._close(f'rejected by {operator}' if operator else 'rejected: its time is over')

    def accept(self, operator: str) -> None:
        """Close the open proposal, whose lists are put in force."""
        self._close(f'accepted by {operator}' if operator else 'accepted: its time is over')

    def clock_jumped(self, by: float) -> None:
        """Shift the deadline and the lists of the open proposal with the published clock.

        Args:
            by: [s] of the jump.
        """
        known = self._world.proposal
        if known is not None:
            self._set(replace(
                known, stamp=known.stamp + by, deadline=known.deadline + by,
                lists=tuple(shifted_list(each, by) for each in known.lists)))

    def expired(self, stamp: float) -> bool:
        """Return whether the time of the open proposal is over."""
        proposal = self._world.proposal
        return proposal is not None and stamp >= proposal.deadline

    def withdraw(self, why: str) -> None:
        """Close the open proposal undecided.

        Args:
            why: for the log.
        """
        self._close(f'withdrawn: {why}')

    def _close(self, what: str) -> None:
        proposal = self._world.proposal
        assert proposal is not None
        text = f'plan {proposal.revision}: {what}'
        self._world.note(text)
        self._set(None)
        self._world.outbox.proposal = replace(
            proposal, lists=(), changes=(text,), deadline=0.0, accepted_on_timeout=False)

    def _set(self, proposal: Proposal | None) -> None:
        self._world.proposal = proposal
        self._world.outbox.proposal = proposal
        self._world.mark_unsaved('proposal')
