# SPDX-License-Identifier: Apache-2.0
"""Conflicts of planned flights are resolved: other transit heights, then waits before legs.

Flights are planned one after another (prioritised planning, Erdmann and Lozano-Perez 1987): each
leg takes the cheapest change with which it is apart from all flights before it. A leg without a
conflict stays as it is, and so does each leg under way.
"""
from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from uav_task_alloc.separation.conflicts import AcceptedRows, FoundConflict, find_conflicts
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg, LegTimes, leg_times
from uav_task_alloc.separation.leg_changes import (
    LegChange,
    TransitLimits,
    keeps_deadlines,
    other_heights,
    with_wait,
)
from uav_task_alloc.separation.rule import Conflict, Separation
from uav_task_alloc.separation.volumes import (
    PieceRow,
    end_rows,
    flight_volumes,
    leg_rows,
    meeting_place,
    rows_of_legs,
)

STOPPED = 'no change was found in time'
_HOLDS = (3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)  # [s] in the air
_TAKE_OFFS = tuple(5.0 * k for k in range(1, 181))  # [s] that a UAV may wait on the ground
_MOST_PATHS = 4  # the cheapest, with which waits are combined
_LEAST_SAVED = 3.0  # [s] of a wait; for less it stays as it is
_SOONER = (0.0, 0.25, 0.5, 0.75)  # of a wait of an earlier plan
_GROUND = 0.5  # price of a second of waiting on the ground
LegIndex = tuple[int, int]  # of a flight, and of its leg


@dataclass(slots=True)
class Resolution:
    """Flights that are apart, as far as possible.

    Attributes:
        flights: in the order given.
        conflicts: those that there were, and how each was resolved.
        left: those that there still are.
    """

    flights: tuple[Flight, ...]
    conflicts: tuple[Conflict, ...] = ()
    left: list[FoundConflict] = field(default_factory=list)


def resolve(flights: Sequence[Flight], rule: Separation,
            limits: TransitLimits | None = None, places: bool = False) -> Resolution:
    """Change heights and begins of legs so that the flights are apart.

    Args:
        flights: planned; those earlier in the sequence change less.
        rule: that is on.
        limits: of heights and zones; None: none.
        places: conflicts get positions, 0.2 ms each.

    Returns:
        The same flights where no two are in conflict.
    """
    volumes = flight_volumes(flights, rule)
    found = find_conflicts(volumes, rule)
    # by earlier plans, for which there may be no need any more
    changed = {k for k, flight in enumerate(flights) for leg in flight.legs
               if leg.movable and (leg.hold_until > -math.inf or _returns_higher(leg))}
    if not found and not changed:
        return Resolution(tuple(flights))
    planner = _Planner(flights, rule, limits or TransitLimits())
    involved = changed | {k for each in found for k in each.flights}
    for k in range(len(flights)):
        planner.accept_fixed(k, whole=k not in involved)
    # in the air first: those on the ground can wait there
    for k in sorted(involved, key=lambda k: not flights[k].in_air):
        planner.plan(k)
    after = tuple(planner.flights)
    left = find_conflicts(flight_volumes(after, rule), rule)
    explained = [_explained(flights, planner, each, left) for each in found]
    if places:
        explained = [replace(conflict, position=meeting_place(
            volumes, each.flights, each.legs, each.time))
            for conflict, each in zip(explained, found, strict=True)]
    return Resolution(after, tuple(explained), left)


class _Planner:
    """Plans flights one after another, each apart from those accepted."""

    def __init__(self, flights: Sequence[Flight], rule: Separation,
                 limits: TransitLimits) -> None:
        self.flights, self.changes = list(flights), dict[LegIndex, LegChange]()
        self.stopped = False  # changes that might help were not tried
        self._rule, self._limits = rule, limits
        self._accepted = AcceptedRows(rule)

    def accept_fixed(self, k: int, whole: bool) -> None:
        """Accept a flight as it is, or what is under way of one that may change."""
        flight = self.flights[k]
        for n, rows in enumerate(rows_of_legs(flight, self._rule)):
            if not whole and n < len(flight.legs) and flight.legs[n].movable:
                if n == 0:
                    self._accepted.add(rows[:_kept_rows(flight, rows)], (k, n))
                return
            self._accepted.add(rows, (k, n))  # also where one without legs stays

    def plan(self, k: int) -> None:
        """Change the legs of a flight that are in conflict, and accept it."""
        flight, ready, fixed = self.flights[k], self.flights[k].begin, True
        for n in range(len(flight.legs)):
            leg = flight.legs[n]
            fixed = fixed and not leg.movable
            if leg.movable and not self.stopped:
                change = self._changed(flight, k, n, ready)
                if change is not None and change.kind:
                    self.changes[k, n] = change
                    leg = change.leg
                    flight = _with_leg(flight, n, leg)
            times = leg_times(flight, leg, ready, n == 0)
            if not fixed:
                self._accepted.add(leg_rows(flight, leg, times, self._rule, n == 0), (k, n))
            ready = times.end
        self.flights[k] = flight
        self._accepted.add(self._stay(flight, ready), (k, len(flight.legs)))

    def _stay(self, flight: Flight, end: float) -> list[PieceRow]:
        """The stay in the air after the last leg."""
        last = flight.legs[-1] if flight.legs else None
        if last.lands if last else not flight.in_air:
            return []
        return end_rows(flight, self._rule, end, last.points[-1] if last else flight.position)

    def _changed(self, flight: Flight, k: int, n: int, ready: float) -> LegChange | None:
        """The cheapest change with which the leg is apart; None: there is none."""
        leg = flight.legs[n]
        planned = leg_times(flight, leg, ready, n == 0)
        if self._is_apart(flight, k, n, leg, planned):
            return self._sooner(flight, k, n, ready)
        after = flight.legs[n + 1] if n + 1 < len(flight.legs) else None
        bounded = not leg.may_wait or (
            after is not None and not after.may_wait and after.movable)
        most = self._limits.max_price if bounded else math.inf
        found = self._cheapest(flight, k, n, ready, most)
        if found is not None or not bounded or after is None:
            return found
        # that return would cost too much: without it
        if self._is_apart(flight, k, n, leg, planned, whole=False):
            return self._sooner(flight, k, n, ready)
        return self._cheapest(flight, k, n, ready, math.inf, whole=False)

    def _cheapest(self, flight: Flight, k: int, n: int, ready: float, max_price: float,
                  whole: bool = True) -> LegChange | None:
        """The cheapest change that costs at most so many seconds of flight; None: there is none.

        Where not `whole`, the return after it does not count.
        """
        leg = flight.legs[n]
        planned = leg_times(flight, leg, ready, n == 0)
        paths = sorted((LegChange(leg, 0.0, '', ''), *self._heights(flight, leg)),
                       key=lambda each: each.seconds)
        waits = _TAKE_OFFS if leg.takes_off else _HOLDS
        if not leg.may_wait or (n == 0 and flight.in_air and not flight.waits):
            waits = ()
        price = _GROUND if leg.takes_off else 1.0
        options = [(path.seconds + price * wait, wait, number) for number, path in enumerate(paths)
                   for wait in (0.0, *(waits if number < _MOST_PATHS else ()))]
        for _, wait, number in sorted(options):
            if self._limits.stop():
                self.stopped = True
                break
            if paths[number].seconds + (0.0 if leg.takes_off else wait) > max_price:
                continue
            option = with_wait(paths[number], planned.begin, wait)
            times = leg_times(flight, option.leg, ready, n == 0)
            if option.kind and self._is_apart(flight, k, n, option.leg, times, whole) and (
                    keeps_deadlines(flight, n, times.end - planned.end, planned.end)) and (
                    self._limits.is_allowed(_with_leg(flight, n, option.leg))):
                return option
        return None

    def _sooner(self, flight: Flight, k: int, n: int, ready: float) -> LegChange:
        """A leg that is apart, with less height or wait of an earlier plan, if that is enough."""
        leg = flight.legs[n]
        lower = self._lower(flight, k, n, ready)
        if lower is not None:
            return lower
        without = replace(leg, hold_until=-math.inf)
        begin, planned = (leg_times(flight, each, ready, n == 0).begin for each in (without, leg))
        for share in _SOONER:
            wait = share * (planned - begin)
            if wait > planned - begin - _LEAST_SAVED:
                break  # not counted by `stop`: the legs after it would have no search left
            sooner = replace(leg, hold_until=begin + wait if wait else -math.inf)
            times = leg_times(flight, sooner, ready, n == 0)
            if self._is_apart(flight, k, n, sooner, times):
                return LegChange(sooner, wait, f'waits {wait:.0f} s only', 'hold')
        return LegChange(leg, 0.0, '', '')

    def _lower(self, flight: Flight, k: int, n: int, ready: float) -> LegChange | None:
        """A return at less height than an earlier plan gave it; None: it stays as it is."""
        leg = flight.legs[n]
        if not _returns_higher(leg):
            return None
        saved = [each for each in self._heights(flight, leg) if each.seconds < -_LEAST_SAVED]
        for change in sorted(saved, key=lambda each: each.seconds):
            times = leg_times(flight, change.leg, ready, n == 0)
            if self._is_apart(flight, k, n, change.leg, times) and (
                    self._limits.is_allowed(_with_leg(flight, n, change.leg))):
                return replace(change, seconds=0.0)
        return None

    def _is_apart(self, flight: Flight, k: int, n: int, leg: FlightLeg, times: LegTimes,
                  whole: bool = True) -> bool:
        """Whether a leg is apart, and the return or path after it that cannot wait (`whole`)."""
        rows = leg_rows(flight, leg, times, self._rule, n == 0)
        if n == 0:
            rows = rows[_kept_rows(replace(flight, legs=(leg,)), rows):]
        if n + 1 == len(flight.legs):
            rows += self._stay(flight, times.end)
        if self._accepted.conflict(rows, k) is not None:
            return False
        after = flight.legs[n + 1] if n + 1 < len(flight.legs) else None
        if after is None or after.may_wait or not whole:
            return True
        # the only wait for the next leg is this one
        heights = self._heights(flight, after) if after.movable else ()
        return any(self._is_apart(flight, k, n + 1, each, leg_times(flight, each, times.end))
                   for each in (after, *(change.leg for change in heights)))

    def _heights(self, flight: Flight, leg: FlightLeg) -> Iterator[LegChange]:
        """The leg at other transit heights that it may have."""
        return other_heights(flight, leg, self._rule, self._limits)


def _with_leg(flight: Flight, n: int, leg: FlightLeg) -> Flight:
    """A flight with another n-th leg."""
    return replace(flight, legs=(*flight.legs[:n], leg, *flight.legs[n + 1:]))


def _kept_rows(flight: Flight, rows: Sequence[PieceRow]) -> int:
    """Number of pieces of the first leg that no change of it changes.

    In the air they are the hover before its release, and the rest of a take-off that has begun.
    """
    leg = flight.legs[0]
    if not flight.in_air or not rows:
        return 0
    end = rows[0][0] if flight.waits else max(rows[0][0], leg.release)
    if leg.top > leg.points[0][2]:
        end += flight.parts(leg, True)[0][0]
    return sum(row[1] <= end + 1e-6 for row in rows)


def _returns_higher(leg: FlightLeg) -> bool:
    """Whether a leg is a return that climbs first."""
    return leg.lands and not leg.climbs_first and (
        max(point[2] for point in leg.points) > leg.points[0][2])


def _explained(before: Sequence[Flight], planner: _Planner, each: FoundConflict,
          left: Sequence[FoundConflict]) -> Conflict:
    """A conflict, and what was done about it."""
    uavs = before[each.flights[0]].uav, before[each.flights[1]].uav
    ends = _task_of(before, each, 0), _task_of(before, each, 1)
    texts, kinds = list[str](), list[str]()
    for k, n, uav in zip(each.flights, each.legs, uavs, strict=True):
        change = planner.changes.get((k, n))
        if change is None:  # an earlier leg may have been made to wait
            change = next((planner.changes[k, m] for m in range(min(n, len(
                before[k].legs)) - 1, -1, -1) if (k, m) in planner.changes), None)
        if change is not None:
            texts.append(f'{uav} {change.text}')
            kinds.append(change.kind)
    still = any(other.flights == each.flights and other.legs == each.legs for other in left)
    kind = '' if still else 'height' if 'height' in kinds else 'hold'
    failed = STOPPED if planner.stopped else 'no height or wait resolves it'
    return Conflict(uavs, ends, each.time, each.horizontal, each.vertical, kind,
                    failed if still else '; '.join(texts))


def _task_of(flights: Sequence[Flight], each: FoundConflict, side: int) -> str:
    legs, n = flights[each.flights[side]].legs, each.legs[side]
    return legs[min(n, len(legs) - 1)].task if legs else ''


def flight_seconds(flight: Flight) -> float:
    """Return the time that a flight is in the air up to the end of its last leg [s].

    Args:
        flight: planned.
    """
    total, ready = 0.0, flight.begin
    for n, leg in enumerate(flight.legs):
        times = leg_times(flight, leg, ready, n == 0)
        total += (times.arrival if leg.lands else times.end) - (
            times.begin if leg.takes_off else ready)
        ready = times.end
    return total
