# SPDX-License-Identifier: Apache-2.0
"""Progress of a task on one UAV, as the bridge publishes it in TaskEvent."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """One event of a task on this UAV."""

    task: str  # id
    event: str  # STARTED, COMPLETED or FAILED
    revision: int  # of the list with that task
    reason: str = ''  # of FAILED
