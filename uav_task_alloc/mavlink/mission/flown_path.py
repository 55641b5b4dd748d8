# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle has been, by its own positions and clock: was it at a place, how long?"""
from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from uav_task_alloc.geometry.polyline import polyline_length, segment_distance
from uav_task_alloc.model import Point

_KEPT = 900  # samples: three minutes at 5 Hz
GAP = 2.5  # [s] between two positions: beyond, nobody knows where it was
_ACCEPTED = 2.0  # [m] at which autopilots count a waypoint as reached, where the task says nothing
CLOSE = 0.5  # [m] beyond that
SLOW = 0.4  # [m/s] it stays, and does not leave again
CURVE = 0.4  # [m/s2] by which the way between two positions may differ from its interpolation
PIECES = 8  # points looked at between two positions
JUMP = 30.0  # [m] beyond what its speed explains: it did not fly that
ASIDE = 8.0  # [m] beside a leg: it is flown
HOLD_SLACK = 0.1  # [s] by which a hold may look shorter than it was


class Visit(Enum):
    """Whether a vehicle was at a place."""

    YES = 'yes'
    NO = 'no'
    UNOBSERVED = 'it was not seen for a while'


class PositionSample(NamedTuple):
    """One GLOBAL_POSITION_INT."""

    t: float  # [s] of the vehicle's clock
    position: Point  # [m] ENU
    velocity: Point  # [m/s] ENU


class FlownPath:
    """Samples in the order of the vehicle's clock, however late they come."""

    def __init__(self) -> None:
        self._samples: list[PositionSample] = []

    @property
    def newest(self) -> float:
        """[s] of the vehicle's clock; -inf where nothing is known."""
        return self._samples[-1].t if self._samples else -math.inf

    def add(self, sample: PositionSample) -> None:
        """Take a position in, in O(1) where they come in order."""
        if not self._samples or sample.t > self._samples[-1].t:
            self._samples.append(sample)
        else:
            at = bisect_left(self._samples, sample.t, key=lambda one: one.t)
            if self._samples[at].t != sample.t:
                self._samples.insert(at, sample)
        if len(self._samples) > _KEPT + 100:
            del self._samples[:100]

    def jumps(self, sample: PositionSample) -> bool:
        """Whether it cannot have flown to a new sample from the newest one."""
        if not self._samples or not 0.0 < sample.t - self.newest <= GAP:
            return False
        last = self._samples[-1]
        fastest = max(math.hypot(*last.velocity), math.hypot(*sample.velocity))
        way = math.dist(last.position, sample.position)
        return way > JUMP + 2.0 * fastest * (sample.t - last.t)

    def clear(self) -> None:
        """Its clock has begun anew."""
        self._samples.clear()

    def visited(self, place: Point, radius: float, hold: float, since: float,
              until: float = math.inf, close: float = CLOSE) -> Visit:
        """Whether it was at a place.

        Args:
            place: [m] ENU.
            radius: [m] at which it counts as reached; 0: the autopilot's own.
            hold: [s] it has to stay there.
            since, until: [s] of the vehicle's clock.
            close: [m] beyond the radius that counts as well, without a hold.
        """
        first, last = self._stay(place, radius, since, hold > 0.0, until, close)
        if last - first >= max(0.0, hold - HOLD_SLACK):
            return Visit.YES
        samples = self._since(since, until)
        blind = len(samples) < 2 or any(b.t - a.t > GAP for a, b in pairwise(samples))
        return Visit.UNOBSERVED if blind else Visit.NO

    def visited_at(self, place: Point, radius: float, since: float,
                   until: float = math.inf) -> float | None:
        """When it was there first, [s] of its clock; None: it was not seen there."""
        first, last = self._stay(place, radius, since, until=until)
        return first if last >= first else None

    def could_have_flown(self, chain: Sequence[Point], then: Point | None, holds: float,
                   since: float) -> bool:
        """Whether it can have flown through `chain` while it was not seen, and is past it.

        Args:
            chain: places [m] ENU in order.
            then: where it flies from there; None: it stays at the last.
            holds: [s] it stays at them in all.
            since: [s] of the vehicle's clock.
        """
        samples = self._since(since)
        if len(samples) < 2:
            return False
        a, b = max(pairwise(samples), key=lambda two: two[1].t - two[0].t)
        way = polyline_length((a.position, *chain, b.position))
        fastest = max(5.0, *(math.hypot(*s.velocity) for s in self._samples[-200:]))
        if way > 1.1 * fastest * (b.t - a.t - 0.8 * holds) + 10.0:
            return False
        return segment_distance(b.position, chain[-1], then or chain[-1]) <= ASIDE

    def _since(self, since: float, until: float = math.inf) -> list[PositionSample]:
        at = bisect_left(self._samples, since, key=lambda one: one.t)
        end = bisect_left(self._samples, until, key=lambda one: one.t)
        return self._samples[max(0, at - 1):end + 1]

    def _stay(self, place: Point, radius: float, since: float,
              slow: bool = False, until: float = math.inf,
              close: float = CLOSE) -> tuple[float, float]:
        """When it came and when it was there last (`slow`: and did not leave yet).

        (inf, -inf) where it never was.
        """
        near = (radius or _ACCEPTED) + (0.0 if slow else close)
        first, last = math.inf, -math.inf
        samples = self._since(since, until)
        if len(samples) == 1 and math.dist(samples[0].position, place) <= near:
            return samples[0].t, samples[0].t
        for a, b in pairwise(samples):
            gap = b.t - a.t
            if gap > GAP or b.t < since or min(
                    math.dist(a.position, place), math.dist(b.position, place)) > (
                        near + 5.0 + 30.0 * gap):
                continue
            reach = near + CURVE * gap * gap
            for k in range(PIECES + 1):
                t, share = a.t + gap * k / PIECES, k / PIECES
                if since <= t <= until and math.dist(_between(a, b, share), place) <= reach:
                    first = min(first, t)
                    if not slow or math.dist(a.velocity, (0, 0, 0)) * (1 - share) + share * (
                            math.dist(b.velocity, (0, 0, 0))) < SLOW:
                        last = max(last, t)
        return first, last


def _between(a: PositionSample, b: PositionSample, share: float) -> Point:
    """Cubic Hermite interpolation: both positions, both velocities."""
    h, s = b.t - a.t, share
    if any(math.isnan(v) for v in (*a.velocity, *b.velocity)):
        x, y, z = (p + (q - p) * s for p, q in zip(a.position, b.position, strict=True))
        return x, y, z
    k = (2 * s**3 - 3 * s**2 + 1, h * (s**3 - 2 * s**2 + s), 3 * s**2 - 2 * s**3,
         h * (s**3 - s**2))
    x, y, z = (k[0] * p + k[1] * u + k[2] * q + k[3] * w for p, u, q, w in zip(
        a.position, a.velocity, b.position, b.velocity, strict=True))
    return x, y, z
