# SPDX-License-Identifier: Apache-2.0
"""Fences and rally points as simulated autopilots store them, and the shapes that they enforce."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.geometry.polygon import XY, contains_point
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.sim.stored_item import POSITION_FRAMES, Refusal, StoredItem

FENCE_TYPE = dialect.MAV_MISSION_TYPE_FENCE
RALLY_TYPE = dialect.MAV_MISSION_TYPE_RALLY
CAPACITIES = {'ardupilot': {FENCE_TYPE: 70, RALLY_TYPE: 42},  # items
              'px4': {FENCE_TYPE: 64, RALLY_TYPE: 32}}
_CIRCLES = {dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
            dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION}
_POLYGONS = {dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
             dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION}
_INCLUSIONS = {dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
               dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION}
_RALLY_FRAMES = {dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}


@dataclass(frozen=True, slots=True)
class EnforcedShape:
    """A circle or polygon that a vehicle stays in or out of, in plan view."""

    corners: tuple[XY, ...]  # [m] ENU; of a circle its centre
    radius: float  # [m]; 0: a polygon
    inclusion: bool

    def breached_by(self, point: Sequence[float]) -> bool:
        """Whether a vehicle at this point [m] ENU is on the wrong side."""
        place = point[0], point[1]
        inside = (math.dist(place, self.corners[0]) < self.radius if self.radius > 0.0
                  else contains_point(self.corners, place))
        return inside is not self.inclusion

    def column(self, name: str, margin: float) -> ThreatZone:
        """The shape with a margin [m] as a zone without floor and ceiling."""
        if self.radius > 0.0:
            return ThreatZone.cylinder(name, self.corners[0], self.radius, margin=margin)
        return ThreatZone.polygon(name, self.corners, margin=margin)


def stored_geo_item(item: StoredItem, mission_type: int, ardupilot: bool) -> StoredItem | Refusal:
    """Return the copy that an autopilot keeps of an item of a fence or of rally points.

    ArduPilot keeps neither frame nor height of a fence, and takes rally points above home only.

    Args:
        item: as sent.
        mission_type: MAV_MISSION_TYPE of the upload.
        ardupilot: else PX4.

    Returns:
        The copy, or why it is refused.
    """
    if mission_type == FENCE_TYPE:
        if item.frame not in POSITION_FRAMES:
            return Refusal(dialect.MAV_MISSION_UNSUPPORTED_FRAME)
        if item.command not in _CIRCLES | _POLYGONS | {dialect.MAV_CMD_NAV_FENCE_RETURN_POINT}:
            return Refusal(dialect.MAV_MISSION_UNSUPPORTED)
        if item.command in _POLYGONS and item.p1 < 3.0 and not ardupilot:
            return Refusal(dialect.MAV_MISSION_ERROR)
        frame, z = (dialect.MAV_FRAME_GLOBAL, 0.0) if ardupilot else (item.frame, item.z)
        return StoredItem(frame, item.command, item.p1, 0.0, 0.0, 0.0, item.x, item.y, z)
    if item.command != dialect.MAV_CMD_NAV_RALLY_POINT:
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED)
    if item.frame not in (_RALLY_FRAMES if ardupilot else POSITION_FRAMES):
        return Refusal(dialect.MAV_MISSION_UNSUPPORTED_FRAME)
    if not ardupilot:
        return item
    return StoredItem(dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, item.command, 0.0, 0.0, 0.0, 0.0,
                      item.x, item.y, float(math.trunc(item.z)))


def complete_polygons(items: Sequence[StoredItem]) -> bool:
    """Whether the vertices of each polygon follow each other, as many as they say (ArduPilot).

    Args:
        items: of an upload, by seq.

    Returns:
        False where one is missing.
    """
    at = 0
    while at < len(items):
        count = round(items[at].p1) if items[at].command in _POLYGONS else 1
        part = items[at:at + count]
        if len(part) < count or (items[at].command in _POLYGONS and (count < 3 or any(
                (item.command, item.p1) != (part[0].command, part[0].p1) for item in part))):
            return False
        at += count
    return True


def enforced_shapes(items: Sequence[StoredItem], places: Sequence[XY],
                    circle_spoils: bool) -> list[EnforcedShape]:
    """The shapes of a stored fence.

    Args:
        items: of the store.
        places: of the items, ENU [m].
        circle_spoils: PX4 (Geofence::_updateFence) reads polygons after a circle wrongly: they
            are not enforced.

    Returns:
        In the order of the items.
    """
    shapes, at, spoilt = [], 0, False
    while at < len(items):
        command, inclusion = items[at].command, items[at].command in _INCLUSIONS
        count = round(items[at].p1) if command in _POLYGONS else 1
        if command in _CIRCLES:
            shapes.append(EnforcedShape((places[at],), items[at].p1, inclusion))
            spoilt = circle_spoils
        elif command in _POLYGONS and not spoilt:
            shapes.append(EnforcedShape(tuple(places[at:at + count]), 0.0, inclusion))
        at += max(1, count)
    return shapes
