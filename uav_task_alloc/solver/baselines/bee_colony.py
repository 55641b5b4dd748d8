# SPDX-License-Identifier: Apache-2.0
"""The artificial bee colony (ABC) of Karaboga on random keys.

Karaboga, An Idea Based on Honey Bee Swarm for Numerical Optimization, TR06, Erciyes University,
2005. A food source has a key in [0, 1) for each task: the interval that it lies in selects the
UAV, and UAVs serve their tasks by ascending keys. Employed and onlooker bees move one key of a
source towards or away from that of another source and keep the better one; a source that did not
improve for `limit` trials is replaced by a random one, one a generation. Eq 2.8 is applied to
1/fit, which is larger for better plans. An iteration is a generation.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uav_task_alloc.solver.baselines.population import Coding, evolve
from uav_task_alloc.solver.recorder import Recorder
from uav_task_alloc.solver.routes import Floats, Ints, Routes


@dataclass(frozen=True, slots=True)
class AbcSettings:
    """Karaboga's control parameters."""

    sources: int = 50  # food sources; as many employed bees and as many onlookers
    limit: int | None = None  # trials; None: sources times tasks, as Karaboga has it


def source_probabilities(fits: Floats) -> Floats:
    """Probability that an onlooker chooses each source: its share of all 1/fit (eq 2.8)."""
    worth = 1.0 / np.maximum(fits, 1e-300)
    total = worth.sum()
    shares: Floats = worth / total if total > 0.0 else np.full(len(fits), 1.0 / len(fits))
    return shares


class AbcColony:
    """Food sources (sources, n) and the bees that change them."""

    def __init__(self, coding: Coding, settings: AbcSettings, rng: np.random.Generator) -> None:
        self._coding, self._rng = coding, rng
        n = len(coding.tasks)
        self._limit = settings.limit if settings.limit is not None else settings.sources * n
        self.sources = rng.random((settings.sources, n))
        self.fits = self._judge(self.sources)
        self._trials = np.zeros(settings.sources, np.int64)

    def decoded(self, sources: Floats) -> tuple[Ints, Ints]:
        """Tasks by UAV in order, and UAVs by task."""
        tasks = np.broadcast_to(np.arange(sources.shape[1]), sources.shape)
        uav_of = self._coding.uav(tasks, sources)
        return self._coding.rows(np.argsort(sources, axis=1, kind='stable'), uav_of), uav_of

    def routes(self, plan: int) -> Routes:
        """The plan of one food source."""
        row, uav_of = self.decoded(self.sources[plan:plan + 1])
        return self._coding.routes(row[0], uav_of[0])

    def _judge(self, sources: Floats) -> Floats:
        return self._coding.fits(*self.decoded(sources))

    def advance(self) -> None:
        """A generation: employed bees, onlookers, a scout."""
        count = len(self.sources)
        self._visit(np.arange(count))
        self._visit(self._rng.choice(count, count, p=source_probabilities(self.fits)))  # eq 2.8
        worst = int(np.argmax(self._trials))
        if self._trials[worst] > self._limit:
            self.sources[worst] = self._rng.random(self.sources.shape[1])
            self.fits[worst] = self._judge(self.sources[worst:worst + 1])[0]
            self._trials[worst] = 0

    def _visit(self, chosen: Ints) -> None:
        """Each bee tries v = x + phi (x - x_k) for one key of its source and keeps the better."""
        count, n = self.sources.shape
        bees, key = np.arange(len(chosen)), self._rng.integers(n, size=len(chosen))
        other = (chosen + self._rng.integers(1, max(2, count), size=len(chosen))) % count
        phi = self._rng.uniform(-1.0, 1.0, len(chosen))
        tried = self.sources[chosen].copy()
        x = tried[bees, key]
        tried[bees, key] = np.clip(x + phi * (x - self.sources[other, key]), 0.0, 1.0)
        fits = self._judge(tried)
        for bee, source in enumerate(chosen):
            if fits[bee] < self.fits[source]:
                self.sources[source], self.fits[source] = tried[bee], fits[bee]
                self._trials[source] = 0
            else:
                self._trials[source] += 1


def solve(recorder: Recorder, seed: int, learnt: object = None,
          settings: AbcSettings | None = None) -> None:
    """Run generations until the budget ends.

    Args:
        recorder: with the problem; takes the plans.
        seed: of the random numbers.
        learnt: not used.
        settings: None: the defaults.

    Raises:
        InvalidValue: there are too many tasks for a table of leg lengths.
    """
    evolve(recorder, lambda coding: AbcColony(
        coding, settings or AbcSettings(), np.random.default_rng(seed)))
