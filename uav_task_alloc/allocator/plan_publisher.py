# SPDX-License-Identifier: Apache-2.0
"""Puts lists of plans in force, and publishes what is in force as allocations."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.records import Allocation
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists, plan_in_force
from uav_task_alloc.allocator.replanning.list_rate_limiter import ListRateLimiter
from uav_task_alloc.allocator.replanning.predictions import Predictions
from uav_task_alloc.allocator.replanning.task_reasons import task_steps
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.allocator.status import allocation_line, last_finish
from uav_task_alloc.model import Plan


class PlanPublisher:
    """The plan in force: its lists, the tasks that it leaves out, and its allocations.

    Args:
        world: of the allocator.
        chosen: the plan of the lists that the journal restored.
        now: [s] steady clock.

    Arguments of methods:
        built: lists of a plan.
        chosen: that plan.
        trigger: why it was made, for the log.
        now: [s] steady clock.
        stamp: [s] clock of the node.
    """

    def __init__(self, world: World, chosen: Plan, now: float) -> None:
        self._world, self._chosen = world, chosen  # the last plan that was put in force
        self._limiter = ListRateLimiter()
        self._together: tuple[str, ...] = ()  # UAVs that the lists in force do not keep apart
        self._predictions = Predictions(world, now)
        self.left_out: dict[str, str] = {}  # task id -> reason
        self._passes = math.inf  # [s] published clock: the next latest of these passes

    def due(self, now: float) -> bool:
        """Return whether lists that were deferred may be published now."""
        return self._limiter.due(now)

    def put_permitted(self, built: BuiltLists, chosen: Plan, now: float,
                      stamp: float) -> list[str]:
        """As `put`, but lists that follow the last ones too soon are deferred."""
        world = self._world
        permitted = self._limiter.permitted(world.lists_in_force(), built.lists,
                                            world.must_change, now, world.params.list_interval)
        return self.put(replace(built, lists=permitted), chosen, now, stamp)

    def put(self, built: BuiltLists, chosen: Plan, now: float, stamp: float) -> list[str]:
        """Put lists of a plan in force; returns the UAVs whose lists changed."""
        world = self._world
        world.set_built(built.zones_when_built, built.paths_home, built.later)
        for text in built.together:
            if text not in self._together:
                world.note(text, warning=True)
        self._together = built.together
        self.left_out = world.deadlines.left_out(built.left_out, stamp)
        self._passes = self._next_latest(stamp)
        published = world.publish(built.lists, stamp)
        self._limiter.published(published, now)
        starts = chosen.timetable().starts if built.later else {}
        self._predictions.later = {name: stamp + starts[name] for trips in built.later.values()
                                   for trip in trips for name in trip if name in starts}
        self._predictions.planned(now, stamp)
        self.step_tasks(stamp)
        world.outbox.statuses |= bool(published) or bool(world.tasks.unsaved)
        return published

    def step_tasks(self, stamp: float) -> None:
        """Set the state and the reason of every open task."""
        self._world.step_tasks(task_steps(self._world, self.left_out), stamp)

    def allocate(self, chosen: Plan, trigger: str, stamp: float) -> None:
        """Publish the lists in force as an allocation."""
        world, self._chosen = self._world, chosen
        world.plan_revision = world.revision + 1
        allocation = self._allocate(world.lists_in_force().values(), trigger, stamp)
        world.note(allocation_line(allocation, last_finish(world, stamp)))

    def allocate_again(self, trigger: str, stamp: float) -> None:
        """Publish the plan in force again, for which no list has got other tasks."""
        self._allocate(self._world.lists_in_force().values(), trigger, stamp)

    def _next_latest(self, stamp: float) -> float:
        """When the next latest of a task that the plan leaves out passes; inf: none does."""
        records = map(self._world.task_records().get, self.left_out)
        return min((each.task.latest for each in records if each and each.task.latest >= stamp),
                   default=math.inf)

    def _note_passed(self, stamp: float) -> None:
        """Say of tasks that are left out that their latest has passed, where that is so now."""
        if stamp <= self._passes:
            return
        records = self._world.task_records()
        self.left_out |= self._world.deadlines.left_out({
            task_id: why for task_id, why in self.left_out.items()
            if task_id in records and records[task_id].task.latest < stamp}, stamp)
        self._passes = self._next_latest(stamp)
        self.step_tasks(stamp)
        self._world.outbox.statuses = True

    def predict(self, now: float, stamp: float) -> None:
        """Publish predicted times of the lists in force, and reasons, where they are news."""
        self._note_passed(stamp)
        if self._predictions.tick(now, stamp):
            self._allocate(self._predictions.lists(stamp).values(), 'predicted arrivals', stamp)

    def _allocate(self, lists: Iterable[UavList], trigger: str, stamp: float) -> Allocation:
        world = self._world
        plan = plan_in_force(world.lists, world.tasks, self.left_out, self._chosen)
        allocation = Allocation(world.next_revision(), tuple(lists), plan, trigger, stamp)
        world.outbox.allocation = allocation
        return allocation
