# SPDX-License-Identifier: Apache-2.0
"""The zone into which the mission on board leads next: a newer list may not be on board yet.

A zone that is announced in flight, or a leg that begins elsewhere than it was planned, is known to
the bridge before the vehicle has the list that avoids it. A slow link takes many seconds for that.
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from uav_task_alloc.geometry.level_paths import zone_at_heights
from uav_task_alloc.geometry.polyline import point_at
from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.item import Item
from uav_task_alloc.model import Point, ThreatZone

_REACTION = 0.5  # [s] from a position until a hold takes effect
_BRAKING = 2.0  # [m/s^2], less than the defaults of WPNAV_ACCEL (2.5) and MPC_ACC_HOR (3)
_SPARE = 10.0  # [m]
_FREE = 300.0  # [m] of its way that is clear before a hold at a zone ends


class ZoneAhead:
    """Finds the first zone on the way that a vehicle is about to fly.

    Zones count without their margins, which a plan keeps, but no vehicle exactly; none counts
    while the vehicle is inside it, as its way then leads out of it.
    """

    def __init__(self, telemetry: Telemetry, onboard: OnboardMission, profile: Profile) -> None:
        self._telemetry, self._onboard, self._profile = telemetry, onboard, profile
        self._found: tuple[object, ThreatZone | None] = None, None

    def on_board(self, held: bool) -> ThreatZone | None:
        """Find the zone that the mission on board enters before the vehicle could stop.

        Args:
            held: it holds at a zone: a longer part of its way counts.

        Returns:
            The zone; None: none, or the current item is not known.
        """
        telemetry, onboard, progress = self._telemetry, self._onboard, self._onboard.progress
        zones, seq = onboard.list.way_home.zones(), onboard.item_to_set.seq
        if not zones:
            return None
        seq = progress.current if seq is None else seq
        if seq is None or not telemetry.has_position:
            return None
        key = telemetry.position_at, seq, progress.epoch, zones, held
        if self._found[0] != key:
            reach = _FREE if held else _SPARE + _REACTION * telemetry.pace + (
                telemetry.speed**2 / (2.0 * _BRAKING))
            self._found = key, self._first(progress.items[seq:], zones, reach)
        return self._found[1]

    def may_take_upload(self) -> bool:
        """Whether PX4 may fly the uploaded mission from where it is now.

        It was planned from where the vehicle was before the upload, which has flown on by its
        old mission. Where a zone is now between, the upload is not ended.
        """
        telemetry, upload = self._telemetry, self._onboard.latest_upload.unknown
        if not self._profile.atomic:
            return True
        if self._onboard.list.leave_out_detours():
            return False
        zones = self._onboard.list.way_home.zones()
        if upload is None or not zones or not telemetry.has_position or (
                telemetry.mode is not ModeFunction.MISSION):
            return True
        first = [item for item in upload.items[upload.start:] if not item.is_action][:1]
        return self._first(tuple(first), zones, math.inf) is None

    def _first(self, items: tuple[Item, ...], zones: tuple[ThreatZone, ...],
               reach: float) -> ThreatZone | None:
        place = self._telemetry.position
        bare = [replace(zone, margin=0.0) for zone in zones]
        bare = [zone for zone in bare if _across(place, place, (zone,)) is None]
        return next((zone for a, b in _legs(place, items, reach)
                     if (zone := _across(a, b, bare)) is not None), None)


def _legs(place: Point, items: tuple[Item, ...], reach: float) -> Iterator[tuple[Point, Point]]:
    """The legs from a place along items, up to a length [m], or to a return or landing."""
    for item in items:
        if item.position is None and item.is_action:
            continue
        length = 0.0 if item.position is None else math.dist(place, item.position)
        if item.position is None or reach <= 0.0:
            return
        x, y, z = point_at(place, item.position, 1.0 if length <= reach else reach / length)
        yield place, (x, y, z)
        place, reach = item.position, reach - length


def _across(a: Point, b: Point, zones: Iterable[ThreatZone]) -> ThreatZone | None:
    return zone_at_heights(a, b, min(a[2], b[2]), max(a[2], b[2]), zones)
