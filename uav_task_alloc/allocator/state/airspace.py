# SPDX-License-Identifier: Apache-2.0
"""The no-fly zones in force, with what is outside of the fence area, and the paths around them."""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from uav_task_alloc.allocator.state.ground import area_zones
from uav_task_alloc.allocator.state.safe_paths import MakeSafePaths, SafePaths
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.params import AllocatorParams


class Airspace:
    """Where the fleet may fly.

    Args:
        zones: that the journal restored.
        params: the present parameters; the area is that of the first ones.
        make_safe_paths: makes the paths around zones; called when they are first needed.

    Attributes:
        zones: in force, by id.
    """

    def __init__(self, zones: Iterable[ThreatZone], params: Callable[[], AllocatorParams],
                 make_safe_paths: MakeSafePaths) -> None:
        self.zones = {zone.id: zone for zone in zones}
        self._outside, self._params = area_zones(params()), params
        self._make_safe_paths = make_safe_paths
        self._paths: SafePaths | None = None
        self._paths_params = params()

    def replace(self, zones: Iterable[ThreatZone], kept: Collection[str]) -> list[str]:
        """Put other zones in force.

        Args:
            zones: the whole set.
            kept: ids of zones that stay as they are.

        Returns:
            Ids of the zones that changed, came or went.
        """
        before = self.zones
        new = {zone_id: zone for zone_id, zone in before.items() if zone_id in kept}
        new.update((zone.id, zone) for zone in zones)
        changed = [i for i in {**before, **new} if before.get(i) != new.get(i)]
        if changed:
            self.zones, self._paths = new, None
        return changed

    def no_fly_zones(self) -> tuple[ThreatZone, ...]:
        """Return the zones in force, and those that cover what is outside of `fence_area`."""
        return (*self.zones.values(), *self._outside)

    def paths(self) -> SafePaths:
        """Return the paths around the zones in force."""
        params = self._params()
        if self._paths is None or self._paths_params is not params:
            self._paths_params = params
            self._paths = self._make_safe_paths(self.no_fly_zones(), params)
        return self._paths
