# SPDX-License-Identifier: Apache-2.0
"""The allocator: a world that is planned for when it changed, and the lists that follow.

No clock, no thread, no I/O: `now` is [s] of a steady clock, `stamp` [s] of the published one.
"""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from math import inf, isinf

from uav_task_alloc.allocator.battery_watch import BatteryWatch
from uav_task_alloc.allocator.giving_way import GivingWay
from uav_task_alloc.allocator.persistence import unsaved_rows
from uav_task_alloc.allocator.plan_publisher import PlanPublisher
from uav_task_alloc.allocator.records import Outbox, SavedState
from uav_task_alloc.allocator.replan_records import ReplanAnswer, ReplanProblem
from uav_task_alloc.allocator.replanning.accepted_lists import accepted_lists, plan_of_lists
from uav_task_alloc.allocator.replanning.approvals import Approvals
from uav_task_alloc.allocator.replanning.battery_changes import BatteryChanges
from uav_task_alloc.allocator.replanning.built_lists import BuiltLists
from uav_task_alloc.allocator.replanning.from_now import is_timed
from uav_task_alloc.allocator.replanning.learned_state import learned_state
from uav_task_alloc.allocator.replanning.lists_to_publish import lists_to_publish, plan_to_publish
from uav_task_alloc.allocator.replanning.planning import replan_problem
from uav_task_alloc.allocator.replanning.proposal import split_plan
from uav_task_alloc.allocator.replanning.schedule import Schedule
from uav_task_alloc.allocator.replanning.trips import waiting_uavs
from uav_task_alloc.allocator.replanning.waiting_places import WaitingPlaces
from uav_task_alloc.allocator.separation_watch import SeparationWatch
from uav_task_alloc.allocator.state.ended_tasks import EndedTasks
from uav_task_alloc.allocator.state.list_updates import ListUpdates
from uav_task_alloc.allocator.state.safe_paths import SafePaths
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.journal import JournalRow
from uav_task_alloc.model import Plan, ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.monitor import MonitorStep
from uav_task_alloc.terrain import Terrain

# [s] after a restart, from the lists and the first report of the last UAV on, in which no task
# changes its UAV: the bridge repeats events that were missed 2 s after it has its list again
_RESTART_HOLD = 3.0
_CLOCK_STEP = 5.0  # [s] that clocks may be apart
FASTEST_CLOCK, REAL_CLOCK = 200.0, 2.0  # times real time: of a simulation, of a computer
_LEARNED_PERIOD = 5.0  # [s] between two rows of the learned state


class Allocator:
    """The allocator without I/O.

    Apply inputs to `world`, call `tick` often, solve what `due` returns, `adopt` the answer, and
    publish what `collect` returns, before the next `tick`.

    Args:
        params: of the node.
        now: [s] steady clock.
        saved: what the journal restored; None: nothing.
        terrain: the ground; None: none is known.

    Arguments of methods:
        now: [s] steady clock.
        stamp: [s] clock of the node.
        background: the running solve was begun without an event.
        answer: of the solve that `due` asked for.
        most: number of tasks; None: all.
        rows: of the journal.
        task_id: as announced.
    """

    def __init__(self, params: AllocatorParams, now: float,
                 saved: SavedState | None = None, terrain: Terrain | None = None) -> None:
        saved = saved or SavedState()
        self.schedule = Schedule()
        self.world = World(params, saved, partial(make_safe_paths, terrain=terrain),
                           self.schedule.add_trigger, terrain)
        self.approvals = Approvals(self.world)
        self.separation = SeparationWatch(self.world)
        self._list_updates = ListUpdates(self.world.tasks, self.world.lists, self.world.flights)
        self._ended = EndedTasks(self.world.tasks, self.world.works, self.world.lists)
        self.batteries = BatteryWatch(self.world)
        self.waiting = WaitingPlaces(self.world)
        self._changes = BatteryChanges(self.world, self.waiting)
        self._giving_way = GivingWay(self.world, self.waiting, self.separation)
        self._best = Plan({each.uav: each.task_ids for each in saved.lists}, reversed=frozenset(
            stop.task.id for each in saved.lists for stop in each.stops if stop.reversed))
        self._learned = saved.learned
        self._learned_saved = now  # [s]
        self._clock: tuple[float, float] | None = None  # published and steady [s], last tick
        self.clock_rate = FASTEST_CLOCK  # times real time at which the published clock may run
        self._publisher = PlanPublisher(self.world, self._best, now)
        # UAVs of the journal get time to report before they lose their tasks
        proposed = saved.proposal.lists if saved.proposal else ()
        self._awaited = {each.uav for each in (*saved.lists, *proposed) if each.stops}
        self._wait_until = now + params.uav_timeout
        self._restarted = bool(saved.lists)
        self._hold_until = now + _RESTART_HOLD
        if saved.tasks:
            self.world.outbox.statuses = True
            self.world.request_replan('restart', now)

    def set_kernels_ready(self) -> None:
        """Allow solving: the kernels are compiled."""
        self.world.kernels_ready = True
        self._best = replace(self._best, state=learned_state(self._learned))

    def tick(self, now: float, stamp: float) -> None:
        """Apply what follows from time: silent UAVs, shortened lists, the end of the hold."""
        world = self.world
        self._watch_clock(now, stamp)
        world.outbox.statuses |= world.announced.cut_again(stamp)
        world.tick(now)
        self.batteries.tick(now, stamp)
        self._end_orders(stamp)
        self._changes.end(now, stamp)
        if isinf(self._hold_until):  # the lists of the previous run are published by now
            self._hold_until = now + _RESTART_HOLD
        if self._restarted:  # the plan of the previous run is published before any other
            self._restarted, self._hold_until = False, inf
            world.publish(self._list_updates.of_previous_run(stamp), stamp, resend=True)
            self._publisher.allocate(Plan({}), 'restart', stamp)
        world.publish(self._list_updates.shortened(stamp), stamp)
        world.publish(self._list_updates.to_resend(stamp), stamp, resend=True)
        self._check_hold(now)
        self._check_approval(now, stamp)
        if self._publisher.due(now):
            world.request_replan('deferred lists', now)
        self._ended.forget_oldest(world.params.keep_ended)
        self._wait_for_tasks(now, stamp)
        self._publisher.predict(now, stamp)
        if world.outbox.statuses:
            self._publisher.step_tasks(stamp)

    def _wait_for_tasks(self, now: float, stamp: float) -> None:
        """Send idle UAVs to waiting places, or out of the way, not while a plan may use them."""
        world, lists = self.world, self.waiting.ended(now)
        if not (self.schedule.busy or self.schedule.triggers):
            self._changes.send(now, stamp)
            lists = {**self.waiting.chosen(now, stamp), **lists,
                     **self._giving_way.lists(now, stamp)}
        published = world.publish(lists, stamp)
        if published:
            texts = self.waiting.texts()
            for uav_id in published:
                world.note(f'{uav_id} {texts.get(uav_id, "holds")}')
            self._publisher.allocate_again('waiting places', stamp)

    def _end_orders(self, stamp: float) -> None:
        """End the orders whose tasks have ended, and publish the holds that changed."""
        world = self.world
        for entry in world.orders.end_fulfilled(world.announced.why_ended, stamp):
            world.note(entry.text)
        for uav_id in world.orders.changed_holds:
            world.outbox.holds[uav_id] = world.orders.holds[uav_id]
        world.orders.changed_holds.clear()

    def _watch_clock(self, now: float, stamp: float) -> None:
        """After a jump of the published clock shift what is in force, and plan windows again.

        A simulated clock is 0 until it begins: what was announced before is announced then.
        """
        world, last = self.world, self._clock
        self._clock = stamp, now
        if last is None:  # lists of the previous run may be of a later time
            newest = max((each.stamp for each in world.lists.lists.values()), default=stamp)
            last = max(newest, stamp), now
        before, since = last
        latest = before + _CLOCK_STEP + self.clock_rate * (now - since)
        jumped = not before - _CLOCK_STEP <= stamp <= latest
        began = before <= 0.0 < stamp and jumped
        if began or (since == now and stamp > _CLOCK_STEP):
            world.tasks.clock_began(stamp)
            world.announced.seen.clock_began(stamp)
        if not jumped:
            return
        for part in (world.flights, world.lists, self.approvals, self.separation):
            part.clock_jumped(stamp - before)
        if any(is_timed(record.task) for record in world.tasks.open()):
            way = 'forward' if stamp > before else 'back'
            world.request_replan('the clock has begun' if began else (
                f'the clock jumped {way} by {abs(stamp - before):.1f} s'), now)

    def _check_hold(self, now: float) -> None:
        """End the hold after a restart when all awaited UAVs have reported for a while."""
        if self.world.restart_hold and self.awaited(now):
            self._hold_until = max(self._hold_until, now + _RESTART_HOLD)
        elif self.world.restart_hold and now >= self._hold_until:
            self.world.release_hold(now)

    def _check_approval(self, now: float, stamp: float) -> None:
        """Decide an open proposal whose time is over, or that needs no approval any more."""
        proposal = self.world.proposal
        if proposal is None or not self.world.kernels_ready or self.awaited(now):
            return
        if self.world.params.approval == 'none':
            self.approvals.withdraw('approval is none')
            self.world.request_replan('approval is none', now)
        elif self.approvals.expired(stamp):
            self.decide(proposal.accepted_on_timeout, '', now, stamp)

    def decide(self, accept: bool, operator: str, now: float, stamp: float) -> str:
        """Accept or reject the open proposal.

        Args:
            accept: put it in force.
            operator: who decides; '' for the deadline.
            now, stamp: see the class.

        Returns:
            Why it cannot be put in force any more; '' otherwise. It is withdrawn then, but not
            in the seconds after a restart in which no task changes its UAV.
        """
        world, proposal = self.world, self.world.proposal
        assert proposal is not None
        if not accept:
            self.approvals.reject(operator)
            world.request_replan(f'plan {proposal.revision} rejected', now)
            return ''
        built, why = accepted_lists(world, proposal, stamp)
        if why:
            if not world.restart_hold:
                self.approvals.withdraw(f'it cannot be put in force any more: {why}')
                world.request_replan(f'plan {proposal.revision} withdrawn', now)
            return why
        self.approvals.accept(operator)
        chosen = plan_of_lists(world, built.lists.values())
        planned = {*chain(*(each.task_ids for each in built.lists.values()),
                          *chain(*built.later.values()))}  # these wait no more
        left_out = {**self._publisher.left_out, **built.left_out}
        self._publisher.put(replace(built, left_out={
            task_id: reason for task_id, reason in left_out.items() if task_id not in planned}),
            chosen, now, stamp)
        self._publisher.allocate(chosen, f'plan {proposal.revision} accepted by '
                                 f'{operator or "its deadline"}', stamp)
        return ''

    def due(self, now: float, stamp: float) -> ReplanProblem | None:
        """Return the problem to solve now, if any; None while one is being solved."""
        world, schedule, params = self.world, self.schedule, self.world.params
        if not world.kernels_ready or schedule.busy or self.awaited(now):
            return None
        if schedule.settled(now, params.settle):
            trigger = schedule.begin(now)
            if world.fleet.usable_ids() or waiting_uavs(world, stamp):
                return replan_problem(world, self._best, trigger, background=False, stamp=stamp,
                                      outlook=self.waiting.outlook(stamp))
            self._apply(Plan({}), lists_to_publish(world, Plan({}), stamp), trigger, True,
                        now, stamp)
            schedule.end(now)
        elif (params.background_budget > 0.0 and schedule.rested(now, params.background_period)
              and world.fleet.usable_ids() and world.tasks.open() and not self.approvals.quiet):
            schedule.begin(now)
            return replan_problem(world, self._best, 'background', background=True,
                                  stamp=stamp, outlook=self.waiting.outlook(stamp))
        return None

    def awaited(self, now: float) -> list[str]:
        """Return the UAVs with tasks that have not reported since a restart, while they may.

        Args:
            now: [s] steady clock.
        """
        self._awaited = {uav_id for uav_id in self._awaited
                         if self.world.uav_record(uav_id) is None}
        return sorted(self._awaited) if now < self._wait_until else []

    def stop_early(self, now: float, background: bool) -> bool:
        """Return whether the running solve should end now, as newer events wait for it."""
        schedule, params = self.schedule, self.world.params
        return schedule.settled(now, params.settle) and (
            background or schedule.overdue(now, params.solve_budget))

    def adopt(self, answer: ReplanAnswer | None, now: float, stamp: float) -> None:
        """Apply what of an answer is better by the margin and still valid; None: it failed."""
        self.schedule.end(now, failed=answer is None)
        if answer is None:
            return
        self._best = answer.best
        if now - self._learned_saved >= _LEARNED_PERIOD:
            self._learned_saved = now
            self.world.mark_unsaved('learner')
        plan, built = plan_to_publish(self.world, answer, stamp)
        chosen = replace(plan, iterations=answer.best.iterations,
                         solve_time=answer.repaired.solve_time + answer.best.solve_time,
                         warm_started=any(answer.problem.published.routes.values()))
        self._apply(chosen, built, answer.problem.trigger, not answer.problem.background, now,
                    stamp)

    def _apply(self, chosen: Plan, built: BuiltLists, trigger: str, always: bool, now: float,
               stamp: float) -> None:
        """Put the lists of a plan in force; `always` publishes an allocation without changes."""
        world = self.world
        split = split_plan(world, chosen, built, trigger, stamp)
        why = self.approvals.propose(split.proposal)
        split.built.left_out.update(dict.fromkeys(split.waiting, why))
        published = self._publisher.put_permitted(split.built, chosen, now, stamp)
        world.outbox.statuses |= always
        if split.at_once and published:
            trigger = f'{trigger}; without approval for safety: {split.at_once}'
            world.note(trigger)
        if published or always:
            self._publisher.allocate(chosen, trigger, stamp)

    def separate(self, now: float, stamp: float) -> MonitorStep:
        """Return holds that keep UAVs apart, and alerts; publish them before lists."""
        return self.separation.step(now, stamp, bool(self.world.outbox.lists))

    def collect(self) -> Outbox:
        """Return what is to be published since the last call; save `rows` before it is."""
        out, self.world.outbox = self.world.outbox, Outbox()
        return out

    def collect_holds(self) -> Outbox:
        """As `collect`, but only holds and lines of the log, which hold in any ENU frame."""
        box = self.world.outbox
        out, box.holds, box.notes = Outbox(holds=box.holds, notes=box.notes), {}, []
        return out

    def rows(self, most: int | None = None) -> list[JournalRow]:
        """Return what is not on disk, at most `most` tasks of it; `written` confirms it."""
        return unsaved_rows.rows(self.world, self._best.state, most)

    def nothing_written(self) -> None:
        """Make `rows` return the whole world: the disk has nothing of it."""
        unsaved_rows.mark_all(self.world)

    def written(self, rows: Iterable[JournalRow] | None = None) -> bool:
        """Confirm rows that are on disk, None: all; returns whether nothing is left to save."""
        return unsaved_rows.mark_written(self.world, rows)

    def knows_task(self, task_id: str) -> bool:
        """Return whether a task was accepted, and is not forgotten."""
        return task_id in self.world.task_records()


def make_safe_paths(zones: Sequence[ThreatZone], params: AllocatorParams,
                    terrain: Terrain | None = None) -> SafePaths:
    """Return the paths around zones, over the ground where that is known.

    Args:
        zones: in force.
        params: of the allocator.
        terrain: the ground; None: none is known.

    Returns:
        Paths; imports the kernels, which a start must not wait for.
    """
    if terrain is not None:
        from uav_task_alloc.allocator.replanning.terrain_paths import TerrainPaths
        return TerrainPaths(zones, params, terrain)
    from uav_task_alloc.allocator.replanning.zone_paths import ZonePaths
    return ZonePaths(zones, params)
