# SPDX-License-Identifier: Apache-2.0
"""The objective: distance, value, penalty and the fit of eq 2.12."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from uav_task_alloc.checks import check_number
from uav_task_alloc.model import Uav


@dataclass(frozen=True, slots=True)
class Weights:
    """The coefficients of eq 2.12; the defaults are those of the paper.

    Raises:
        InvalidValue: a coefficient is not in [0, 1e9].
    """

    distance: float = 0.01  # [1/m] w1, times D
    value: float = 100.0  # w2, divided by R
    penalty: float = 1.0  # [1/m] w3, times P

    def __post_init__(self) -> None:
        for name in ('distance', 'value', 'penalty'):
            number = check_number(f'{name} weight', getattr(self, name), 0.0, 1e9)
            object.__setattr__(self, name, number)


def fit(distance: float, value: float, penalty: float, weights: Weights | None = None) -> float:
    """Eq 2.12; smaller is better.

    Args:
        distance: [m] of all routes, D of eq 2.1.
        value: of all served tasks, R.
        penalty: [m] beyond the ranges, P of eq 2.2.
        weights: None: those of the paper.

    Returns:
        w1 D + w2 / R + w3 P; infinite where nothing is served (R = 0).
    """
    w = weights or Weights()
    if value <= 0.0:
        return math.inf
    return w.distance * distance + w.value / value + w.penalty * penalty  # eq 2.12


def excess(uavs: Iterable[Uav], lengths: Iterable[float]) -> float:
    """Return by how much routes exceed the ranges of their UAVs: P of eq 2.2.

    Args:
        uavs: with their ranges [m].
        lengths: [m] of their routes, in the same order.

    Returns:
        [m], the sum over all UAVs.
    """
    return math.fsum(max(0.0, length - uav.range)
                     for uav, length in zip(uavs, lengths, strict=True))
