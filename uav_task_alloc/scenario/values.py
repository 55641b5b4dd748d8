# SPDX-License-Identifier: Apache-2.0
"""A scenario as values: a fleet, and which tasks and zones come and go at which second."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Point, Task, ThreatZone, Uav
from uav_task_alloc.params import AllocatorParams

DEFAULT_ORIGIN = Origin(47.397742, 8.545594, 488.0)
DEFAULT_SPEEDUP = 8.0  # times faster than real time


@dataclass(frozen=True, slots=True)
class ScenarioUav:
    """One vehicle of the fleet, as the simulator builds it."""

    id: str
    system_id: int  # MAVLink, 1..255
    autopilot: str  # ardupilot | px4
    position: Point  # [m] ENU at the start
    home: Point  # [m] ENU
    cruise_speed: float = 15.0  # [m/s]
    range: float = math.inf  # [m]
    capabilities: frozenset[str] = frozenset()
    dies_at: float | None = None  # [s]

    @property
    def uav(self) -> Uav:
        """As the solver sees it at the start."""
        return Uav(self.id, self.position, self.range, self.cruise_speed, self.capabilities,
                   self.home)


@dataclass(frozen=True, slots=True)
class TimedTask:
    """A task, and when it is announced."""

    at: float  # [s]
    task: Task


@dataclass(frozen=True, slots=True)
class TimedZone:
    """A zone, and the seconds between which it is there."""

    zone: ThreatZone
    appears: float = 0.0  # [s]
    vanishes: float = math.inf  # [s]

    def there(self, at: float) -> bool:
        """Whether the zone exists at a time [s]."""
        return self.appears <= at < self.vanishes


@dataclass(frozen=True, slots=True)
class Cancel:
    """A task is taken back."""

    at: float  # [s]
    task: str


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything a file says, the random arrivals drawn; times in scenario seconds."""

    name: str
    seed: int
    origin: Origin
    uavs: tuple[ScenarioUav, ...]
    tasks: tuple[TimedTask, ...]  # by `at`
    zones: tuple[TimedZone, ...] = ()
    cancels: tuple[Cancel, ...] = ()  # by `at`
    route_end: str = 'hold'  # hold | home
    speedup: float = DEFAULT_SPEEDUP  # of a simulated flight
    clearance: float = AllocatorParams.clearance  # [m] beyond the margins of zones
    altitude_min: float = AllocatorParams.altitude_min  # [m] of detours
    altitude_max: float = AllocatorParams.altitude_max  # [m] of detours

    @property
    def duration(self) -> float:
        """When the last event of the file has happened [s]; the flights take longer."""
        times = [timed.at for timed in self.tasks] + [cancel.at for cancel in self.cancels]
        times += [uav.dies_at for uav in self.uavs if uav.dies_at is not None]
        times += [t for timed in self.zones for t in (timed.appears, timed.vanishes)
                  if math.isfinite(t)]
        return max(times, default=0.0)

    def zones_at(self, at: float) -> tuple[ThreatZone, ...]:
        """The whole picture of zones at a time [s]."""
        return tuple(timed.zone for timed in self.zones if timed.there(at))

    def zone_changes(self) -> Sequence[float]:
        """The times at which the picture of zones changes [s], rising; 0 is always one."""
        times = {t for timed in self.zones for t in (timed.appears, timed.vanishes)}
        return sorted({0.0} | {t for t in times if math.isfinite(t)})
