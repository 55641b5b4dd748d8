# SPDX-License-Identifier: Apache-2.0
"""How much one message may hold, so that a faulty or hostile publisher cannot exhaust a node.

The limits of zones are in zone_codec.py, where recordings are read as well.
"""
from __future__ import annotations

from collections.abc import Sequence

from uav_task_alloc.checks import check_count, check_ros_name
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.mission.items import MOST_ITEMS

MOST_TASKS = 10_000  # of an announcement
MOST_POINTS = MOST_ITEMS - 2  # of a list, tasks and detour points; home and return are items too
MOST_ACTIONS = 20  # of a task
MOST_KEYS = 10  # of an action
MOST_VALUE = 1e12  # of a task; sums of them stay exact enough
_MOST_NAMES = 100  # capabilities, and allowed UAVs, of one task or UAV
_LONGEST_TEXT = 200  # characters of a capability or a reason


def check_words(place: str, words: Sequence[str]) -> frozenset[str]:
    """Capabilities as a set.

    Raises:
        InvalidValue: there are too many, or one is blank, too long or not printable.
    """
    check_count(place, words, _MOST_NAMES)
    for word in words:
        if not word.strip() or len(word) > _LONGEST_TEXT or not word.isprintable():
            raise InvalidValue(place, word, f'1 to {_LONGEST_TEXT} printable characters')
    return frozenset(words)


def check_ros_names(place: str, names: Sequence[str]) -> frozenset[str]:
    """ROS names as a set.

    Raises:
        InvalidValue: there are too many, or one is no ROS name.
    """
    check_count(place, names, _MOST_NAMES)
    return frozenset(check_ros_name(place, name) for name in names)


def printable(text: str) -> str:
    """Return a text in one line; each character that is not printable becomes a question mark.

    Args:
        text: from any sender.

    Returns:
        Of the same length.
    """
    return ''.join(c if c.isprintable() else '?' for c in text)


def cut(text: str) -> str:
    """Return a text in one line, short enough for logs and reasons.

    Args:
        text: from any sender.

    Returns:
        The printable text; after 200 characters it ends with `...`.
    """
    return printable(text[:_LONGEST_TEXT]) + ('...' if len(text) > _LONGEST_TEXT else '')
