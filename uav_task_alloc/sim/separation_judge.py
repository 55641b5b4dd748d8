# SPDX-License-Identifier: Apache-2.0
"""Judges by the true positions, at every step of a simulation, how near UAVs came in the air."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Point

Pair = tuple[str, str]  # ids in alphabetical order
_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrueState:
    """Where a vehicle is at one step."""

    position: Point  # [m] ENU
    home: Point  # [m] ENU: its pad
    in_the_air: bool  # not landed, and not lost


@dataclass(frozen=True, slots=True)
class Nearness:
    """How near two vehicles were at one time."""

    t: float  # [s] vehicle time
    horizontal: float  # [m]
    vertical: float  # [m]

    @property
    def distance(self) -> float:
        """Straight distance [m]."""
        return math.hypot(self.horizontal, self.vertical)


@dataclass(slots=True)
class Loss:
    """Two vehicles nearer than the rule allows, horizontally and vertically at once."""

    uavs: Pair
    nearest: Nearness
    since: float  # [s] vehicle time


class SeparationJudge:
    """The least distances of all pairs in the air, and each loss of separation.

    A pair counts while both are in the air: not landed, and not lost. Two vehicles less than
    `vertical` above their own pads, and within half of `horizontal` of them, do not count with
    each other: pads may be nearer than the rule. Between two steps vehicles are taken to fly
    straight.

    Args:
        horizontal: distance to be kept [m]; 0: no loss is judged.
        vertical: distance to be kept where the horizontal one is not [m].
    """

    def __init__(self, horizontal: float = 0.0, vertical: float = 0.0) -> None:
        self._rule = horizontal, vertical
        self._before: dict[str, TrueState] = {}
        self._then = 0.0
        self.least: dict[Pair, Nearness] = {}  # the nearest that each pair came
        self._lost: dict[Pair, Loss] = {}  # now

    def step(self, now: float, states: Mapping[str, TrueState]) -> tuple[list[Loss], list[Loss]]:
        """Judge the time since the last step.

        Args:
            now: vehicle time [s].
            states: of all vehicles, by UAV id.

        Returns:
            The losses that began, and those that ended.
        """
        flying = {name: state for name, state in states.items() if state.in_the_air}
        both = sorted(flying.keys() & self._before.keys())
        pairs = [pair for pair in combinations(both, 2) if not self._on_pads(pair, flying)]
        violated = self._judge(pairs, now, flying) if pairs else {}
        self._before, self._then = flying, now
        begun = []
        for pair, nearest in violated.items():
            loss = self._lost.get(pair)
            if loss is None:
                loss = self._lost[pair] = Loss(pair, nearest, nearest.t)
                begun.append(loss)
            elif nearest.distance < loss.nearest.distance:
                loss.nearest = nearest
        ended = [self._lost.pop(pair) for pair in list(self._lost) if pair not in violated]
        return begun, ended

    def _on_pads(self, pair: Pair, flying: Mapping[str, TrueState]) -> bool:
        horizontal, vertical = self._rule
        return all(math.dist(flying[name].position[:2], flying[name].home[:2]) < 0.5 * horizontal
                   and flying[name].position[2] - flying[name].home[2] < vertical
                   for name in pair)

    def _judge(self, pairs: Sequence[Pair], now: float,
               flying: Mapping[str, TrueState]) -> dict[Pair, Nearness]:
        """Note the least distances; the nearest in this step of the pairs with a loss."""
        index = {name: k for k, name in enumerate(flying)}
        rows = np.array([[index[a], index[b]] for a, b in pairs])
        after = np.array([state.position for state in flying.values()], dtype=float)
        before = np.array([self._before.get(name, state).position
                           for name, state in flying.items()], dtype=float)
        start = before[rows[:, 1]] - before[rows[:, 0]]
        change = after[rows[:, 1]] - after[rows[:, 0]] - start
        share = _nearest_share(start, change, np.zeros(len(pairs)), np.ones(len(pairs)))
        at = start + share[:, None] * change
        squares = np.einsum('ij,ij->i', at, at)
        lost = self._losses(start, change)
        found = {}
        for k, pair in enumerate(pairs):
            least = self.least.get(pair)
            if lost[k] or least is None or squares[k] < least.distance**2:
                nearness = Nearness(self._then + float(share[k]) * (now - self._then),
                                    math.hypot(at[k, 0], at[k, 1]), abs(float(at[k, 2])))
                if least is None or nearness.distance < least.distance:
                    self.least[pair] = nearness
                if lost[k]:
                    found[pair] = nearness
        return found

    def _losses(self, start: _Floats, change: _Floats) -> NDArray[np.bool_]:
        """Whether both distances are below the rule at any time of the step."""
        horizontal, vertical = self._rule
        rise = change[:, 2]
        safe = np.where(rise == 0.0, 1.0, rise)
        ends = np.sort(np.stack([(-vertical - start[:, 2]) / safe,
                                 (vertical - start[:, 2]) / safe]), axis=0)
        level = np.abs(start[:, 2]) < vertical
        low = np.where(rise == 0.0, np.where(level, 0.0, 2.0), np.maximum(ends[0], 0.0))
        high = np.where(rise == 0.0, 1.0, np.minimum(ends[1], 1.0))
        share = _nearest_share(start[:, :2], change[:, :2], low, np.maximum(low, high))
        at = start[:, :2] + share[:, None] * change[:, :2]
        near = np.einsum('ij,ij->i', at, at) < horizontal**2
        return np.asarray(near & (low < high))


def _nearest_share(start: _Floats, change: _Floats, low: _Floats, high: _Floats) -> _Floats:
    """Share of the step, within [low, high], at which |start + share * change| is least."""
    squares = np.einsum('ij,ij->i', change, change)
    along = -np.einsum('ij,ij->i', start, change)
    share = np.divide(along, squares, out=np.zeros_like(along), where=squares > 0.0)
    return np.asarray(np.clip(share, low, high))
