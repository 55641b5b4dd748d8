# SPDX-License-Identifier: Apache-2.0
"""`Work` and `pieces_of`: checked work of any kind, and the tasks that it is cut into."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Point, Task, ThreatZone
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.above_ground import above_ground_task, barring_zones, following_ways
from uav_task_alloc.work.area import NOTHING_FLOWN, FlownStrips, area_ways, check_area
from uav_task_alloc.work.line import check_line, free_ways, line_ways
from uav_task_alloc.work.orbit import check_orbit, looks_at_centre, orbit_ways
from uav_task_alloc.work.values import (
    Geometry,
    Kind,
    Vertical,
    check_common,
    piece_tasks,
    refuse_unused,
)

Ways = list[tuple[Point, ...]]


@dataclass(frozen=True, slots=True)
class KindRules:
    """What a kind of work is: how it is checked and cut."""

    check: Callable[[Geometry], None]  # raises InvalidValue
    ways: Callable[[Geometry, Sequence[ThreatZone], float], Ways]  # outside the zones
    reversible: bool  # a piece may be flown from either end
    finish: Callable[[Geometry, Task], Task] = lambda given, task: task  # of each piece


KINDS = {
    Kind.POINT: KindRules(lambda given: refuse_unused(given, ()), lambda *_: [], False),
    Kind.LINE: KindRules(check_line, line_ways, True),
    Kind.AREA: KindRules(check_area, area_ways, True),
    Kind.ORBIT: KindRules(check_orbit, orbit_ways, False, looks_at_centre),
}


@dataclass(frozen=True, slots=True)
class Work(Geometry):
    """A task of any kind; see `Geometry`.

    Raises:
        InvalidValue: a value is out of range, missing, or of another kind of work.
    """

    def __post_init__(self) -> None:
        check_common(self)
        KINDS[self.kind].check(self)


def pieces_of(work: Work, zones: Sequence[ThreatZone] = (), clearance: float = 0.0,
              terrain: Terrain | None = None,
              flown: FlownStrips = NOTHING_FLOWN) -> tuple[Task, ...]:
    """Cut work into tasks, each of which one UAV flies as a whole.

    Parts inside zones are left out. Where zones cover all of it, it is cut as if there were none:
    the solver says that its pieces are inside zones, as it does of points.

    Args:
        work: of any kind.
        zones: in force; each is enlarged by its margin and `clearance`.
        clearance: [m].
        terrain: the ground, for work whose heights are above it.
        flown: of an AREA whose heights are those of the ENU frame: it is left out.

    Returns:
        Of a POINT the task; of an AREA of which all is flown none; otherwise tasks with a `path`
        and ids `<task id>#<k>`, k from 1, with their share of value and service time by length,
        and all else as the task has it. The same for the same arguments.

    Raises:
        InvalidValue: there would be too many pieces, or heights are above a ground that is not
            known.
        TerrainError: the terrain does not reach as far.
    """
    if work.vertical is Vertical.TERRAIN and terrain is None:
        raise InvalidValue(work.place('vertical'), 'TERRAIN', 'ORIGIN: no terrain is given')
    ground = terrain if work.vertical is Vertical.TERRAIN else None
    if work.kind is Kind.POINT:
        return (work.task if ground is None else above_ground_task(work, ground),)
    rules = KINDS[work.kind]
    if ground is None:
        cut = partial(area_ways, flown=flown) if work.kind is Kind.AREA else rules.ways
        ways = cut(work, zones, clearance) or cut(work, (), clearance)
    else:
        ways = _ways_over(work, zones, clearance, ground)
        work = replace(work, task=above_ground_task(work, ground))
    return tuple(rules.finish(work, piece) for piece in piece_tasks(work, ways, rules.reversible))


def _ways_over(work: Work, zones: Sequence[ThreatZone], clearance: float,
               ground: Terrain) -> Ways:
    """Ways that follow the ground outside of zones, or as if there were none."""
    cut = KINDS[work.kind].ways
    through = following_ways(work, cut(work, (), clearance), ground)
    ways, barring = through, dict[str, ThreatZone]()
    if work.kind is Kind.AREA:
        barring = barring_zones(through, zones, clearance)
    if barring:
        around = cut(work, tuple(barring.values()), clearance)
        ways = following_ways(work, around, ground, through) if around else []
    others = [zone for zone in zones if zone.id not in barring]
    return [part for way in ways for part in free_ways(way, others, clearance)] or through
