# SPDX-License-Identifier: Apache-2.0
"""The demand: where tasks come from and what they are worth there, learnt from announcements."""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.anticipation import intensity
from uav_task_alloc.anticipation.intensity import Cells, Estimates
from uav_task_alloc.anticipation.spots import make_spots
from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue

_Floats = NDArray[np.float64]
MOST_OBSERVATIONS = 2000  # kept; the oldest are dropped
_LATEST = 300  # observations to which mixtures of spots are fitted
_VALUE_RADIUS = 1600.0  # [m] over which values of tasks are averaged
_VALUE_PRIOR = 2.0  # tasks of the mean value that each place begins with


@dataclass(frozen=True, slots=True)
class DemandModel:
    """What the estimates of a demand are; each bandwidth is combined with each forgetting time."""

    bandwidths: tuple[float, ...] = (400.0, 800.0, 1600.0, 3200.0)  # [m]
    forgetting: tuple[float, ...] = (450.0, 1200.0, 3600.0, math.inf)  # [s]
    day_parts: int = 8  # of estimates by the time of day, one for each bandwidth; 0: none
    spots: int = 4  # of a mixture at most
    spot_size: float = 1000.0  # [m] standard deviation of a spot at its begin
    spot_forgetting: tuple[float, ...] = (1200.0, math.inf)  # [s] of each mixture of spots
    prior: float = 1.0  # tasks that the uniform prior is worth
    even: float = 0.5  # share of the estimate that tasks are uniform, at the begin
    spot_share: float = 0.3  # of mixtures of spots together, at the begin
    share: float = 0.002  # of its weight that an estimate hands out to all at each task


class Observation(NamedTuple):
    """An announced task."""

    at: float  # [s] since 1970, UTC, of the announcement
    x: float  # [m] east
    y: float  # [m] north
    value: float  # of the task


class Demand:
    """Where the next task will be; begins as uniform over the area of work.

    Args:
        low, high: (2,) [m] corners of the area of work, east and north.
        across: cells of the grid in each direction.
        model: the estimates.
        outside: cells where no task can be, by the index of `cells`.

    Raises:
        InvalidValue: the area is empty.

    Arguments of methods:
        seen: an announced task; earlier than the last one counts as at the same time.
        now: [s] since 1970, UTC.
    """

    def __init__(self, low: _Floats, high: _Floats, across: int = 16,
                 model: DemandModel | None = None, outside: Iterable[int] = ()) -> None:
        for axis in range(2):
            if not high[axis] > low[axis]:
                raise InvalidValue(f'high[{axis}]', float(high[axis]),
                                   f'a number > {float(low[axis])}')
        self.model = model or DemandModel()
        self.cells = _grid(np.asarray(low, float), np.asarray(high, float), across)
        self.cells.inside[list(outside)] = 0.0
        self.forget()

    def forget(self) -> None:
        """Begin again with the uniform prior."""
        self.seen: deque[Observation] = deque(maxlen=MOST_OBSERVATIONS)
        self.estimates = _estimates(self.model, len(self.cells.x))
        self._values, self._counts = np.zeros((2, len(self.cells.x)))
        self._scratch = np.zeros(len(self.cells.x))

    def add(self, seen: Observation) -> None:
        """Learn from an announced task.

        Raises:
            InvalidValue: a number is not finite, or the value is negative.
        """
        for name, low in (('at', -math.inf), ('x', -math.inf), ('y', -math.inf), ('value', 0.0)):
            check_number(name, getattr(seen, name), low)
        self.seen.append(seen)
        intensity.observe(self.cells, self.estimates, self.model.prior, self.model.share,
                          seen.x, seen.y, seen.at, self._scratch)
        away = (self.cells.x - seen.x) ** 2 + (self.cells.y - seen.y) ** 2
        near = np.exp(-0.5 * away / _VALUE_RADIUS ** 2)
        self._values += seen.value * near
        self._counts += near

    def density(self, now: float) -> _Floats:
        """The probability that the next task is in each cell; (c,), its sum is 1."""
        out = np.empty(len(self.cells.x))
        intensity.density(self.cells, self.estimates, self.model.prior, now, out)
        return out

    @property
    def mean_value(self) -> float:
        """The mean value of the tasks so far; 1.0 where none was seen."""
        return float(np.mean([each.value for each in self.seen])) if self.seen else 1.0

    def weight(self, now: float) -> _Floats:
        """The density times the mean value of tasks near each cell; (c,), its sum is 1."""
        worth = (_VALUE_PRIOR * self.mean_value + self._values) / (_VALUE_PRIOR + self._counts)
        weight = self.density(now) * worth
        total = float(weight.sum())
        return weight / total if total > 0.0 else self.density(now)

    def to_record(self) -> list[list[float]]:
        """What was seen, as JSON; `add_record` learns the same from it, on any area and grid."""
        return [list(each) for each in self.seen]

    def add_record(self, record: Any) -> None:
        """Learn from what `to_record` returned, in its order.

        Raises:
            InvalidValue: it is not a list of four numbers each.
        """
        if not isinstance(record, list):
            raise InvalidValue('demand', record, 'a list of [at, x, y, value]')
        for i, each in enumerate(record):
            if not (isinstance(each, list) and len(each) == len(Observation._fields)
                    and all(isinstance(number, (int, float)) for number in each)):
                raise InvalidValue(f'demand[{i}]', each, '[at, x, y, value], four numbers')
            self.add(Observation(*each))


def _grid(low: _Floats, high: _Floats, across: int) -> Cells:
    side = (high - low) / across
    x, y = np.meshgrid(*(low[axis] + side[axis] * (np.arange(across) + 0.5) for axis in range(2)))
    return Cells(x.ravel().copy(), y.ravel().copy(), side, across, np.ones(across * across))


def _estimates(model: DemandModel, cells: int) -> Estimates:
    """All estimates, without a task."""
    kinds = [(width, time, 1) for time in model.forgetting for width in model.bandwidths]
    if model.day_parts:
        kinds += [(width, math.inf, model.day_parts) for width in model.bandwidths]
    mixtures = len(model.spot_forgetting)
    mixture = [-1] * len(kinds) + [*range(mixtures)] + [-1]
    kinds += [(model.spot_size, time, 1) for time in model.spot_forgetting]
    kernels, spots = len(kinds) - mixtures, model.spot_share if mixtures else 0.0
    begin = ([(1.0 - model.even - spots) / kernels] * kernels
             + [spots / max(1, mixtures)] * mixtures + [model.even])
    kinds.append((math.inf, math.inf, 1))  # a kernel without an end is uniform
    width, time, parts = (np.array(each) for each in zip(*kinds, strict=True))
    rows = int(parts.sum())
    return Estimates(width.astype(float), time.astype(float), np.cumsum(parts) - parts, parts,
                     np.zeros(rows), np.zeros((rows, cells)), np.log(begin), np.array(begin),
                     np.full(1, -np.inf), np.array(mixture),
                     make_spots(model.spot_forgetting, model.spots, model.spot_size, _LATEST))
