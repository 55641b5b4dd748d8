# SPDX-License-Identifier: Apache-2.0
"""Random small problems with everything mixed, and what is wrong with a plan of one.

Windows, releases, services, payloads, capabilities, ranges, endurances, vertical speeds,
availabilities, battery swaps, UAVs in the air, locked tasks, open and closed routes, soft ranges,
all objectives. Plans are compared with the exact optimum, and reasons with what a UAV could do if
it served nothing else.
"""
from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from uav_task_alloc.actions import Action
from uav_task_alloc.model import Plan, Point, Task, Uav
from uav_task_alloc.objective import OBJECTIVES, Objective, check_objective, needs_time
from uav_task_alloc.solver.problem import Rules
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.solver.timed.evaluator import TimedEvaluation, evaluate_routes
from uav_task_alloc.solver.timed.schedule import Held
from uav_task_alloc.study.exact import exact_plan, rank

SMALL_SIDE = 1000.0  # [m]
_FAULT = 1e-6  # share of a cost, or [s], that is rounding


@dataclass(frozen=True, slots=True)
class SmallProblem:
    """A random problem of a few tasks."""

    seed: int
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    rules: Rules
    locked: Mapping[str, tuple[str, ...]]
    reversed: frozenset[str] = frozenset()  # locked tasks flown from their last points

    @property
    def held(self) -> Held:
        """What UAVs hold already."""
        return Held(self.locked)

    def evaluated(self, result: Plan) -> TimedEvaluation:
        """Evaluate a plan by its trips alone."""
        return evaluate_routes(self.uavs, self.tasks, self.rules, result.trips, held=self.held,
                               reversed=result.reversed)

    def solve(self, rounds: int, warm: Plan | None = None) -> Plan:
        """Solve it with the objective, in so many rounds; 0: insertion only."""
        return plan(self.uavs, self.tasks, budget=60.0, seed=self.seed, max_iterations=rounds,
                    warm=warm, route_end='home' if self.rules.returns else 'hold',
                    hard_range=self.rules.hard, locked=self.locked,
                    objective=self.rules.objective, trips=self.rules.trips,
                    reversed=self.reversed)


def small_problem(seed: int, most_tasks: int = 5, most_uavs: int = 3,
                  paths: float = 0.0, plain: bool = False) -> SmallProblem:
    """Draw a problem.

    Args:
        seed: of all random values.
        most_tasks, most_uavs: bounds of their numbers.
        paths: share of the tasks without payload that have a path.
        plain: without loads, endurances, battery swaps, locked tasks and soft ranges: the exact
            optimum of seven tasks is found in a second.

    Returns:
        One that time, loads, trips or the objective matter in.
    """
    rng = np.random.default_rng((seed, 18))
    while True:
        drawn = _with_paths(_draw(rng, seed, most_tasks, most_uavs, plain), paths)
        if needs_time(drawn.uavs, drawn.tasks, drawn.rules.objective, drawn.rules.trips):
            return drawn


def _draw(rng: np.random.Generator, seed: int, most_tasks: int, most_uavs: int,
          plain: bool) -> SmallProblem:
    on = {name: bool(rng.random() < 0.4) for name in (
        'windows', 'releases', 'loads', 'ranges', 'endurances', 'times', 'climb', 'air',
        'abilities', 'trips', 'locked')}
    if plain:
        on |= dict.fromkeys(('loads', 'endurances', 'trips', 'locked'), False)
    base = _place(rng, 0.0)
    uavs = [_uav(rng, f'u{i}', on, base) for i in range(rng.integers(1, most_uavs + 1))]
    tasks = [_task(rng, f't{i}', on, [uav.id for uav in uavs])
             for i in range(rng.integers(1, most_tasks + 1))]
    uavs = [_with_aboard(rng, uav, tasks) for uav in uavs]
    locked = _locked(rng, uavs, tasks) if on['locked'] and rng.random() < 0.5 else {}
    prices = rng.choice([0.0, 0.1, 1.0], 3).tolist()
    objective = list(OBJECTIVES.values())[rng.integers(4)] if rng.random() < 0.5 else Objective(
        prices[0], prices[1], prices[2], float(rng.choice([0.5, 10.0, math.inf])),
        float(rng.choice([50.0, 500.0, math.inf])))
    rules = Rules(bool(rng.random() < 0.5), bool(rng.random() < 0.85) or plain,
                  objective=objective, trips=int(rng.integers(2, 4)) if on['trips'] else 1)
    return SmallProblem(seed, tuple(uavs), tuple(tasks), rules, locked)


def _with_paths(drawn: SmallProblem, share: float) -> SmallProblem:
    """The same with paths for a share of the tasks; most may be flown in both directions."""
    rng = np.random.default_rng((drawn.seed, 23))
    tasks = tuple(_with_path(rng, task) if task.payload == 0.0 and rng.random() < share else task
                  for task in drawn.tasks)
    held = {name for row in drawn.locked.values() for name in row}
    return replace(drawn, tasks=tasks, reversed=frozenset(
        task.id for task in tasks if task.id in held and task.reversible and rng.random() < 0.5))


def _with_path(rng: np.random.Generator, task: Task) -> Task:
    path, actions = [task.position], list[Action]()
    for _ in range(rng.integers(1, 4)):
        x, y, z = path[-1]
        dx, dy, dz = rng.normal(0.0, 100.0, 3).round(1).tolist()
        path.append((x + dx, y + dy, max(0.0, z + 0.2 * dz)))
    if rng.random() < 0.2:
        actions = [Action('speed', (('speed', 5.0),)), Action('wait', (('seconds', 4.0),))]
    return replace(task, path=tuple(path), reversible=bool(rng.random() < 0.8),
                   actions=tuple(actions))


def _place(rng: np.random.Generator, most_height: float) -> Point:
    x, y = rng.uniform(0.0, SMALL_SIDE, 2)
    return round(float(x), 1), round(float(y), 1), round(float(rng.uniform(0.0, most_height)), 1)


def _some(rng: np.random.Generator, low: float, high: float, share: float = 0.7) -> float:
    """A number, or inf for a share of the draws."""
    return round(float(rng.uniform(low, high)), 1) if rng.random() < share else math.inf


def _uav(rng: np.random.Generator, name: str, on: Mapping[str, bool], base: Point) -> Uav:
    home = base if rng.random() < 0.5 else _place(rng, 0.0)
    values: dict[str, float] = {'cruise_speed': float(rng.choice([8.0, 10.0, 20.0]))}
    if on['ranges']:
        values['range'] = _some(rng, 300.0, 3000.0)
        if math.isfinite(values['range']) and rng.random() < 0.5:
            values['full_range'] = values['range'] + 1000.0
    if on['endurances']:
        values['endurance'] = _some(rng, 40.0, 400.0)
        if math.isfinite(values['endurance']) and rng.random() < 0.5:
            values['full_endurance'] = values['endurance'] + 100.0
    if on['times']:
        values['available_from'] = round(float(rng.uniform(0.0, 60.0)), 1)
        values['available_until'] = values['available_from'] + _some(rng, 50.0, 500.0)
    if on['climb']:
        values |= {'climb_speed': 2.5, 'descent_speed': 1.5}
    if on['trips']:
        values['turnaround'] = _some(rng, 0.0, 60.0, 0.8)
    if on['loads']:
        values['payload_capacity'] = float(rng.integers(0, 5))
    position = _place(rng, 100.0) if on['air'] and rng.random() < 0.6 else home
    able = frozenset({'camera'}) if rng.random() < 0.5 else frozenset[str]()
    return Uav(name, position, home=home, capabilities=able, **values)  # type: ignore[arg-type]


def _task(rng: np.random.Generator, name: str, on: Mapping[str, bool], uavs: list[str]) -> Task:
    values: dict[str, float] = {'value': float(rng.integers(1, 6)),
                                'service_time': float(rng.choice([0.0, 5.0, 30.0])),
                                'announced': -round(float(rng.uniform(0.0, 50.0)), 1)}
    if on['windows'] and rng.random() < 0.7:
        values['earliest'] = round(float(rng.uniform(-50.0, 200.0)), 1)
        values['latest'] = values['earliest'] + _some(rng, 10.0, 200.0, 0.8)
    if on['releases'] and rng.random() < 0.5:
        values['release'] = round(float(rng.uniform(-20.0, 150.0)), 1)
    if on['loads'] and rng.random() < 0.6:
        values['payload'] = float(rng.integers(1, 4))
    able = on['abilities'] and rng.random() < 0.4
    allowed = frozenset(uavs[:1]) if on['abilities'] and rng.random() < 0.2 else None
    return Task(name, _place(rng, 60.0), allowed_uavs=allowed,
                required_capabilities=frozenset({'camera'} if able else ()),
                **values)  # type: ignore[arg-type]


def _with_aboard(rng: np.random.Generator, uav: Uav, tasks: list[Task]) -> Uav:
    """In the air with one of the loads on board, now and then."""
    loaded = [task.id for task in tasks if task.payload > 0.0]
    if uav.at_base or not loaded or uav.id != 'u0' or rng.random() < 0.5:
        return uav
    return replace(uav, aboard=frozenset({loaded[0]}))


def _locked(rng: np.random.Generator, uavs: list[Uav],
            tasks: list[Task]) -> dict[str, tuple[str, ...]]:
    """One task locked to a UAV that may serve it."""
    uav, task = uavs[rng.integers(len(uavs))], tasks[rng.integers(len(tasks))]
    may = task.required_capabilities <= uav.capabilities and (
        task.allowed_uavs is None or uav.id in task.allowed_uavs) and task.payload == 0.0
    return {uav.id: (task.id,)} if may else {}


def plan_faults(problem: SmallProblem, result: Plan) -> Iterator[str]:
    """What is wrong with a plan: violations, lost tasks, untrue times and reasons.

    Args:
        problem: with a valid plan.
        result: its plan.
    """
    found = problem.evaluated(result)
    yield from found.violations
    served = [name for row in result.routes.values() for name in row]
    if sorted([*served, *result.unassigned]) != sorted(task.id for task in problem.tasks):
        yield f'tasks lost: {served}, {list(result.unassigned)}'
    for name, ours, theirs in (
            ('cost', result.cost, found.cost), ('finish', result.finish, found.finish),
            ('response', result.response, found.timetable.response),
            ('value', result.value, found.value), ('distance', result.distance, found.distance)):
        if abs(ours - theirs) > _FAULT * max(1.0, abs(theirs)):
            yield f'{name} is {theirs}, not {ours}'
    for task in problem.tasks:
        if task.id in result.unassigned:
            yield from _untrue(problem, task, result.unassigned[task.id])


def _untrue(problem: SmallProblem, task: Task, reason: str) -> Iterator[str]:
    """What is not true of a reason."""
    can = _can_serve(problem, task)
    if reason.startswith('left out') != can:
        yield f'{task.id}: {reason!r}, but a UAV {"can" if can else "cannot"} serve it alone'
    if 'worth' in reason and math.isinf(problem.rules.objective.unserved):
        yield f'{task.id}: {reason!r}, but every task that can be served is served'
    stated = re.match(r'latest (-?\d+) s; the earliest arrival is (\d+) s \((\w+)\)', reason)
    if stated:
        arrival = min((_start_alone(problem, uav, task) for uav in problem.uavs
                       if _may(problem, uav, task)), default=math.inf)
        if abs(arrival - float(stated[2])) > 0.51 or abs(task.latest - float(stated[1])) > 0.51:
            yield f'{task.id}: {reason!r}, but the earliest arrival is {arrival:.1f} s'


def _may(problem: SmallProblem, uav: Uav, task: Task) -> bool:
    """Whether a UAV may serve a task, and has its payload or can still take it on."""
    aboard = [each for each in problem.uavs if problem.held.has_aboard(each, task)]
    loaded = not task.payload or uav.at_base if not aboard else uav in aboard
    return loaded and task.required_capabilities <= uav.capabilities and (
        task.allowed_uavs is None or uav.id in task.allowed_uavs)


def _can_serve(problem: SmallProblem, task: Task) -> bool:
    """Whether some UAV could serve a task if it served no others but locked ones."""
    for uav, turned in product(problem.uavs, _directions(problem, task)):
        first = problem.locked.get(uav.id, ())
        for rows in ([(*first, task.id)], [first, (task.id,)]):
            found = evaluate_routes(problem.uavs, problem.tasks, problem.rules, {
                uav.id: rows, **{other: [row] for other, row in problem.locked.items()
                                 if other != uav.id}}, held=problem.held, reversed=turned)
            if not found.violations:
                return True
    return False


def _directions(problem: SmallProblem, task: Task) -> Iterator[frozenset[str]]:
    """What is flown from its last point where a task alone is added to the locked ones."""
    yield problem.reversed
    if task.reversible and task.path and not any(
            task.id in row for row in problem.locked.values()):
        yield problem.reversed | {task.id}


def _start_alone(problem: SmallProblem, uav: Uav, task: Task) -> float:
    """Start of the service of a task after locked ones only [s]."""
    rows = [(*problem.locked.get(uav.id, ()), task.id)]
    rules = replace(problem.rules, objective=replace(problem.rules.objective, response=1.0))
    return min(evaluate_routes(
        [replace(uav, endurance=math.inf)], problem.tasks, rules, {uav.id: rows},
        held=problem.held, reversed=turned).timetable.starts[task.id]
        for turned in _directions(problem, task))


@dataclass(frozen=True, slots=True)
class SmallResult:
    """How a plan compares."""

    faults: tuple[str, ...]
    gap: float  # of the cost over the exact optimum, 0.01 for a percent; nan: serves less value
    warm_faults: tuple[str, ...] = ()  # of a plan that starts from it


def compare_small(problem: SmallProblem, rounds: int) -> SmallResult | None:
    """Solve a problem and compare with the exact optimum and with insertion alone.

    Args:
        problem: to solve.
        rounds: of the search.

    Returns:
        None where no plan is valid.
    """
    best = exact_plan(problem.uavs, problem.tasks, problem.rules, held=problem.held,
                      reversed=problem.reversed)
    if best is None:
        return None
    inserted, result = problem.solve(0), problem.solve(rounds)
    wrong = [*plan_faults(problem, result), *(f'insertion: {text}' for text in plan_faults(
        problem, inserted))]
    mine = rank(result.value, result.cost, problem.rules)
    for name, other, better in (('its insertion', (inserted.value, inserted.cost), 1.0),
                                ('the optimum', (best.value, best.cost), -1.0)):
        theirs = rank(*other, problem.rules)
        if _exceeds(mine, theirs, better):
            wrong.append(f'{mine} is {"worse" if better > 0.0 else "better"} than {name} {theirs}')
    again = problem.solve(rounds // 4, warm=result)
    worse = [*plan_faults(problem, again)]
    if _exceeds(rank(again.value, again.cost, problem.rules), mine, 1.0):
        worse.append(f'{again.cost} is worse than the plan it starts from {result.cost}')
    gap = math.nan if mine[0] > rank(best.value, best.cost, problem.rules)[0] + _FAULT else (
        (result.cost - best.cost) / max(best.cost, 1e-9))
    return SmallResult(tuple(wrong), gap, tuple(worse))


def _exceeds(some: tuple[float, float], other: tuple[float, float], sign: float) -> bool:
    """Whether one rank is worse than another (sign 1) or better (sign -1), beyond rounding."""
    if abs(some[0] - other[0]) > _FAULT:
        return sign * (some[0] - other[0]) > 0.0
    return sign * (some[1] - other[1]) > _FAULT * max(1.0, abs(other[1]))


def named_objective(name: str, problem: SmallProblem) -> SmallProblem:
    """Return the same problem with a named objective.

    Args:
        name: of OBJECTIVES.
        problem: to change.

    Returns:
        The problem.
    """
    return replace(problem, rules=replace(problem.rules, objective=check_objective(name)))
