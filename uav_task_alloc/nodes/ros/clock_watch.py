# SPDX-License-Identifier: Apache-2.0
"""Simulated time that is missing, stands still, jumps or goes back; machines with other clocks."""
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
_SEVERAL, _RECENT = 3, 10.0  # messages in a row, and [s] since the last, that make an offset


class ClockWatch:
    """Compares a ROS clock with the steady clock.

    Arguments of methods:
        ros: time of the ROS clock [s]; 0: nothing has published /clock yet.
        steady: [s].
    """

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None  # ROS and steady time of the last change
        self.still = False  # it has not moved for a while, and that was logged

    def update(self, ros: float, steady: float) -> str:
        """Return what is to be logged as a warning; '' where all is well."""
        if self._last is None:
            self._last = ros, steady
        before, since = self._last
        if ros == before:
            if self.still or steady - since < _PATIENCE:
                return ''
            self.still = True
            return self.warning(steady)
        self._last, still = (ros, steady), self.still
        self.still = False
        if ros < before:
            return f'/clock went back by {before - ros:.1f} s, to {ros:.1f} s'
        if before > 0.0 and ros - before > _STEP + _FASTEST * (steady - since):
            return f'/clock jumped forward by {ros - before:.1f} s, to {ros:.1f} s'
        runs = 'runs again' if before > 0.0 else 'has begun'
        return f'/clock {runs} after {steady - since:.0f} s' if still else ''

    def warning(self, steady: float) -> str:
        """Return that the clock stands still, and for how long; '' while it runs.

        Args:
            steady: monotonic clock [s].
        """
        if not self.still or self._last is None:
            return ''
        ros, since = self._last
        return ('use_sim_time is true, and nothing publishes /clock: waiting for it'
                if ros == 0.0 else
                f'/clock has stood still at {ros:.1f} s for {steady - since:.0f} s: all '
                'times wait for it')


class ClockOffsets:
    """Compares the stamps of messages with the clock of the node that receives them.

    Args:
        what: the messages of a sender, as in `reports`.

    Arguments of methods:
        steady: [s].
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._far: dict[str, tuple[int, float, float]] = {}  # count, offset [s], steady time [s]

    def add(self, sender: str, stamp: float, clock: float, steady: float) -> None:
        """Compare the stamp of a message with the clock of the node.

        Args:
            sender: of the message.
            stamp: [s] of the message; 0: it has none.
            clock: [s] of the node; 0: it has not begun.
            steady: see the class.
        """
        offset = stamp - clock
        if stamp <= 0.0 or clock <= 0.0 or abs(offset) <= _STEP:
            self._far.pop(sender, None)
        else:
            self._far[sender] = self._far.get(sender, (0, 0.0, 0.0))[0] + 1, offset, steady

    def warning(self, steady: float) -> str:
        """Return whose clock is another one; '' where none is, or nobody has sent for a while."""
        found = sorted((sender, offset) for sender, (count, offset, since) in self._far.items()
                       if count >= _SEVERAL and steady - since <= _RECENT)
        if not found:
            return ''
        sender, offset = max(found, key=lambda each: abs(each[1]))
        more = f' (and those of {len(found) - 1} more)' if len(found) > 1 else ''
        return (f'{self._what} of {sender}{more} are stamped {abs(offset):.0f} s '
                f'{"after" if offset > 0.0 else "before"} the clock of this node: expected '
                'machines whose clocks agree')


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


def _several_publishers(node: Node) -> str:
    """The end of a line: which nodes publish /clock, where they are several."""
    names = sorted(f'{each.node_namespace.rstrip("/")}/{each.node_name}'
                   for each in node.get_publishers_info_by_topic('/clock'))
    return f'; it is published by {", ".join(names)}: expected one node' if names[1:] else ''


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
        if not is_simulated(node):
            watch.still = False
            return
        text = watch.update(ros_time(node), time.monotonic())
        if text:
            warn(text + _several_publishers(node))

    node.create_timer(_PERIOD, on_timer, clock=steady_clock())
    return watch
