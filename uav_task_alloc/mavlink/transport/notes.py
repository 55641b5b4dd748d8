# SPDX-License-Identifier: Apache-2.0
"""Log lines for the operators of the bridge."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OperatorNote:
    """One log line."""

    level: str  # 'info', 'warning', 'error'
    text: str  # a sentence
