# SPDX-License-Identifier: Apache-2.0
"""A node's log by the name of a level; troubles that begin and end are logged once each."""
from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from uav_task_alloc.nodes.conversions.message_limits import printable


class LeveledLog:
    """Logs at `debug`, `info`, `warning` or `error`.

    rclpy refuses a call site that logs at several levels, so each level has its own.

    Args:
        node: whose logger is used.
    """

    def __init__(self, node: Node) -> None:
        logger = node.get_logger()
        self.levels: dict[str, Callable[[str], object]] = {
            'debug': lambda text: logger.debug(text),
            'info': lambda text: logger.info(text),
            'warning': lambda text: logger.warning(text),
            'error': lambda text: logger.error(text)}
        self._troubles: dict[str, str] = {}  # logged last, by what they are about

    def write(self, level: str, text: str) -> None:
        """Log one line.

        Args:
            level: 'info', 'warning' or 'error'.
            text: of any sender; made printable.
        """
        self.levels[level](printable(text))

    def report_trouble(self, name: str, trouble: str, level: str = 'error') -> None:
        """Log a trouble when it begins or changes, and its end.

        Args:
            name: of a link or another part that fails and recovers.
            trouble: what is wrong; '' where it works.
            level: of the trouble; its end is logged at `info`.
        """
        if self._is_new(name, trouble):
            self.write(level if trouble else 'info', f'{name}: {trouble or "works"}')

    def report_refusal(self, topic: str, reason: str) -> None:
        """Log why a message of a topic is refused, unless the last one was for that reason too.

        Args:
            topic: its name.
            reason: why it is refused; '' for a valid message.
        """
        if self._is_new(topic, reason) and reason:
            self.write('warning', f'{topic}: {reason}: ignored')

    def refusal(self, topic: str) -> str:
        """Return why the last message of a topic was refused.

        Args:
            topic: its name, as reported.

        Returns:
            '' where it was valid, or none has come.
        """
        return self._troubles.get(topic, '')

    def _is_new(self, name: str, text: str) -> bool:
        new = text != self._troubles.get(name, '')
        self._troubles[name] = text
        return new
