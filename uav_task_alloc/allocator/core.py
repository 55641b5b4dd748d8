# SPDX-License-Identifier: Apache-2.0
"""The allocator: a world that is solved when it changed, and the lists that follow from it.

No clock, no thread, no I/O: `now` is [s] of a steady clock, `stamp` [s] of the published one.
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial

from uav_task_alloc.allocator.persistence.restore import (
    Saved,
    list_row,
    off_row,
    revision_row,
    task_row,
    zones_row,
)
from uav_task_alloc.allocator.records import (
    Allocation,
    Outbox,
    ReplanAnswer,
    ReplanProblem,
    UavList,
)
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.replanning.learned_state import learner, learner_row
from uav_task_alloc.allocator.replanning.list_rate_limiter import ListRateLimiter
from uav_task_alloc.allocator.replanning.plan_acceptance import steady
from uav_task_alloc.allocator.state.admission import forget_strangers
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.state.zone_checks import look_at_all
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import Plan
from uav_task_alloc.params import AllocatorParams

# [s] after a restart, from the UAV heard last on, in which no task changes hands: what was flown
# while nobody listened is told again meanwhile, by the bridge after 2 s
CAUTIOUS = 3.0
LEARNER = 5.0  # [s] between two rows of what the bees learnt


class Allocator:
    """Tell `world` what happens, call `tick` often, solve what `due` returns, `adopt` the
    answer, and publish what `collect` returns.
    """

    def __init__(self, params: AllocatorParams, now: float, saved: Saved | None = None) -> None:
        saved = saved or Saved()
        self.world = World(params, saved)
        self._best = Plan({each.uav: each.task_ids for each in saved.lists})
        self._learnt = saved.learnt
        self._learnt_at = now
        self._pace = ListRateLimiter()
        self._left: dict[str, str] = {}  # task id -> why it is left out
        # UAVs of the journal get time to be heard before they lose anything
        self._wait_for = {each.uav for each in saved.lists if each.stops}
        self._wait_until = now + params.uav_timeout
        self._restarted = bool(saved.lists)
        self._cautious_until = now + CAUTIOUS
        self.world.cautious = any(each.stops for each in saved.lists)
        self.world.again.update(each.uav for each in saved.lists)
        if saved.tasks:
            self.world.outbox.statuses = True
            self.world.touch('restart', now)

    def wake(self) -> None:
        """The kernels are compiled: solving may begin."""
        self.world.awake = True
        self._best = replace(self._best, state=learner(self._learnt))

    def tick(self, now: float, stamp: float) -> None:
        """Whatever time brings: UAVs fall silent, ended tasks leave the lists."""
        world = self.world
        world.look_for_silence(now)
        forget_strangers(world, now)
        look_at_all(world, now)
        for uav_id in list(world.lists.lists):
            shorter = world.lists.without_flown(uav_id, self._ended, stamp)
            if shorter is not None:
                self._publish({uav_id: shorter}, stamp)
        # one with an ended task further back waits for the plan: its legs are not true any more
        for uav_id in sorted(world.again):
            if not any(map(self._ended, world.lists.get(uav_id).task_ids)):
                self._publish({uav_id: world.lists.aged(uav_id, stamp)}, stamp, again=True)
        if self._restarted:  # the plan of the last life is in force, and told before any other
            self._restarted = False
            self._tell(Plan({}), 'restart', stamp)
        if world.cautious and self._waiting(now):
            self._cautious_until = now + CAUTIOUS
        elif world.cautious and now >= self._cautious_until:
            world.cautious = False
            world.touch('some time after a restart', now)
        if self._pace.due(now):
            world.touch('lists held back', now)
        if len(world.tasks.ended) > world.params.keep_ended:
            world.lists.forget(world.tasks.forget(world.params.keep_ended, world.lists.owners()))
        if world.outbox.statuses:
            planning.explain(world, self._left, stamp)

    def _ended(self, task_id: str) -> bool:
        record = self.world.tasks.records.get(task_id)
        return record is None or not record.open

    def due(self, now: float, stamp: float) -> ReplanProblem | None:
        """The problem to solve now, if any; nothing while one is being solved."""
        world, schedule, params = self.world, self.world.schedule, self.world.params
        if not world.awake or schedule.busy or self._waiting(now):
            return None
        if schedule.settled(now, params.settle):
            trigger = schedule.begin(now)
            if any(world.fleet.usable(uav_id) for uav_id in world.fleet.records):
                return planning.problem(world, self._best, trigger, background=False)
            self._take(Plan({}), trigger, True, now, stamp)
            schedule.end(now)
        elif (params.background_budget > 0.0 and world.fleet.records and world.tasks.open()
              and schedule.rested(now, params.background_period)
              and any(world.fleet.usable(uav_id) for uav_id in world.fleet.records)):
            schedule.begin(now)
            return planning.problem(world, self._best, 'background', background=True)
        return None

    def _waiting(self, now: float) -> bool:
        self._wait_for -= set(self.world.fleet.records)
        return bool(self._wait_for) and now < self._wait_until

    def hurry(self, now: float, background: bool) -> bool:
        """Whether the running solve should answer now, as newer events wait for it."""
        schedule, params = self.world.schedule, self.world.params
        return schedule.settled(now, params.settle) and (
            background or schedule.overdue(now, params.solve_budget))

    def adopt(self, answer: ReplanAnswer | None, now: float, stamp: float) -> None:
        """Take over what is better by the margin and still true; None: the solve failed."""
        self.world.schedule.end(now, failed=answer is None)
        if answer is None:
            return
        self._best = answer.fresh
        if now - self._learnt_at >= LEARNER:
            self._learnt_at = now
            self.world.dirty.add('learner')
        chosen = replace(steady(answer, self.world.params.replan_margin),
                         iterations=answer.fresh.iterations,
                         solve_time=answer.base.solve_time + answer.fresh.solve_time,
                         warm_started=any(answer.problem.held.routes.values()))
        self._take(chosen, answer.problem.trigger, not answer.problem.background, now, stamp)

    def _take(self, chosen: Plan, trigger: str, always: bool, now: float, stamp: float) -> None:
        world = self.world
        lists, self._left = planning.lists_of(world, chosen)
        lists = self._pace.ripe(world.lists.lists, lists, partial(planning.must_change, world),
                                now, world.params.list_interval)
        told = self._publish(lists, stamp)
        self._pace.told(told, now)
        changed = bool(told)
        planning.explain(world, self._left, stamp)
        world.outbox.statuses |= changed or always or bool(world.tasks.dirty)
        if changed or always:
            self._tell(chosen, trigger, stamp)

    def _tell(self, found: Plan, trigger: str, stamp: float) -> None:
        """The lists in force as an allocation."""
        world = self.world
        world.revision += 1
        world.dirty.add('revision')
        world.outbox.allocation = Allocation(
            world.revision, tuple(world.lists.lists.values()),
            planning.held_plan(world, self._left, found), trigger, stamp)

    def _publish(self, lists: Mapping[str, UavList], stamp: float,
                 again: bool = False) -> list[str]:
        """Put lists in force; returns for whom that is news."""
        made = [self.world.lists.publish(each, stamp, again) for each in lists.values()]
        told = {each.uav: each for each in made if each}
        self.world.outbox.lists.update(told)
        self.world.again -= set(told)
        return list(told)

    def collect(self) -> Outbox:
        """What has to be told since the last call; the rows belong on disk before."""
        out, self.world.outbox = self.world.outbox, Outbox()
        return out

    def rows(self, most: int | None = None) -> list[JournalRow]:
        """What changed and is not on disk yet, `most` tasks of it; `written` says that it is."""
        world = self.world
        tasks = world.tasks.records
        rows = [task_row(tasks[task_id]) if task_id in tasks else JournalRow('task', task_id, None)
                for task_id in sorted(world.tasks.dirty)[:most]]
        lists = world.lists.lists
        rows += [list_row(lists[uav_id]) if uav_id in lists else JournalRow('list', uav_id, None)
                 for uav_id in sorted(world.lists.dirty)]
        made = {'zones': lambda: zones_row(world.zones.values()),
                'off': lambda: off_row(world.fleet.off),
                'revision': lambda: revision_row(world.revision),
                'learner': lambda: learner_row(self._best.state)}
        return rows + [made[name]() for name in sorted(world.dirty)]

    def nothing_written(self) -> None:
        """The disk has nothing of this world: all of it is to be written."""
        world = self.world
        world.tasks.dirty.update(world.tasks.records)
        world.lists.dirty.update(world.lists.lists)
        world.dirty.update(('zones', 'off', 'revision', 'learner'))

    def written(self, rows: Iterable[JournalRow] | None = None) -> bool:
        """These are on disk, None: need not be; returns whether nothing is left to save."""
        world = self.world
        books = {'task': world.tasks.dirty, 'list': world.lists.dirty}
        for row in rows or ():
            books.get(row.kind, world.dirty).discard(row.id or row.kind)
        for book in (*books.values(), world.dirty):
            if rows is None:
                book.clear()
        return not (world.tasks.dirty or world.lists.dirty or world.dirty)
