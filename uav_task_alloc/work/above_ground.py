# SPDX-License-Identifier: Apache-2.0
"""Work whose heights are above the ground: its points and ways in the ENU frame."""
from __future__ import annotations

from dataclasses import replace

from uav_task_alloc.model import Point, Task
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.values import Geometry

_TOLERANCE = 0.1, 2.0  # share of the height above ground, and at least [m], that ways may be off


def above_ground_task(given: Geometry, terrain: Terrain) -> Task:
    """The task of work with its position in the ENU frame.

    Args:
        given: with heights above ground.
        terrain: the ground.

    Returns:
        The same task at that height.

    Raises:
        TerrainError: no data.
    """
    position, = terrain.raised([given.task.position], given.task.position[2])
    return replace(given.task, position=position)


def following_ways(given: Geometry, ways: list[tuple[Point, ...]],
                   terrain: Terrain) -> list[tuple[Point, ...]]:
    """Ways that follow the ground.

    Args:
        given: the work.
        ways: x, y [m] ENU and z [m] above the ground.
        terrain: the ground.

    Returns:
        [m] ENU, each with points added where the ground bends.

    Raises:
        TerrainError: no data.
    """
    lowest = min(z for way in ways for _, _, z in way)
    share, least = _TOLERANCE
    return [terrain.followed(way, max(least, share * lowest)) for way in ways]
