# SPDX-License-Identifier: Apache-2.0
"""What the bridge has to say to the people who run it: lines for the log."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OperatorNote:
    """Something a human should read."""

    level: str  # 'info', 'warning', 'error'
    text: str
