# SPDX-License-Identifier: Apache-2.0
"""Lengths of the safe ways between numbered points, as kernels want them."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.model import Leg, ThreatZone


class Pairs(NamedTuple):
    """What `length` needs inside a kernel; made by Distances, opaque to everybody else."""

    xyz: NDArray[np.float64]  # (n, 3) [m]


@numba.njit(cache=True, nogil=True)
def length(pairs: Pairs, i: int, j: int) -> float:  # pragma: no cover (compiled)
    """Length [m] of the shortest safe way from point i to point j; inf: there is none."""
    dx = pairs.xyz[i, 0] - pairs.xyz[j, 0]
    dy = pairs.xyz[i, 1] - pairs.xyz[j, 1]
    dz = pairs.xyz[i, 2] - pairs.xyz[j, 2]
    return float(np.sqrt(dx * dx + dy * dy + dz * dz))


class Distances:
    """Detour lengths between points 0..n-1; asymmetric only where a point lies inside a zone."""

    def __init__(self, points: NDArray[np.float64], zones: Sequence[ThreatZone] = (), *,
                 clearance: float = 0.0, altitude_min: float = -np.inf,
                 altitude_max: float = np.inf) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self.pairs = Pairs(self.points)

    def length(self, i: int, j: int) -> float:
        """Length [m] of the way from i to j; inf where there is none."""
        return float(length(self.pairs, i, j))

    def leg(self, i: int, j: int) -> Leg:
        """The way from i to j with its detour points."""
        return Leg((), self.length(i, j))
