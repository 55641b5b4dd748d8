# SPDX-License-Identifier: Apache-2.0
"""Where UAVs in flight will be in the next 30 s, going on or holding, and who would come near."""
from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Point
from uav_task_alloc.separation.rule import Separation

HORIZON = 30.0  # [s]
_DT = 0.25  # [s] between two points of a prediction
_SHIFT = 2  # steps between two differences of time that are compared
_REACTION = 2.0  # [s] until a hold that is published is flown
_BRAKING = 2.5  # [m/s2]
_MARGIN = 1.0  # [m] horizontally, for positions between the points and errors of them
_SLACK = 0.3  # [m] vertically: plans keep the vertical distance exactly, autopilots nearly
NEARER = 1.0  # [m] by which two that are too near already come nearer
_SOONER = 0.5  # [s] by which a loss begins earlier
_CLOSER = 0.1  # share of the distances by which a loss is worse
# times the horizontal distance, and [s] more of time, that a UAV needs to go on
_CAUTION, _PATIENCE = 1.15, 2.0
_ON_BOARD = 10.0  # [s] for which a list that is to be replaced counts: a hold takes 7 s
_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Way:
    """What a UAV does next: it flies straight from point to point, and stays at the last."""

    points: tuple[tuple[float, Point], ...]  # [s] from now, in order, and [m] ENU
    speed: float = 0.0  # [m/s] now
    on_ground: bool = False  # it is about to take off: where it holds it is not in the air
    hold_radius: float = 0.0  # [m] of the circle in which it holds; 0: it hovers
    pad: Point | None = None  # [m] where it takes off and lands; None: unknown
    # its points by the list that is still on board, until the new one is; (): there is none
    on_board: tuple[tuple[float, Point], ...] = ()


@dataclass(frozen=True, slots=True)
class PredictedLoss:
    """A predicted loss of separation."""

    begins: float  # [s] from now; 0: it is lost
    horizontal: float  # [m] when they are nearest
    vertical: float  # [m] then
    share: float = 0.0  # of the distances that is kept: the greater of both shares, at the least


def rule_to_go_on(rule: Separation) -> Separation:
    """Return the rule by which the way of a UAV that holds is free.

    Args:
        rule: that is kept.

    Returns:
        The same with more distance and more time.
    """
    return replace(rule, horizontal=rule.horizontal * _CAUTION + _MARGIN,
                   time=rule.time + _PATIENCE)


class FlightPredictions:
    """The predictions of one moment.

    Args:
        ways: of all UAVs, by id.
        rule: that is kept.
        holding: ids of those that hold.

    Arguments of methods:
        uav_id, other: ids.
        holds: whether it holds.
    """

    def __init__(self, ways: Mapping[str, Way], rule: Separation,
                 holding: Collection[str] = ()) -> None:
        self._ways, self._rule = ways, rule
        self._times: _Floats = np.arange(0.0, HORIZON + _DT, _DT)
        self._go = {name: _paths(way, self._times) for name, way in ways.items()}
        self._stay = {name: _paths(way, _stopping(way, self._times, name in holding), holds=True)
                      for name, way in ways.items()}
        self._holding = set(holding)

    def set_holding(self, uav_id: str, holds: bool) -> None:
        """Let a UAV hold, or go on, in what is predicted from now on."""
        (self._holding.add if holds else self._holding.discard)(uav_id)

    def losses(self) -> dict[tuple[str, str], PredictedLoss]:
        """Return the losses of all pairs, with the present holds."""
        found = {}
        for a, b in self._near_pairs():
            loss = self.loss(a, b)
            if loss is not None:
                found[a, b] = loss
        return found

    def lost_now(self) -> dict[tuple[str, str], PredictedLoss]:
        """Return the pairs that are not apart now."""
        found = {}
        for a, b in self._near_pairs():
            one, two = (self._paths(name, name in self._holding)[0] for name in (a, b))
            apart = math.hypot(one[0, 0] - two[0, 0], one[0, 1] - two[0, 1])
            above = abs(float(one[0, 2] - two[0, 2]))
            if not self._rule.keeps(apart, above) and not (
                    self._on_pad(a, one)[0] and self._on_pad(b, two)[0]):
                found[a, b] = PredictedLoss(0.0, apart, above)
        return found

    def losses_of(self, uav_id: str, holds: bool, wide: bool = False) -> dict[str, PredictedLoss]:
        """Return the losses of one UAV that holds or goes on, by the id of the other one.

        Args:
            uav_id, holds: see the class.
            wide: with some more distance.
        """
        found = {}
        for other in self._ways:
            if other != uav_id:
                # as well without it: two that are nearer than the wide distance may fly on
                loss = self._between(uav_id, holds, other) or (
                    self._between(uav_id, holds, other, wide=True) if wide else None)
                if loss is not None:
                    found[other] = loss
        return found

    def loss(self, uav_id: str, other: str) -> PredictedLoss | None:
        """Return the loss of two UAVs, with the present holds; None: they stay apart."""
        return self._between(uav_id, uav_id in self._holding, other)

    def helps(self, uav_id: str, other: str) -> bool:
        """Return whether the hold of a UAV keeps it apart from another one, and from the rest.

        A loss with a third one that is predicted anyway, and no later, does not count.
        """
        then, now = self.losses_of(uav_id, True), self.losses_of(uav_id, False)
        return other not in then and all(
            name in now and now[name].begins <= loss.begins for name, loss in then.items())

    def delays(self, pair: tuple[str, str], stops: Collection[str]) -> bool:
        """Return whether two UAVs come no nearer, and no sooner, where some of them stop.

        Args:
            pair: ids.
            stops: those of the pair that hold.
        """
        a, b = pair
        stopped = self._between(a, a in stops or a in self._holding, b,
                                other_holds=b in stops or b in self._holding)
        current = self.loss(a, b)
        return stopped is None or (current is not None
                                   and stopped.horizontal > current.horizontal - NEARER
                                   and stopped.begins > current.begins - _SOONER
                                   and stopped.share > current.share - _CLOSER)

    def _paths(self, uav_id: str, holds: bool) -> list[_Floats]:
        return (self._stay if holds else self._go)[uav_id]

    def _between(self, uav_id: str, holds: bool, other: str, wide: bool = False,
                 other_holds: bool | None = None) -> PredictedLoss | None:
        """The loss of two UAVs, the first one of their paths; each may have two."""
        if other_holds is None:
            other_holds = other in self._holding
        horizontal = self._rule.horizontal * (_CAUTION if wide else 1.0) + _MARGIN
        horizontal += 2.0 * (holds * self._ways[uav_id].hold_radius
                             + other_holds * self._ways[other].hold_radius)
        shifts = round((self._rule.time + wide * _PATIENCE) / _DT)
        if holds and other_holds:
            shifts = 0
        losses = [_first_loss(own, theirs, horizontal, self._rule.vertical - _SLACK, shifts,
                              self._on_pad(uav_id, own), self._on_pad(other, theirs))
                  for own in self._paths(uav_id, holds)
                  for theirs in self._paths(other, other_holds)]
        return min((loss for loss in losses if loss is not None),
                   key=lambda loss: (loss.begins, loss.horizontal), default=None)

    def _on_pad(self, uav_id: str, path: _Floats) -> _Flags:
        """Where on a path it is low over its pad: pads may be nearer than the rule."""
        pad = self._ways[uav_id].pad
        if pad is None:
            return np.zeros(len(path), dtype=bool)
        off = np.hypot(path[:, 0] - pad[0], path[:, 1] - pad[1])
        return np.asarray((off < 0.5 * self._rule.horizontal)
                          & (path[:, 2] - pad[2] < self._rule.vertical))

    def _near_pairs(self) -> list[tuple[str, str]]:
        """Pairs whose boxes of the next 30 s overlap, by id."""
        names = sorted(self._ways)
        if len(names) < 2:
            return []
        reach = self._rule.horizontal + _MARGIN
        low, high = (np.array([
            bound(np.concatenate([*self._go[name], *self._stay[name]]), axis=0)
            for name in names]) for bound in (np.fmin.reduce, np.fmax.reduce))
        radius = np.array([2.0 * self._ways[name].hold_radius for name in names])[:, None]
        room = np.array([reach, reach, self._rule.vertical])
        low, high = low - 0.5 * room - radius, high + 0.5 * room + radius
        return [(names[i], names[j]) for i, j in combinations(range(len(names)), 2)
                if bool(np.all(low[i] <= high[j]) and np.all(low[j] <= high[i]))]


def _paths(way: Way, times: _Floats, holds: bool = False) -> list[_Floats]:
    """The points (n, 3) of a way at times [s], and those by the list on board; NaN: nowhere."""
    if holds and way.on_ground:
        return [np.full((len(times), 3), math.nan)]
    paths = [_sampled(way.points, times)]
    if way.on_board:
        paths.append(_sampled(way.on_board, times))
        paths[1][round(_ON_BOARD / _DT):] = math.nan
    return paths


def _sampled(way: Sequence[tuple[float, Point]], times: _Floats) -> _Floats:
    at = np.array([t for t, _ in way])
    points = np.array([point for _, point in way], dtype=float)
    return np.stack([np.interp(times, at, points[:, k]) for k in range(3)], axis=1)


def _stopping(way: Way, times: _Floats, holding: bool) -> _Floats:
    """Times of a way at which a UAV that is to hold is where it is at `times` [s]."""
    reaction = 0.0 if holding else _REACTION
    braking = way.speed / _BRAKING
    if braking < 0.2:
        return np.minimum(times, 0.0 if holding else reaction)
    passed = np.clip(times - reaction, 0.0, braking)
    return np.asarray(np.minimum(times, reaction) + passed - passed**2 / (2.0 * braking))


def _first_loss(a: _Floats, b: _Floats, horizontal: float, vertical: float, shifts: int,
                a_on_pad: _Flags, b_on_pad: _Flags) -> PredictedLoss | None:
    """The loss of two paths, each of which may be early or late; None: they stay apart.

    Where it is lost already, it counts only if they come nearer, also in height alone: both may
    fly apart.
    """
    first, nearest, best, share = math.inf, (0.0, 0.0), math.inf, math.inf
    now = math.hypot(a[0, 0] - b[0, 0], a[0, 1] - b[0, 1])
    height, beside, below, room = abs(a[0, 2] - b[0, 2]), 0.0, 0.0, horizontal
    if now < horizontal and height < vertical and not (a_on_pad[0] and b_on_pad[0]):
        beside, below = min(now + NEARER, horizontal), height - NEARER
        horizontal, shifts = max(0.0, now - NEARER), 0
    for shift in range(0, shifts + 1, _SHIFT):
        for first_of, then_of in _ranges(shift):
            one, two = a[first_of], b[then_of]
            apart = np.hypot(one[:, 0] - two[:, 0], one[:, 1] - two[:, 1])
            above = np.abs(one[:, 2] - two[:, 2])
            lost = (apart < horizontal) & (above < vertical)
            lost |= (apart < beside) & (above < below)
            lost &= ~(a_on_pad[first_of] & b_on_pad[then_of])
            if not lost.any():
                continue
            at = np.flatnonzero(lost)
            first = min(first, float(at[0]) * _DT)
            share = min(share, float(np.maximum(apart[at] / room,
                                                above[at] / vertical).min()))
            k = at[np.argmin(apart[at])]
            if apart[k] < best:
                best, nearest = float(apart[k]), (float(apart[k]), float(above[k]))
    return PredictedLoss(first, *nearest, share) if first < math.inf else None


def _ranges(shift: int) -> Sequence[tuple[slice, slice]]:
    """Parts of two paths, of which the one and then the other is later by a number of steps."""
    whole, early, late = slice(None), slice(None, -shift), slice(shift, None)
    return [(early, late), (late, early)] if shift else [(whole, whole)]
