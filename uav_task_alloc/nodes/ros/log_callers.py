# SPDX-License-Identifier: Apache-2.0
"""Finds the file that logs a line by its frame; rclpy searches all modules for its source."""
from __future__ import annotations

import inspect
from types import FrameType, SimpleNamespace

from rclpy.impl import rcutils_logger


def name_callers_by_frames() -> None:
    """Let rclpy take the file name of a caller of its logger from the frame.

    rclpy calls `inspect.getframeinfo`, which reads source files too, and uses the name only. The
    first line of a process takes 1 ms of CPU instead of 35. Another rclpy is left as it is.
    """
    if getattr(rcutils_logger, 'inspect', None) is inspect:
        rcutils_logger.inspect = SimpleNamespace(  # type: ignore[attr-defined]
            currentframe=inspect.currentframe, getframeinfo=_file_of)


def _file_of(frame: FrameType) -> SimpleNamespace:
    return SimpleNamespace(filename=frame.f_code.co_filename)
