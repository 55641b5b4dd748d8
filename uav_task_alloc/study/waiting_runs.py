# SPDX-License-Identifier: Apache-2.0
"""Runs of a fleet on random tasks under policies of waiting; all policies on the same tasks."""
from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation import event_simulation as events
from uav_task_alloc.anticipation.cover import COVER_PRICES, CoverPrices, make_cover
from uav_task_alloc.anticipation.demand import Demand, DemandModel
from uav_task_alloc.anticipation.event_simulation import FleetTimes
from uav_task_alloc.anticipation.places import MovePrices, Waiting, move_prices
from uav_task_alloc.anticipation.response_lists import Lists, Tasks
from uav_task_alloc.anticipation.waiting_q import LearnerSettings, make_learner
from uav_task_alloc.solver.rng import rng_state
from uav_task_alloc.study import arrivals
from uav_task_alloc.study.arrivals import AREA, DURATION, TaskStream, make_stream

_Floats = NDArray[np.float64]
SPEED = 15.0  # [m/s]
REVIEW = 120.0  # [s] between choices of waiting places without an event
POLICIES = {'stay': events.STAY, 'base': events.BASE, 'even': events.EVEN,
            'assign': events.ASSIGN, 'learnt': events.LEARNT, 'oracle': events.ORACLE,
            'chained_q': events.CHAINED_Q}
LATE = 2700.0  # [s] tasks announced later are in `late`
_CALIBRATION_SEED, _CALIBRATION_RUNS, _BISECTIONS = 2**40, 10, 12


class Setting(NamedTuple):
    """A fleet and its load."""

    uavs: int
    busy: int  # [%] of the time in which a UAV has a task, if it stays where its last one ended
    kind: str  # of arrivals.ARRIVAL_KINDS


def run_pair(setting: Setting, rate: float, seed: int,
             policies: Sequence[str] = tuple(POLICIES)) -> dict[str, dict[str, float]]:
    """Fly the tasks of one seed under each policy.

    Args:
        setting: UAVs and arrivals.
        rate: [1/s] of arrivals.
        seed: of the tasks, of where the UAVs are at the begin and of the chained Q.
        policies: names of POLICIES.

    Returns:
        By policy the mean response time [s], that of tasks announced after LATE, what was flown
        [m] and the busy share of the time.
    """
    stream = make_stream(setting.kind, rate, seed)
    return {name: summary(stream, *fly(stream, setting.uavs, POLICIES[name], seed))
            for name in policies}


def summary(stream: TaskStream, response: _Floats, fleet: FleetTimes) -> dict[str, float]:
    """Means of a run.

    Args:
        stream: its tasks.
        response: (n) [s] from the announcement to the start of the service.
        fleet: after the run.

    Returns:
        As in `run_pair`; 0.0 for the response time of no task.
    """
    late = response[stream.announced > LATE]
    return {'response': float(response.mean()) if len(response) else 0.0,
            'late': float(late.mean()) if len(late) else 0.0,
            'flown': float(fleet.flown.sum()),
            'busy': float(fleet.busy.sum()) / (len(fleet.busy) * DURATION)}


def fly(stream: TaskStream, uavs: int, policy: int, seed: int, prices: MovePrices | None = None,
        cover: CoverPrices = COVER_PRICES, model: DemandModel | None = None,
        learner: LearnerSettings | None = None,
        ) -> tuple[_Floats, FleetTimes]:
    """Fly the tasks of a run under one policy.

    Args:
        stream: the tasks.
        uavs: of the fleet.
        policy: a value of POLICIES.
        seed: of where the UAVs are at the begin and of the chained Q.
        prices: of moves to waiting places; by default those of the fleet.
        cover: prices of cover, of policies that know of demand.
        model: what is learnt; by default as shipped.
        learner: settings of the chained Q; by default those of the study.

    Returns:
        (n) [s] from each announcement to the start of the service, and the fleet after the run.
    """
    start = np.random.default_rng([seed, uavs]).uniform(0.0, AREA, (uavs, 2))
    demand = Demand(np.zeros(2), np.full(2, AREA), model=model)
    n, x, y = len(stream.announced), demand.cells.x, demand.cells.y
    tasks = Tasks(stream.place[:, 0].copy(), stream.place[:, 1].copy(), stream.announced,
                  stream.service, np.full(n, np.nan), np.ones(n))
    pairs = demand.cells.across // 2  # places of the cover are the middles of 2 x 2 cells
    middles = [each.reshape(pairs, 2, pairs, 2).mean((1, 3)).ravel().copy() for each in (x, y)]
    known = cover if policy >= events.EVEN else cover._replace(tasks=0.0, least=0.0)
    lists = Lists(np.full((uavs, n + 1), -1), np.zeros(uavs, np.int64), start[:, 0].copy(),
                  start[:, 1].copy(), np.zeros(uavs), np.full(uavs, SPEED),
                  np.ones((uavs, n), np.bool_),
                  make_cover(known, middles[0], middles[1], start))
    fleet = FleetTimes(np.full(uavs, np.nan), np.zeros(uavs), np.zeros(uavs), np.zeros(uavs),
                       np.zeros(1))
    field = events.Field(
        demand.cells, np.hypot(x[:, None] - x, y[:, None] - y), demand.estimates,
        arrivals.true_density(stream.spots, x, y), 60.0, np.zeros(len(x)), np.zeros((4, len(x))))
    waiting = Waiting(np.zeros(uavs), np.zeros(uavs), np.zeros(uavs), np.zeros(uavs),
                      np.full(uavs, SPEED), np.full(uavs, np.inf), start,
                      np.zeros(uavs, np.int64), np.zeros(uavs))
    rule = events.WaitingPolicy(policy, np.full(2, AREA / 2.0), REVIEW, demand.model.prior,
                                demand.model.share, prices or move_prices(uavs))
    tables = make_learner(uavs, AREA, learner or LearnerSettings())
    events.simulate(tasks, lists, fleet, rule, field, waiting, tables, DURATION, rng_state(seed))
    return tasks.started - tasks.announced, fleet


@cache
def arrival_rate(setting: Setting) -> float:
    """The rate [1/s] of arrivals at which a fleet that stays is as busy as wanted.

    Args:
        setting: UAVs, load and arrivals.

    Returns:
        By bisection over runs of seeds that are used for nothing else.
    """
    low, high = 1e-4 * setting.uavs, 0.02 * setting.uavs
    for _ in range(_BISECTIONS):
        middle = (low * high) ** 0.5
        low, high = ((middle, high) if _busy(setting, middle) < setting.busy / 100.0
                     else (low, middle))
    return float((low * high) ** 0.5)


def _busy(setting: Setting, rate: float) -> float:
    runs = []
    for seed in range(_CALIBRATION_SEED, _CALIBRATION_SEED + _CALIBRATION_RUNS):
        stream = make_stream(setting.kind, rate, seed)
        runs.append(summary(stream, *fly(stream, setting.uavs, events.STAY, seed))['busy'])
    return float(np.mean(runs))
