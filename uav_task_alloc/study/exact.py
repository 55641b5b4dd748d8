# SPDX-License-Identifier: Apache-2.0
"""Exact optima of tiny problems with time, by trying all routes; uses no solver.

All orders and divisions in trips of all sets of tasks are evaluated for each UAV, then the UAVs
share the tasks. For some six tasks: the number of routes grows with their factorial. Where only
services, windows, releases and ranges count, routes to the same end of the same task over the same
tasks are dropped that are neither cheaper nor earlier nor shorter: for ten, or seven with paths.
"""
from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

from uav_task_alloc.geometry.flight_time import service_seconds
from uav_task_alloc.model import Task, Uav, turned_tasks
from uav_task_alloc.objective import Objective
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.timed.evaluator import TimedEvaluation, evaluate_routes
from uav_task_alloc.solver.timed.schedule import Held, LegOf, straight_legs

Rows = tuple[tuple[str, ...], ...]  # task ids of each trip


@dataclass(frozen=True, slots=True)
class ExactPlan:
    """The best plan: the most value where every task that can be is served, then least cost."""

    cost: float
    value: float
    routes: Mapping[str, Rows]  # by UAV id
    reversed: frozenset[str] = frozenset()  # ids of tasks flown from their last points


@dataclass(frozen=True, slots=True)
class _Share:
    """What some UAVs serve: no other way is both cheaper and earlier."""

    cost: float  # without finish and tasks not served
    finish: float  # [s]
    routes: tuple[tuple[str, Rows], ...]
    turned: frozenset[str] = frozenset()  # ids of tasks flown from their last points


_Shares = dict[frozenset[str], list[_Share]]  # by ids of the tasks served


def exact_plan(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
               leg: LegOf | None = None, held: Held | None = None,
               reversed: Collection[str] = ()) -> ExactPlan | None:
    """Find the best plan of all, with tasks that have a path flown in all ways that are allowed.

    Args:
        uavs, tasks, rules, leg, held: as for `evaluate_routes`.
        reversed: ids of the locked tasks that are flown from their last points.

    Returns:
        None where no plan is valid: a locked task cannot be served.
    """
    held = held or Held()
    fixed = {name for row in held.locked.values() for name in row}
    if not fixed and all(_is_plain(uav, tasks, rules, held) for uav in uavs):
        return _exact_plan(uavs, tasks, rules, leg, held)
    free = [task.id for task in tasks if task.path and task.reversible and task.id not in fixed]
    best: ExactPlan | None = None
    for many in range(len(free) + 1):
        for names in combinations(free, many):
            turned = frozenset((*fixed.intersection(reversed), *names))
            found = _exact_plan(uavs, turned_tasks(tasks, turned), rules, leg, held)
            if found is not None and (best is None or rank(
                    found.value, found.cost, rules) < rank(best.value, best.cost, rules)):
                best = replace(found, reversed=turned)
    return best


def _exact_plan(uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules, leg: LegOf | None,
                held: Held) -> ExactPlan | None:
    """The best plan; paths are flown from their first points by UAVs that are not plain."""
    shares: _Shares = {frozenset(): [_Share(0.0, 0.0, ())]}
    for uav in uavs:
        shares = _joined(shares, _shares_of(uav, uavs, tasks, rules, leg, held))
    values = {task.id: task.value for task in tasks}
    total, prices = math.fsum(values.values()), rules.objective
    best: ExactPlan | None = None
    for served, ways in shares.items():
        value = math.fsum(values[name] for name in served)
        for way in ways:
            cost = way.cost + prices.cost(0.0, way.finish, unserved=total - value)
            if best is None or rank(value, cost, rules) < rank(best.value, best.cost, rules):
                best = ExactPlan(cost, value, dict(way.routes), way.turned)
    return best


def rank(value: float, cost: float, rules: Rules) -> tuple[float, float]:
    """Return what plans are compared by.

    Args:
        value: of the tasks served.
        cost: of the objective.
        rules: whether every task that can be served is.

    Returns:
        Smaller is better.
    """
    return (-round(value, 9) if math.isinf(rules.objective.unserved) else 0.0), cost


def _joined(some: _Shares, more: _Shares) -> _Shares:
    """The ways in which UAVs share tasks with one more UAV."""
    joined: _Shares = {}
    for done, ways in some.items():
        for mine, rows in more.items():
            if not done & mine:
                for way in ways:
                    for row in rows:
                        _keep(joined, done | mine, _Share(
                            way.cost + row.cost, max(way.finish, row.finish),
                            way.routes + row.routes, way.turned | row.turned))
    return joined


def _keep(shares: _Shares, served: frozenset[str], new: _Share) -> None:
    """Add a way unless another one is as cheap and as early; drop those that it dominates."""
    ways = shares.setdefault(served, [])
    if all(way.cost > new.cost or way.finish > new.finish for way in ways):
        ways[:] = [way for way in ways if way.cost < new.cost or way.finish < new.finish]
        ways.append(new)


def _shares_of(uav: Uav, uavs: Sequence[Uav], tasks: Sequence[Task], rules: Rules,
               leg: LegOf | None, held: Held) -> _Shares:
    """All that one UAV can serve, and nothing."""
    taken = {task.id for task in tasks for other in uavs if other is not uav and (
        held.has_locked(other, task) or held.has_aboard(other, task))}
    if _is_plain(uav, tasks, rules, held):
        return _shares_by_labels(uav, [task for task in tasks if task.id not in taken], tasks,
                                 rules, leg or straight_legs(rules))
    own = Held({uav.id: held.locked.get(uav.id, ())}, held.aboard)
    total = math.fsum(task.value for task in tasks)
    shares: _Shares = {} if own.locked[uav.id] else {frozenset(): [_Share(0.0, 0.0, ())]}
    for rows, found in _valid_rows(uav, tasks, taken, rules, leg, own):
        shared = rules.objective.cost(0.0, found.finish, unserved=total - found.value)
        _keep(shares, frozenset(name for row in rows for name in row),
              _Share(found.cost - shared, found.finish, ((uav.id, rows),)))
    return shares


def _is_plain(uav: Uav, tasks: Sequence[Task], rules: Rules, held: Held) -> bool:
    """Whether an earlier arrival is never worse, and nothing else limits a route."""
    one_trip = rules.trips == 1 or math.isinf(uav.turnaround)
    unlimited = math.isinf(uav.endurance) and (math.isinf(uav.range) or rules.hard)
    return (one_trip and unlimited and not held.locked.get(uav.id)
            and not any(task.payload for task in tasks))


@dataclass(frozen=True, slots=True)
class _Label:
    """A route over some tasks to one of them."""

    time: float  # [s] end of the service there
    cost: float  # so far, without finish
    metres: float  # so far
    row: tuple[str, ...]
    turned: frozenset[str]  # ids of tasks flown from their last points


_Labels = dict[tuple[frozenset[str], Task | None], list[_Label]]  # by tasks, and the last as flown


def _shares_by_labels(uav: Uav, free: Sequence[Task], tasks: Sequence[Task], rules: Rules,
                      leg: LegOf) -> _Shares:
    """All that one UAV can serve, in all directions, by dynamic programming over sets of tasks."""
    able = [task for task in free if task.required_capabilities <= uav.capabilities
            and (task.allowed_uavs is None or uav.id in task.allowed_uavs)]
    flown = [(task, service_seconds(uav, task), frozenset[str]()) for task in able]
    flown += [(task.turned, service_seconds(uav, task.turned), frozenset({task.id}))
              for task in able if task.path and task.reversible]
    leg = cache(leg)
    total = math.fsum(task.value for task in tasks)
    shares: _Shares = {frozenset(): [_Share(0.0, 0.0, ())]}
    labels: _Labels = {(frozenset(), None): [
        _Label(uav.available_from, 0.0, 0.0, (), frozenset())]}
    for _ in range(len(able)):
        longer: _Labels = {}
        for (done, last), some in labels.items():
            for task, service, turned in flown:
                if task.id not in done:
                    place = uav.position if last is None else last.end
                    metres, seconds = leg(uav, place, task.position)
                    way = metres + task.path_length, seconds, service
                    for label in some:
                        _extend(longer.setdefault((done | {task.id}, task), []), label, task,
                                turned, way, uav.range, rules.objective, total)
        labels = longer
        for (done, last), some in labels.items():
            assert last is not None  # each label of this round has a task
            home = leg(uav, last.end, uav.base) if rules.returns else (0.0, 0.0)
            for label in some:
                _end(shares, uav, done, label, home, rules.objective)
    return shares


def _end(shares: _Shares, uav: Uav, done: frozenset[str], label: _Label,
         home: tuple[float, float], prices: Objective) -> None:
    """Keep the route of a label with the leg home: its length [m] and time [s]."""
    end = label.time + home[1]
    if end <= uav.available_until + 1e-6 and label.metres + home[0] <= uav.range + 1e-6:
        _keep(shares, done, _Share(label.cost + prices.cost(home[0]), end,
                                   ((uav.id, (label.row,)),), label.turned))


def _extend(labels: list[_Label], label: _Label, task: Task, turned: frozenset[str],
            way: tuple[float, float, float], reach: float, prices: Objective,
            total: float) -> None:
    """Add the route of a label and one more task, unless it is too late or dominated.

    way: length [m] with its path, time of the leg, service [s]; turned: its id if it is flown from
    its last point; reach: most length of a route [m], where infinite lengths do not matter.
    """
    start = max(max(label.time, task.release) + way[1], task.earliest)
    late, metres = max(0.0, start - task.latest), label.metres + way[0]
    if (late > 1e-6 and math.isinf(prices.lateness)) or metres > reach + 1e-6:
        return
    response = task.value * (start - task.announced) / total
    new = _Label(start + way[2], label.cost + prices.cost(way[0], 0.0, response, late),
                 metres if reach < math.inf else 0.0, (*label.row, task.id),
                 label.turned | turned)
    if all(other.time > new.time or other.cost > new.cost or other.metres > new.metres
           for other in labels):
        labels[:] = [each for each in labels if each.time < new.time or each.cost < new.cost
                     or each.metres < new.metres]
        labels.append(new)


def _valid_rows(uav: Uav, tasks: Sequence[Task], taken: Container[str], rules: Rules,
                leg: LegOf | None, held: Held) -> Iterator[tuple[Rows, TimedEvaluation]]:
    """All valid routes of a UAV that serve something, but no task that is `taken`."""
    most = rules.trips if uav.turnaround < math.inf else 1
    names = [task.id for task in tasks if task.id not in taken]
    free = replace(uav, range=math.inf, full_range=None, endurance=math.inf, full_endurance=None,
                   available_until=math.inf)
    open_end = replace(rules, returns=False)
    pending: list[Rows] = [(tuple(held.locked.get(uav.id, ())),)]
    while pending:
        rows = pending.pop()
        if any(rows):
            found = evaluate_routes([uav], tasks, rules, {uav.id: rows}, leg, held)
            if not found.violations:
                yield rows, found
            elif evaluate_routes([free], tasks, open_end, {uav.id: rows}, leg, held).violations:
                continue  # late, overloaded or unable: no longer route mends that
        done = {name for row in rows for name in row}
        for name in names:
            if name not in done:
                pending.append((*rows[:-1], (*rows[-1], name)))
                if len(rows) < most and (rows[-1] or len(rows) == 1):
                    pending.append((*rows, (name,)))
