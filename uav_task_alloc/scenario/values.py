# SPDX-License-Identifier: Apache-2.0
"""A scenario: a fleet, and tasks and zones with the times at which they appear and disappear."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields

from uav_task_alloc.geometry.fence_area import AreaCorners, zones_outside
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Point, Task, ThreatZone, Uav
from uav_task_alloc.objective import Objective
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.separation.rule import Separation
from uav_task_alloc.work.pieces import Work

DEFAULT_ORIGIN = Origin(47.397742, 8.545594, 488.0)
DEFAULT_SPEEDUP = 8.0  # times faster than real time
UAV_LIMITS = ('endurance', 'full_range', 'full_endurance', 'turnaround', 'payload_capacity',
              'climb_speed', 'descent_speed', 'available_from', 'available_until')
TASK_TIMES = 'earliest', 'latest', 'release', 'payload'  # as in model.Task


@dataclass(frozen=True, slots=True)
class ScenarioUav:
    """One simulated vehicle of the fleet."""

    id: str  # a ROS name
    system_id: int  # MAVLink, 1..255
    autopilot: str  # ardupilot | px4
    position: Point  # [m] ENU at the start
    home: Point  # [m] ENU
    cruise_speed: float = 15.0  # [m/s]
    range: float = math.inf  # [m]
    capabilities: frozenset[str] = frozenset()  # that tasks may require
    dies_at: float | None = None  # [s]
    endurance: float = math.inf  # [s]
    full_range: float | None = None  # [m] after a visit of its home; None: range
    full_endurance: float | None = None  # [s] after a visit of its home; None: endurance
    turnaround: float = math.inf  # [s] of such a visit
    payload_capacity: float = 0.0  # [kg]
    climb_speed: float = math.inf  # [m/s]
    descent_speed: float = math.inf  # [m/s]
    available_from: float = 0.0  # [s]
    available_until: float = math.inf  # [s]

    @property
    def most_range(self) -> float:
        """Range with a full battery [m]."""
        return self.range if self.full_range is None else self.full_range

    @property
    def most_endurance(self) -> float:
        """Time in the air with a full battery [s]."""
        return self.endurance if self.full_endurance is None else self.full_endurance

    @property
    def charge(self) -> float:
        """Share of the battery at the start."""
        return min(1.0, _share(self.range, self.most_range),
                   _share(self.endurance, self.most_endurance))

    @property
    def uav(self) -> Uav:
        """The UAV at the start, for the solver."""
        return Uav(self.id, self.position, self.range, self.cruise_speed, self.capabilities,
                   self.home, **{name: getattr(self, name) for name in UAV_LIMITS})


def _share(part: float, whole: float) -> float:
    return 1.0 if part == whole or whole == 0.0 else part / whole


@dataclass(frozen=True, slots=True)
class TimedTask:
    """A task and the time of its announcement."""

    at: float  # [s]
    task: Task  # announced at `at`
    work: Work | None = None  # of which `task` is the task; None: a point

    @property
    def whole(self) -> Work:
        """The task with its kind and geometry."""
        return self.work or Work(self.task)


@dataclass(frozen=True, slots=True)
class TimedZone:
    """A zone and the time during which it is in force."""

    zone: ThreatZone  # in force from `appears` to `vanishes`
    appears: float = 0.0  # [s]
    vanishes: float = math.inf  # [s]

    def in_force(self, at: float) -> bool:
        """Whether the zone is in force at a time.

        Args:
            at: [s] of the scenario.
        """
        return self.appears <= at < self.vanishes


@dataclass(frozen=True, slots=True)
class Cancel:
    """The withdrawal of a task."""

    at: float  # [s]
    task: str  # id


@dataclass(frozen=True, slots=True)
class TimedOrder:
    """An order of an operator, as `uav_task_alloc order` has them."""

    at: float  # [s]
    order: str  # pin | forbid | next
    uav: str  # id
    tasks: tuple[str, ...]  # ids; of next in the order of flight

    @property
    def text(self) -> str:
        """What it says, in words."""
        names = ' '.join(self.tasks)
        return f'next of {self.uav} {names}' if self.order == 'next' else (
            f'{self.order} {names} to {self.uav}')


@dataclass(frozen=True, slots=True)
class ScenarioWind:
    """The wind in which simulated UAVs fly."""

    east: float = 0.0  # [m/s] of the air
    north: float = 0.0  # [m/s] of the air
    gusts: float = 0.0  # [m/s] standard deviation of each component


@dataclass(frozen=True, slots=True)
class Scenario:
    """The content of a file, with the random arrivals drawn; times in scenario seconds."""

    name: str  # as in the file, else its name without suffix
    seed: int  # of the random arrivals and the solver
    origin: Origin  # of the ENU frame
    uavs: tuple[ScenarioUav, ...]  # the fleet
    tasks: tuple[TimedTask, ...]  # by `at`
    zones: tuple[TimedZone, ...] = ()  # in the order of the file
    cancels: tuple[Cancel, ...] = ()  # by `at`
    route_end: str = 'hold'  # hold | home
    speedup: float = DEFAULT_SPEEDUP  # of a simulated flight
    clearance: float = AllocatorParams.clearance  # [m] beyond the margins of zones
    altitude_min: float = AllocatorParams.altitude_min  # [m] of detours
    altitude_max: float = AllocatorParams.altitude_max  # [m] of detours
    objective: str | Objective | None = None  # a name of OBJECTIVES, or prices; None: not given
    trips: int = 1  # of each UAV
    wind: ScenarioWind = ScenarioWind()  # of a simulated flight
    separation: Separation = field(default_factory=Separation)  # horizontal 0: none
    orders: tuple[TimedOrder, ...] = ()  # by `at`; `plan` ignores them
    fence_area: AreaCorners = ()  # [m] that no plan leaves; (): none

    @property
    def duration(self) -> float:
        """The time of the last event [s]; the flights take longer."""
        times = [timed.at for timed in self.tasks] + [cancel.at for cancel in self.cancels]
        times += [order.at for order in self.orders]
        times += [uav.dies_at for uav in self.uavs if uav.dies_at is not None]
        times += [t for timed in self.zones for t in (timed.appears, timed.vanishes)
                  if math.isfinite(t)]
        return max(times, default=0.0)

    def no_fly_zones(self) -> list[ThreatZone]:
        """All zones of the file, at whatever time, and what is outside of `fence_area`."""
        return [*(timed.zone for timed in self.zones), *zones_outside(self.fence_area)]

    def zones_at(self, at: float) -> tuple[ThreatZone, ...]:
        """All zones in force at a time [s]."""
        return tuple(timed.zone for timed in self.zones if timed.in_force(at))

    def zone_changes(self) -> Sequence[float]:
        """The times at which the set of zones changes [s], in order; 0 is one of them."""
        times = {t for timed in self.zones for t in (timed.appears, timed.vanishes)}
        return sorted({0.0} | {t for t in times if math.isfinite(t)})

    def keys_of_plan_only(self) -> tuple[str, ...]:
        """Return keys that are set here and that only `plan` uses: a flight ignores them."""
        plain = {field.name: field.default for field in fields(ScenarioUav)}
        return tuple(key for key in ('available_from', 'available_until')
                     if any(getattr(each, key) != plain[key] for each in self.uavs))
