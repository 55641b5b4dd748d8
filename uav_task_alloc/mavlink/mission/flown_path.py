# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle has been, by its own positions and clock: was it at a point, how long?"""
from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from uav_task_alloc.geometry.polyline import point_at, polyline_length, segment_distance
from uav_task_alloc.model import Point

_KEPT = 900  # samples: three minutes at 5 Hz
GAP = 2.5  # [s] between two samples, beyond which the path between them is unknown
_DEFAULT_RADIUS = 2.0  # [m] acceptance radius where the task has none
CLOSE = 0.5  # [m] tolerance beyond the acceptance radius
_HOLD_SPEED = 0.4  # [m/s] below it a vehicle holds its position
_CURVE = 0.4  # [m/s2] error bound of the interpolation between two samples
_PIECES = 8  # interpolated points between two samples
_SHARES = tuple(k / _PIECES for k in range(_PIECES + 1))
# of a cubic Hermite interpolation: share, and weights of both positions and of both velocities
_HERMITE = tuple((s, 2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3,
                  s**3 - s**2) for s in _SHARES)
_JUMP = 30.0  # [m] beyond the distance its speed explains: the estimate jumped
_FEW, _USUAL_SPEED = 100, 15.0  # samples; [m/s] assumed where there are fewer
_ACCELERATION = 6.0  # [m/s2] that no vehicle exceeds for seconds (PX4: MPC_ACC_HOR_MAX 5)
_CORRIDOR = 8.0  # [m] from a leg at which a vehicle flies it
_INSIDE = 2.5  # [m] from a leg on the inner side of the turn before it, where it cuts the corner
_STRAIGHT = 2.5  # [m] from a leg, and from its start by the course, where it came from there
_LEG_END = 10.0  # [m] from the ends of a leg where a vehicle may be at any speed
_TURN = 5.0  # [m] of the next leg within which a vehicle that has come to its start turns
_LEAST_ACCELERATION = 1.0  # [m/s2] with which a vehicle sets out on a leg, and ends it
_LEAST_SHARE = 0.1  # of its highest speed of late, with which it flies the rest of a leg
_HOLD_SLACK = 0.1  # [s] by which a sampled hold may be shorter than the real one
_AHEAD = 1.0  # [s] after the newest sample, in which a vehicle keeps its velocity


class Visit(Enum):
    """Whether a vehicle was at a point."""

    YES = 'yes'
    NO = 'no'
    UNOBSERVED = 'unobserved'  # no for the samples, which have a gap


class PositionSample(NamedTuple):
    """One GLOBAL_POSITION_INT."""

    t: float  # [s] vehicle time
    position: Point  # [m] ENU
    velocity: Point  # [m/s] ENU


class FlownPath:
    """The last samples of one vehicle in the order of its clock, also where they arrive late."""

    def __init__(self) -> None:
        self._samples: list[PositionSample] = []
        self._speeds: list[float] = []  # [m/s] of each sample
        self.late = 0  # how many samples came after a newer one

    @property
    def newest(self) -> float:
        """Vehicle time [s] of the newest sample; -inf where there is none."""
        return self._samples[-1].t if self._samples else -math.inf

    @property
    def sample(self) -> PositionSample | None:
        """The newest sample; None where there is none."""
        return self._samples[-1] if self._samples else None

    @property
    def samples(self) -> tuple[PositionSample, ...]:
        """All samples, in order."""
        return tuple(self._samples)

    def last(self, since: float) -> tuple[PositionSample, ...]:
        """The newest sample, after those before and after the latest gap.

        Args:
            since: vehicle time [s]; earlier gaps do not count.
        """
        for n in range(len(self._samples) - 1, 0, -1):
            if self._samples[n].t < since:
                break
            if self._samples[n].t - self._samples[n - 1].t > GAP:
                return tuple(dict.fromkeys((*self._samples[n - 1:n + 1], self._samples[-1])))
        return tuple(self._samples[-1:])

    def add(self, sample: PositionSample) -> None:
        """Add a sample; O(1) where they arrive in order."""
        if not self._samples or sample.t > self._samples[-1].t:
            self._samples.append(sample)
            self._speeds.append(math.hypot(*sample.velocity))
        else:
            self.late += 1
            at = bisect_left(self._samples, sample.t, key=lambda one: one.t)
            if self._samples[at].t != sample.t:
                self._samples.insert(at, sample)
                self._speeds.insert(at, math.hypot(*sample.velocity))
        if len(self._samples) > _KEPT + 100:
            del self._samples[:100], self._speeds[:100]

    def jumps(self, sample: PositionSample) -> bool:
        """Whether a new sample is too far from the newest one to have been flown."""
        if not self._samples or not 0.0 < sample.t - self.newest <= GAP:
            return False
        last = self._samples[-1]
        fastest = max(math.hypot(*last.velocity), math.hypot(*sample.velocity))
        distance = math.dist(last.position, sample.position)
        return distance > _JUMP + 2.0 * fastest * (sample.t - last.t)

    def clear(self) -> None:
        """Drop all samples: the vehicle's clock has restarted."""
        self._samples.clear()
        self._speeds.clear()

    def visited(self, point: Point, radius: float, hold: float, since: float,
              until: float = math.inf, close: float = CLOSE) -> Visit:
        """Whether the vehicle was at a point, and held there; O(n) for n samples.

        Args:
            point: ENU [m].
            radius: acceptance radius [m]; 0: the autopilot's default.
            hold: required time at the point [s].
            since: vehicle time [s].
            until: vehicle time [s].
            close: tolerance [m] added to the radius where no hold is required; 0: the hold
                must not be shorter either.
        """
        if self.was_at(point, radius, hold, since, until, close):
            return Visit.YES
        return Visit.UNOBSERVED if self.has_gap(since, until) else Visit.NO

    def was_at(self, point: Point, radius: float, hold: float, since: float,
               until: float = math.inf, close: float = CLOSE) -> bool:
        """Whether `visited` returns YES."""
        first, last = self._stay(point, radius, since, hold > 0.0, until, close)
        return last - first >= max(0.0, hold - (_HOLD_SLACK if close else 0.0))

    def has_gap(self, since: float, until: float) -> bool:
        """Whether the path is unknown somewhere between two vehicle times [s]."""
        samples = self._since(since, until)
        return len(samples) < 2 or any(b.t - a.t > GAP for a, b in pairwise(samples))

    def visited_at(self, point: Point, radius: float, since: float,
                   until: float = math.inf) -> float | None:
        """Vehicle time [s] at which it was first at a point; None where it was not seen there."""
        first, last = self._stay(point, radius, since, until=until)
        return first if last >= first else None

    def approached(self, point: Point, radius: float, since: float, until: float) -> bool:
        """Whether it came to a point just after the newest sample, if it kept its velocity.

        Args:
            point: ENU [m].
            radius: acceptance radius [m]; 0: the autopilot's default.
            since: vehicle time [s]; an earlier sample shows nothing.
            until: vehicle time [s]; at most _AHEAD after the sample counts.
        """
        last = self.sample
        if last is None or not since <= last.t < until or math.isnan(math.hypot(*last.velocity)):
            return False
        time = min(until - last.t, _AHEAD)
        x, y, z = (p + v * time for p, v in zip(last.position, last.velocity, strict=True))
        return segment_distance(point, last.position, (x, y, z)) <= (
            radius or _DEFAULT_RADIUS) + CLOSE + _CURVE * time * time

    def could_have_flown(self, chain: Sequence[Point], then: Point | None, holds: float,
                         since: float, anywhere: bool = False, home: Point | None = None,
                         until: float = math.inf) -> bool:
        """Whether it can have flown through `chain` in a gap of the samples.

        Args:
            chain: points in order, ENU [m].
            then: the next point, ENU [m]; None: it stays at the last one.
            holds: sum of the hold times [s].
            since: vehicle time [s].
            anywhere: it was not bound for the next point any more.
            home: where it returns to from the last point, at a height that is not known; ENU [m].
            until: vehicle time [s]; a gap that begins later does not count.

        Returns:
            True where a gap is long enough and the sample after it is of a vehicle that flies the
            following leg.
        """
        fastest, samples = self.fastest, self._since(since)
        for (a, b), c in zip(pairwise(samples), (*samples[2:], None), strict=False):
            if b.t - a.t > GAP and a.t <= until and polyline_length(
                    (a.position, *chain, b.position)) <= (
                    _longest_way(a, b, 1.1 * fastest, b.t - a.t - 0.8 * holds)) + 10.0 and (
                    anywhere or (_on_leg(b.position, (a.position, *chain), then, home)
                    and (home is not None or (_moves_along(b, chain[-1], then, fastest)
                    and not _turned_on_leg(b, c, chain[-1], then))))):
                return True
        return False

    def begins_on_leg(self, start: Point | None, then: Point | None) -> bool:
        """Whether the first sample is of a vehicle that came straight from a point.

        Args:
            start: from which it would have come, ENU [m]; None: not known.
            then: to which it would fly on, ENU [m]; None: not known.
        """
        if not self._samples or start is None or then is None:
            return False
        first, after = self._samples[0], self._samples[1] if len(self._samples) > 1 else None
        speed, flown = math.hypot(*first.velocity), math.dist(first.position, start)
        if not speed > _HOLD_SPEED:
            return False
        x, y, z = (p - flown * v / speed for p, v in zip(
            first.position, first.velocity, strict=True))
        return (math.dist((x, y, z), start) <= _STRAIGHT
                and segment_distance(first.position, start, then) <= _STRAIGHT
                and _moves_along(first, start, then, self.fastest)
                and not _turned_on_leg(first, after, start, then))

    @property
    def fastest(self) -> float:
        """The highest speed [m/s] of late; the usual one where it has hardly moved."""
        speeds = self._speeds[-200:]
        top = max(speeds, default=0.0)
        if top >= _USUAL_SPEED:
            return top
        moved = top > _HOLD_SPEED and (
            len([speed for speed in speeds if speed > _HOLD_SPEED]) >= _FEW)
        return max(top, 5.0) if moved else _USUAL_SPEED

    def _since(self, since: float, until: float = math.inf) -> list[PositionSample]:
        at = bisect_left(self._samples, since, key=lambda one: one.t)
        if until == math.inf:
            return self._samples[max(0, at - 1):]
        end = bisect_left(self._samples, until, key=lambda one: one.t)
        return self._samples[max(0, at - 1):end + 1]

    def _stay(self, point: Point, radius: float, since: float,
              slow: bool = False, until: float = math.inf,
              close: float = CLOSE) -> tuple[float, float]:
        """First and last vehicle time [s] at a point (`slow`: at less than _HOLD_SPEED).

        (inf, -inf) where it never was there.
        """
        near = (radius or _DEFAULT_RADIUS) + (0.0 if slow else close)
        first, last = math.inf, -math.inf
        samples = self._since(since, until)
        if len(samples) == 1 and math.dist(samples[0].position, point) <= near:
            return samples[0].t, samples[0].t
        away = [math.dist(sample.position, point) for sample in samples]
        for (a, b), (from_a, from_b) in zip(pairwise(samples), pairwise(away), strict=True):
            gap = b.t - a.t
            if b.t < since or min(from_a, from_b) > near + 5.0 + 30.0 * gap:
                continue
            reach = near + _CURVE * gap * gap * (gap <= GAP)
            for k, (share, place) in enumerate(zip(_SHARES, _between(a, b), strict=True)):
                if gap > GAP and 0 < k < _PIECES:
                    continue  # of a gap only its ends are known
                t = a.t + gap * k / _PIECES
                if since <= t <= until and math.dist(place, point) <= reach:
                    first = min(first, t)
                    if not slow or math.dist(a.velocity, (0, 0, 0)) * (1 - share) + share * (
                            math.dist(b.velocity, (0, 0, 0))) < _HOLD_SPEED:
                        last = max(last, t)
        return first, last


def _longest_way(a: PositionSample, b: PositionSample, fastest: float, time: float) -> float:
    """Length [m] of what can be flown between two samples in `time` [s] of motion."""
    first, last = math.hypot(*a.velocity), math.hypot(*b.velocity)
    if math.isnan(first + last):
        return fastest * time
    top = max(first, last, min(fastest, (first + last + _ACCELERATION * time) / 2.0))
    ramps = (2.0 * top**2 - first**2 - last**2) / (2.0 * _ACCELERATION)  # [m]
    return ramps + top * max(0.0, time - (2.0 * top - first - last) / _ACCELERATION)


def _on_leg(point: Point, flown: Sequence[Point], then: Point | None,
            home: Point | None) -> bool:
    """Whether it flies from the last point flown to the next one, or home at any height."""
    start = flown[-1]
    if home is not None:
        return segment_distance(point[:2], start[:2], home[:2]) <= _CORRIDOR
    if segment_distance(point, start, then or start) > _CORRIDOR:
        return False
    if then is None or math.dist(start, then) == 0.0:
        return True
    # straight from before the turn it would come along its inner side
    aside, inwards = _beside(point, start, then), _beside(flown[-2], start, then)
    inner = sum(p * q for p, q in zip(aside, inwards, strict=True))
    return inner <= _INSIDE * math.hypot(*inwards)


def _moves_along(sample: PositionSample, start: Point, then: Point | None,
                 fastest: float) -> bool:
    """Whether it is as fast along a leg as a vehicle that flies it; True where not known.

    One that turns around in the middle of a leg has not come from its start.
    """
    length = 0.0 if then is None else math.dist(start, then)
    if then is None or length == 0.0 or math.isnan(math.hypot(*sample.velocity)):
        return True
    along = [(q - p) / length for p, q in zip(start, then, strict=True)]
    flown = math.fsum((q - p) * k for p, q, k in zip(start, sample.position, along, strict=True))
    speed = math.fsum(v * k for v, k in zip(sample.velocity, along, strict=True))
    free = min(flown, length - flown) - _LEG_END
    return free <= 0.0 or speed >= min(
        math.sqrt(2.0 * _LEAST_ACCELERATION * free), _LEAST_SHARE * fastest)


def _turned_on_leg(sample: PositionSample, after: PositionSample | None, start: Point,
                   then: Point | None) -> bool:
    """Whether a vehicle that gathers speed along a leg set out from beyond the leg's start.

    It turned around there before it came to the start.
    """
    length = 0.0 if then is None else math.dist(start, then)
    if then is None or length == 0.0 or after is None or after.t - sample.t > GAP:
        return False
    along = [(q - p) / length for p, q in zip(start, then, strict=True)]
    first, last = (math.fsum(v * k for v, k in zip(each.velocity, along, strict=True))
                   for each in (sample, after))
    gained = (last - first) / (after.t - sample.t)
    if not (0.0 <= first < last and gained >= _LEAST_ACCELERATION):
        return False  # or not known
    flown = math.fsum((q - p) * k for p, q, k in zip(start, sample.position, along, strict=True))
    return flown - first**2 / (2.0 * gained) > _TURN


def _beside(point: Point, start: Point, end: Point) -> Point:
    """Vector [m] to a point from the line through two others."""
    along = [q - p for p, q in zip(start, end, strict=True)]
    offset = [q - p for p, q in zip(start, point, strict=True)]
    share = sum(p * q for p, q in zip(along, offset, strict=True)) / math.hypot(*along)**2
    x, y, z = (q - share * p for p, q in zip(along, offset, strict=True))
    return x, y, z


def _between(a: PositionSample, b: PositionSample) -> Iterator[Point]:
    """The points at _SHARES of the way between two samples; linear where a velocity is unknown."""
    (px, py, pz), (ux, uy, uz) = a.position, a.velocity
    (qx, qy, qz), (wx, wy, wz) = b.position, b.velocity
    if math.isnan(ux + uy + uz + wx + wy + wz):
        for share in _SHARES:
            x, y, z = point_at(a.position, b.position, share)
            yield x, y, z
        return
    h = b.t - a.t
    for _, from_a, by_a, from_b, by_b in _HERMITE:
        by_a, by_b = h * by_a, h * by_b
        yield (from_a * px + by_a * ux + from_b * qx + by_b * wx,
               from_a * py + by_a * uy + from_b * qy + by_b * wy,
               from_a * pz + by_a * uz + from_b * qz + by_b * wz)
