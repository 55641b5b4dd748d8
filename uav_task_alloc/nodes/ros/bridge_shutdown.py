# SPDX-License-Identifier: Apache-2.0
"""What a bridge that is asked to end waits for, and what it says of the UAVs it leaves."""
from __future__ import annotations

from collections.abc import Iterable

from uav_task_alloc.mavlink.gcs.ground_station import VehicleSession

LONGEST = 10.0  # [s] that a swap under way is waited for


class BridgeShutdown:
    """From the first request to end on; `asked` is its time [s], None before."""

    def __init__(self) -> None:
        self.asked: float | None = None

    def waits(self, fleet: Iterable[VehicleSession], now: float) -> bool:
        """Whether a UAV is held for an upload whose end is waited for, at most LONGEST."""
        self.asked = now if self.asked is None else self.asked
        return now - self.asked < LONGEST and any(swapping(fleet))

    @staticmethod
    def words(fleet: Iterable[VehicleSession]) -> list[str]:
        """Who is in the air and what becomes of them, for the log; nothing where nobody is."""
        airborne = [session for session in fleet if session.executor.telemetry.airborne]
        held = swapping(airborne)
        flying = [session.uav_id for session in airborne if session.uav_id not in held]
        said = []
        if flying:
            said.append(f'ends while airborne: {", ".join(flying)}; each goes on with what is on '
                        'board')
        if held:
            said.append(f'ends while held in the air for a new list: {", ".join(held)}; a pilot '
                        'or the next bridge has to start the mission again')
        return said


def swapping(fleet: Iterable[VehicleSession]) -> list[str]:
    """UAVs that are held for an upload."""
    return [session.uav_id for session in fleet if session.executor.watch.swap_at is not None]
