# SPDX-License-Identifier: Apache-2.0
"""What a bridge that is asked to exit waits for, and what it logs about the UAVs it leaves."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.mavlink.gcs.ground_station import VehicleSession

UPLOAD_TIMEOUT = 10.0  # [s] that a running upload is waited for


class BridgeShutdown:
    """State from the first request to exit on; `requested_at` [s] is None before.

    Arguments of methods:
        fleet: all vehicles.
        now: steady time [s].
    """

    def __init__(self) -> None:
        self.requested_at: float | None = None

    def waits(self, fleet: Iterable[VehicleSession], now: float) -> bool:
        """Whether a UAV is held for an upload; False once UPLOAD_TIMEOUT is over.

        Not for one whose link is lost.
        """
        self.requested_at = now if self.requested_at is None else self.requested_at
        return now - self.requested_at < UPLOAD_TIMEOUT and any(held_for_upload(
            session for session in fleet if not session.executor.telemetry.link.lost(now)))

    @staticmethod
    def warnings(fleet: Iterable[VehicleSession]) -> list[str]:
        """Which UAVs are airborne and what they do without the bridge; one line for each case."""
        airborne = [session for session in fleet if session.executor.telemetry.airborne]
        held = held_for_upload(airborne)
        flying = [session.uav_id for session in airborne if session.uav_id not in held]
        lines = []
        if flying:
            lines.append(f'exits while airborne: {", ".join(flying)}; each continues its onboard '
                         'mission')
        if held:
            lines.append(f'exits while held in the air for a new list: {", ".join(held)}; a pilot '
                         'or the next bridge has to start the mission again')
        return lines


def held_for_upload(fleet: Iterable[VehicleSession]) -> list[str]:
    """Return the UAVs that are held in the air for an upload.

    Args:
        fleet: all vehicles.

    Returns:
        Ids.
    """
    return [session.uav_id for session in fleet
            if session.executor.watch.replacing_since is not None]
