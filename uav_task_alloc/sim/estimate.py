# SPDX-License-Identifier: Apache-2.0
"""The position estimate of a simulated vehicle, which may jump or be off by a glitch."""
from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect

from uav_task_alloc.model import Point
from uav_task_alloc.sim.flight import VehicleFlight

# [m] ENU, in turn while the first estimate settles
_JUMPS: tuple[Point, ...] = ((35.0, -20.0, 4.0), (-25.0, 30.0, -6.0), (15.0, 25.0, 3.0),
                             (-40.0, -10.0, 8.0))
_JUMP_PERIOD = 0.5  # [s]
_NO_OFFSET: Point = (0.0, 0.0, 0.0)
# the bits of EKF_STATUS_FLAGS and of ESTIMATOR_STATUS_FLAGS are the same up to 512
_NO_FIX = dialect.EKF_ATTITUDE | dialect.EKF_VELOCITY_VERT | dialect.EKF_POS_VERT_ABS
_FIX = (_NO_FIX | dialect.EKF_VELOCITY_HORIZ | dialect.EKF_POS_HORIZ_REL
        | dialect.EKF_POS_HORIZ_ABS | dialect.EKF_PRED_POS_HORIZ_REL
        | dialect.EKF_PRED_POS_HORIZ_ABS)


class Estimate:
    """Offset of the reported from the true position, and the flags of the estimator."""

    def __init__(self, flight: VehicleFlight) -> None:
        self._flight = flight
        self.reboot()

    def reboot(self) -> None:
        """End any glitch."""
        self._glitch, self._glitch_until = _NO_OFFSET, 0.0

    def glitch(self, offset: Point, seconds: float) -> None:
        """Shift the satellite position by `offset` [m] ENU for some `seconds`."""
        self._glitch, self._glitch_until = offset, self._flight.now + seconds

    @property
    def glitching(self) -> bool:
        """Whether the satellite position is shifted."""
        return self._flight.now < self._glitch_until

    @property
    def satellite_offset(self) -> Point:
        """Offset of GPS_RAW_INT, ENU [m]."""
        return self._glitch if self.glitching else _NO_OFFSET

    @property
    def offset(self) -> Point:
        """Offset of the estimated position, ENU [m]."""
        boot, glitch = self._flight.boot, self.satellite_offset
        if not boot.settling:
            return glitch
        x, y, z = _JUMPS[int(boot.elapsed / _JUMP_PERIOD) % len(_JUMPS)]
        return glitch[0] + x, glitch[1] + y, glitch[2] + z

    @property
    def status_flags(self) -> int:
        """The bits that EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS have in common."""
        if self._flight.positioned and 'ekf' not in self._flight.failsafes:
            return int(_FIX)
        return int(_NO_FIX)
