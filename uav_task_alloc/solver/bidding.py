# SPDX-License-Identifier: Apache-2.0
"""Who flies next: kinds of bees bid for flights by the rank of what they brought lately."""
from __future__ import annotations

from collections.abc import Mapping

RANKS = (0.6, 0.3, 0.1)  # share of the best, second, third kind
_MEMORY = 0.8  # how much of what a kind brought still counts a round later


class Bidding:
    """Shares of the work among kinds; each keeps at least its floor."""

    def __init__(self, floors: Mapping[str, float]) -> None:
        self._floors = dict(floors)
        self._brought = dict.fromkeys(floors, 0.0)  # gain per work, fading
        self._work = dict.fromkeys(floors, 0.0)

    def shares(self) -> dict[str, float]:
        """What each kind may do of all work: its floor, and by rank if it brought anything."""
        ranked = sorted(self._brought, key=lambda kind: -self._brought[kind])
        free = (1.0 - sum(self._floors.values())) / sum(RANKS)
        return {kind: self._floors[kind] + (free * weight if self._brought[kind] > 0.0 else 0.0)
                for kind, weight in zip(ranked, RANKS, strict=False)}

    def next(self, costs: Mapping[str, float]) -> str:
        """The kind that is furthest behind its share, were it to fly for this cost."""
        shares = self.shares()
        return min(costs, key=lambda kind: (self._work[kind] + costs[kind]) / shares[kind])

    def pay(self, kind: str, work: float, gain: float) -> None:
        """Write down what a flight cost and what it brought."""
        self._work[kind] += work
        before = self._brought[kind]
        self._brought[kind] = _MEMORY * before + (1.0 - _MEMORY) * gain / work
