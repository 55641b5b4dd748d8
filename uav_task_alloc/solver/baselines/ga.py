# SPDX-License-Identifier: Apache-2.0
"""A genetic algorithm: linear order crossover, inversion, relocation, tournament selection.

A chromosome is a permutation of all tasks, UAV by UAV, with the UAV of each. A child keeps a slice
of one parent, with its UAVs, in place; the other tasks follow in the order, and with the UAVs, of
the other parent (linear order crossover: Falkenauer and Bouffouix, A Genetic Algorithm for Job
Shop, ICRA 1991). An iteration is a generation.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uav_task_alloc.solver.baselines.population import Coding, evolve
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Ints, Routes


@dataclass(frozen=True, slots=True)
class GaSettings:
    """Parameters of the genetic algorithm."""

    size: int = 100  # plans in a generation
    elite: int = 2  # best plans that are copied unchanged
    tournament: int = 2  # plans of which the best becomes a parent
    crossover: float = 0.6  # share of children with two parents
    inversion: float = 0.3  # share of children with a reversed slice
    relocation: float = 0.9  # share of children with a task moved


def crossover(first: Ints, second: Ints, begin: Ints, end: Ints) -> Ints:
    """Children (p, k): first[begin:end] stays in place, the rest in the order of `second`."""
    place = np.arange(first.shape[1])
    kept = (place >= begin[:, None]) & (place < end[:, None])
    is_kept = np.zeros(first.shape, np.bool_)
    np.put_along_axis(is_kept, first, kept, 1)
    child = first.copy()
    child[~kept] = second[~np.take_along_axis(is_kept, second, 1)]  # equal counts in each row
    return child


class Population:
    """Plans of a generation: `row` (p, k) tasks by UAV in order, `uav_of` (p, k) UAVs by task."""

    def __init__(self, coding: Coding, settings: GaSettings, rng: np.random.Generator) -> None:
        self._coding, self._settings, self._rng = coding, settings, rng
        k = len(coding.tasks)
        tasks = np.tile(np.arange(k), (settings.size, 1))
        self.uav_of = coding.uav(tasks, rng.random(tasks.shape))
        self.row = coding.rows(rng.permuted(tasks, axis=1), self.uav_of)
        self.fits = coding.fits(self.row, self.uav_of)

    def routes(self, plan: int) -> Routes:
        """One of the plans."""
        return self._coding.routes(self.row[plan], self.uav_of[plan])

    def advance(self) -> None:
        """Replace the plans by the next generation."""
        s, k = self._settings, self.row.shape[1]
        births = s.size - s.elite
        first, second = self._parents(births), self._parents(births)
        cuts = np.sort(self._rng.integers(0, k + 1, (births, 2)), axis=1)
        cuts[self._rng.random(births) >= s.crossover] = 0, k
        row = crossover(self.row[first], self.row[second], cuts[:, 0], cuts[:, 1])
        uav_of = self.uav_of[second]
        place = np.arange(k)
        kept = (place >= cuts[:, :1]) & (place < cuts[:, 1:])
        child, at = np.nonzero(kept)
        uav_of[child, row[child, at]] = self.uav_of[first[child], row[child, at]]
        self._mutate(row, uav_of)
        row = self._coding.rows(row, uav_of)
        elite = np.argsort(self.fits, kind='stable')[:s.elite]
        self.fits = np.concatenate([self.fits[elite], self._coding.fits(row, uav_of)])
        self.row = np.concatenate([self.row[elite], row])
        self.uav_of = np.concatenate([self.uav_of[elite], uav_of])

    def _parents(self, births: int) -> Ints:
        entrants = self._rng.integers(0, len(self.fits), (births, self._settings.tournament))
        best = np.argmin(self.fits[entrants], axis=1)
        parents: Ints = entrants[np.arange(births), best]
        return parents

    def _mutate(self, row: Ints, uav_of: Ints) -> None:
        s, k = self._settings, row.shape[1]
        for child in np.flatnonzero(self._rng.random(len(row)) < s.inversion):
            i, j = np.sort(self._rng.integers(0, k + 1, 2))
            row[child, i:j] = row[child, i:j][::-1].copy()
        for child in np.flatnonzero(self._rng.random(len(row)) < s.relocation):
            i, j = self._rng.integers(0, k, 2)
            self._relocate(row[child], uav_of[child], int(i), int(j))

    def _relocate(self, row: Ints, uav_of: Ints, i: int, j: int) -> None:
        """Move the task at i to place j, onto the UAV of the task there if that may serve it."""
        task, there = row[i], uav_of[row[j]]
        if i != j and self._coding.able[there, task]:
            if i < j:
                row[i:j] = row[i + 1:j + 1].copy()
            else:
                row[j + 1:i + 1] = row[j:i].copy()
            row[j], uav_of[task] = task, there


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: GaSettings | None = None) -> None:
    """Run generations until the budget ends.

    Args:
        recorder: with the problem; takes the plans.
        seed: of the random numbers.
        learnt: not used.
        settings: None: the defaults.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    evolve(recorder, lambda coding: Population(
        coding, settings or GaSettings(), np.random.default_rng(seed)))
