# SPDX-License-Identifier: Apache-2.0
"""Holds a UAV in flight while another node reports its id, too: two sources command it then."""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.mission_executor import MissionExecutor
from uav_task_alloc.mavlink.gcs.operator_hold import SHARED_ID, HoldRequest
from uav_task_alloc.mavlink.gcs.status import UavMode, mode_of

_GOES_ON = (UavMode.STANDBY, UavMode.RETURNING, UavMode.LANDING)  # ends on the ground


def hold_where_shared(executor: MissionExecutor, shared: str, now: float) -> None:
    """Hold a UAV in flight while its id is shared, and let it go on afterwards.

    It stays with whoever has the authority; one that returns or lands does so.

    Args:
        executor: of the UAV.
        shared: who reports it, too; '': nobody.
        now: steady time [s].
    """
    holds = executor.holds
    if not shared:
        holds.request(HoldRequest(SHARED_ID, False), now)
    elif not holds.for_shared_id and mode_of(executor) not in _GOES_ON:
        holds.request(HoldRequest(SHARED_ID, True, shared), now)
