# SPDX-License-Identifier: Apache-2.0
"""Zones over what is outside of `fence_area`: plans stay inside of it as they avoid zones."""
from __future__ import annotations

from uav_task_alloc.geometry.fence_area import area_corners, outside_rings
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.zone_codec import OUTSIDE_AREA

_REACH = 1e6  # [m] from the area: farther than any UAV would fly around them


def zones_outside(params: AllocatorParams) -> tuple[ThreatZone, ...]:
    """Return zones over all that is outside of the area that the fleet stays in.

    Args:
        params: with `fence_area` and the origin.

    Returns:
        Two, at all heights; none where no area is given.

    Raises:
        InvalidValue: the area is invalid.
    """
    corners = area_corners(params.fence_area, Origin(
        params.origin__latitude, params.origin__longitude, params.origin__altitude_amsl))
    if not corners:
        return ()
    west, east = outside_rings(corners, _REACH)
    return (ThreatZone.polygon(f'{OUTSIDE_AREA} (west)', west),
            ThreatZone.polygon(f'{OUTSIDE_AREA} (east)', east))
