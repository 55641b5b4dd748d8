# SPDX-License-Identifier: Apache-2.0
"""Rank bidding: which kind of bee flies next, by the rank of its recent gain per work."""
from __future__ import annotations

from collections.abc import Mapping

RANKS = (0.6, 0.3, 0.1)  # weight of the best, second, third kind
_MEMORY = 0.8  # weight of the earlier gains of a kind after its next flight


class Bidding:
    """Shares of the work among kinds of bees; each has at least its floor."""

    def __init__(self, floors: Mapping[str, float]) -> None:
        self._floors = dict(floors)
        self._gain = dict.fromkeys(floors, 0.0)  # [m] gain per work, moving average
        self._work = dict.fromkeys(floors, 0.0)

    def shares(self) -> dict[str, float]:
        """Share of the work of each kind: its floor, plus one by rank if it gained anything."""
        ranked = sorted(self._gain, key=lambda kind: -self._gain[kind])
        free = (1.0 - sum(self._floors.values())) / sum(RANKS)
        return {kind: self._floors[kind] + (free * weight if self._gain[kind] > 0.0 else 0.0)
                for kind, weight in zip(ranked, RANKS, strict=False)}

    def next(self, costs: Mapping[str, float]) -> str:
        """The kind whose work, after a flight of this cost, is the smallest part of its share."""
        shares = self.shares()
        return min(costs, key=lambda kind: (self._work[kind] + costs[kind]) / shares[kind])

    def pay(self, kind: str, work: float, gain: float) -> None:
        """Record the work of a flight and its gain [m]."""
        self._work[kind] += work
        before = self._gain[kind]
        self._gain[kind] = _MEMORY * before + (1.0 - _MEMORY) * gain / work
