# SPDX-License-Identifier: Apache-2.0
"""Whether the position that a vehicle reports is valid: by its estimator, or by its GPS."""
from __future__ import annotations

from collections.abc import Container

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.telemetry_messages import ESTIMATE
from uav_task_alloc.mavlink.transport.codec import Message

_REPORTED = 3.0  # [s] until a vehicle without estimator or GPS reports is trusted


class PositionValidity:
    """The latest reports of the estimator and of the GPS.

    Arguments of methods:
        message: as received.
        now: steady time [s].
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget all: the vehicle was restarted."""
        self._first_at: float | None = None  # [s] of the first position
        self._fix = self._estimates = False  # of its position

    def take_gps(self, message: Message, now: float) -> None:
        """Take a GPS_RAW_INT."""
        self._fix = message.fix_type >= d.GPS_FIX_TYPE_3D_FIX

    def take_estimate(self, message: Message, now: float) -> None:
        """Take an EKF_STATUS_REPORT or ESTIMATOR_STATUS."""
        # EKF_POS_HORIZ_ABS and ESTIMATOR_POS_HORIZ_ABS are the same bit
        self._estimates = bool(message.flags & d.EKF_POS_HORIZ_ABS)

    def is_valid(self, autopilot: int, received_ids: Container[int], now: float) -> bool:
        """Whether a position received now is valid; trusted after _REPORTED without reports.

        Args:
            autopilot: MAV_AUTOPILOT; the estimator report of another one counts for nothing.
            received_ids: ids of the messages that were received since its start.
            now: see above.
        """
        if self._first_at is None:
            self._first_at = now
        if ESTIMATE.get(autopilot) in received_ids:
            return self._estimates
        if d.MAVLINK_MSG_ID_GPS_RAW_INT in received_ids:
            return self._fix
        return now - self._first_at >= _REPORTED
