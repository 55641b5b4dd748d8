# SPDX-License-Identifier: Apache-2.0
"""Logs once each that simulated time is missing, stands still, jumps or goes back."""
from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.clock import Clock
    from rclpy.node import Node

_PERIOD = 0.2  # [s] between two comparisons
_PATIENCE = 5.0  # [s] of steady time until a clock that does not move is logged
_FASTEST = 200.0  # times real time; a step that is longer is a jump
_STEP = 5.0  # [s] that any two readings may be apart


class ClockWatch:
    """Compares a ROS clock with the steady clock.

    Arguments of methods:
        ros: time of the ROS clock [s]; 0: nothing has published /clock yet.
        steady: [s].
    """

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None  # ROS and steady time of the last change
        self._still = False  # and it was logged

    def update(self, ros: float, steady: float) -> str:
        """Return what is to be logged as a warning; '' where all is well."""
        if self._last is None:
            self._last = ros, steady
        before, since = self._last
        if ros == before:
            if self._still or steady - since < _PATIENCE:
                return ''
            self._still = True
            return ('use_sim_time is true, and nothing publishes /clock: waiting for it'
                    if ros == 0.0 else
                    f'/clock has stood still at {ros:.1f} s for {steady - since:.0f} s: all '
                    'times wait for it')
        self._last, still = (ros, steady), self._still
        self._still = False
        if ros < before:
            return f'/clock went back by {before - ros:.1f} s, to {ros:.1f} s'
        if before > 0.0 and ros - before > _STEP + _FASTEST * (steady - since):
            return f'/clock jumped forward by {ros - before:.1f} s, to {ros:.1f} s'
        return f'/clock runs again after {steady - since:.0f} s' if still else ''


class SteadyTime:
    """A time that never goes back, from a ROS clock that may.

    After a step back it goes on from where it was: what was recorded before stays before.
    """

    def __init__(self) -> None:
        self.offset = 0.0  # [s] added to the ROS clock
        self._last = 0.0

    def at(self, ros: float) -> float:
        """Time [s] of a reading `ros` [s] of the clock."""
        self.offset = max(self.offset, self._last - ros)
        self._last = ros + self.offset
        return self._last


def is_simulated(node: Node) -> bool:
    """Return whether a node lives by /clock.

    Args:
        node: whose parameter use_sim_time is read.

    Returns:
        Its present value.
    """
    return bool(node.get_parameter('use_sim_time').value)


def ros_time(node: Node) -> float:
    """Return the time of a node's clock.

    Args:
        node: whose clock is read.

    Returns:
        [s]; 0 while it waits for the first /clock.
    """
    return float(node.get_clock().now().nanoseconds) * 1e-9


def steady_clock() -> Clock:
    """Return a clock for timers that run while simulated time stands still.

    Returns:
        The monotonic clock of this machine.
    """
    from rclpy.clock import Clock, ClockType  # not above: tests import this without ROS
    return Clock(clock_type=ClockType.STEADY_TIME)


def watch_clock(node: Node, warn: Callable[[str], object]) -> ClockWatch:
    """Log troubles of simulated time while the node lives by it.

    Args:
        node: whose clock is watched; it spins.
        warn: logs a line.

    Returns:
        The watch.
    """
    watch = ClockWatch()

    def on_timer() -> None:
        if is_simulated(node):
            text = watch.update(ros_time(node), time.monotonic())
            if text:
                warn(text)

    node.create_timer(_PERIOD, on_timer, clock=steady_clock())
    return watch
