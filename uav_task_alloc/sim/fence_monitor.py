# SPDX-License-Identifier: Apache-2.0
"""The fence of a simulated vehicle in flight: what it enforces, and what it does at a breach."""
from __future__ import annotations

from collections.abc import Callable, Sequence

from uav_task_alloc.geometry.frames import to_enu_batch
from uav_task_alloc.geometry.polygon import XY
from uav_task_alloc.model import Point
from uav_task_alloc.sim.config import FlightMode
from uav_task_alloc.sim.flight import CRITICAL, VehicleFlight
from uav_task_alloc.sim.parameters import SimParameters
from uav_task_alloc.sim.stored_fence import EnforcedShape, enforced_shapes
from uav_task_alloc.sim.stored_item import StoredItem

_POLYGON_FENCE = 4  # bit of FENCE_TYPE
_PLANNERS = (2.0, 3.0)  # OA_TYPE: Dijkstra, and both
_OA_MARGIN = 5.0  # [m] default of OA_MARGIN_MAX
_INVALID = "Geofence invalid, doesn't contain {}"


class FenceMonitor:
    """Detects breaches of the stored fence.

    Args:
        flight: of the vehicle.
        items: the fence store.
        parameters: of the vehicle.
        ardupilot: else PX4, which does not enforce a shape that home or a flying vehicle breaks.
        breach: called at a breach with the mode to enter; None: the mode stays.
    """

    def __init__(self, flight: VehicleFlight, items: Sequence[StoredItem],
                 parameters: SimParameters, ardupilot: bool,
                 breach: Callable[[int | None], None]) -> None:
        self._flight, self._items, self._parameters = flight, items, parameters
        self._ardupilot, self._breach = ardupilot, breach
        self.shapes: list[EnforcedShape] = []
        self.breached = False

    @property
    def enabled(self) -> bool:
        """Whether breaches have any effect."""
        get = self._parameters.get
        if self._ardupilot:
            return get('FENCE_ENABLE') > 0.0 and bool(int(get('FENCE_TYPE')) & _POLYGON_FENCE)
        return get('GF_ACTION') > 0.0

    def update(self) -> None:
        """Enforce the stored fence."""
        items = self._items
        places: list[XY] = [(x, y) for x, y, _ in self.places_of(items)]
        shapes = enforced_shapes(items, places, circle_spoils=not self._ardupilot)
        self.shapes = [shape for shape in shapes if self._ardupilot or self._is_valid(shape)]

    def places_of(self, items: Sequence[StoredItem]) -> list[Point]:
        """Positions of items of a fence or rally points at the height of home, [m] ENU."""
        flight = self._flight
        rows = to_enu_batch(flight.config.origin, [
            (item.x * 1e-7, item.y * 1e-7, flight.home_amsl) for item in items]).tolist()
        return [(x, y, z) for x, y, z in rows]

    def _is_valid(self, shape: EnforcedShape) -> bool:
        flight = self._flight
        if shape.breached_by(flight.home):
            flight.texts.append((CRITICAL, _INVALID.format('Home position')))
            return False
        if self.enabled and not flight.landed and shape.breached_by(flight.body.position):
            flight.texts.append((CRITICAL, _INVALID.format('current vehicle position')))
            return False
        return True

    def step(self) -> None:
        """Detect the beginning and the end of a breach."""
        flight = self._flight
        breached = bool(self.shapes) and flight.armed and not flight.landed and self.enabled and (
            any(shape.breached_by(flight.body.position) for shape in self.shapes))
        if breached and not self.breached:
            self._breach(self._mode())
        self.breached = breached

    def way_around(self, start: Point, end: Point) -> tuple[Point, ...]:
        """The points of a return around the exclusions (ArduPilot with OA_TYPE 2), [m] ENU.

        Straight with PX4, where the fence is off, and where there is no way around.
        """
        get = self._parameters.get
        if not self._ardupilot or not self.enabled or get('OA_TYPE') not in _PLANNERS:
            return ()
        margin = get('OA_MARGIN_MAX') or _OA_MARGIN
        zones = [shape.column(f'shape {n}', margin) for n, shape in enumerate(self.shapes)
                 if not shape.inclusion]
        if not zones:
            return ()
        # loads kernels, which a fleet without fences does not wait for
        from uav_task_alloc.geometry.detour import find_detour
        return find_detour(start, end, zones).points

    def _mode(self) -> int | None:
        """The custom mode of the configured action; None: report only."""
        if self._ardupilot:
            mode = {1: FlightMode.RETURN, 2: FlightMode.LAND, 4: FlightMode.BRAKE}.get(
                int(self._parameters.get('FENCE_ACTION')))
        else:
            mode = {2: FlightMode.HOLD, 3: FlightMode.RETURN, 5: FlightMode.LAND}.get(
                int(self._parameters.get('GF_ACTION')))
        return None if mode is None else self._flight.custom_modes[mode]
