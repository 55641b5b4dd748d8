# SPDX-License-Identifier: Apache-2.0
"""What the handling of a message raises is logged as its refusal, each reason once."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.conversions.message_limits import cut, printable

_MOST_REFUSALS = 200  # lines of the log


class MessageGuard:
    """Handles messages of any sender, so that none ends the node.

    Args:
        log: writes one line.

    Arguments of methods:
        topic: its name, or what else is handled.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._logged: set[tuple[str, str]] = set()  # topic and reason

    def handle(self, topic: str, handler: Callable[[], None]) -> None:
        """Handle a message.

        Args:
            topic: see the class.
            handler: whatever it raises is logged.
        """
        try:
            handler()
        except Exception as error:
            self.refuse(topic, error)

    def refuse(self, topic: str, error: Exception) -> None:
        """Log why a message is refused, each reason of a topic once.

        Args:
            topic: see the class.
            error: its text is the reason; of another kind than InvalidValue with its name.
        """
        reason = printable(str(error)) if isinstance(error, InvalidValue) else cut(
            f'{type(error).__name__}: {error}')
        refusal = topic, reason
        if len(self._logged) < _MOST_REFUSALS and refusal not in self._logged:
            self._logged.add(refusal)
            self._log(f'{topic}: {reason}: ignored; logged once')
