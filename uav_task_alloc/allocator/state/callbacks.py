# SPDX-License-Identifier: Apache-2.0
"""The functions that the parts of the world are given instead of the world itself."""
from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

RequestReplan = Callable[[str, float], None]  # (trigger, now [s] of a steady clock)


class Note(Protocol):
    """Put a line into the log, at the level `info` unless another is named."""

    def __call__(self, text: str, warning: bool = False, debug: bool = False) -> None: ...
