# SPDX-License-Identifier: Apache-2.0
"""What became of a task on one UAV, as the bridge reports it."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TaskProgress:
    """STARTED, COMPLETED or FAILED, of a task on this UAV."""

    task: str
    event: str
    revision: int
    reason: str = ''
