# SPDX-License-Identifier: Apache-2.0
"""How much of anything one message may bring: whoever sends may be hostile, or broken."""
from __future__ import annotations

from collections.abc import Sequence

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.mission.items import MOST_ITEMS
from uav_task_alloc.model import check_count, check_ros_name

MOST_TASKS = 10_000  # of an announcement
MOST_POINTS = MOST_ITEMS - 2  # of a list, tasks and detour points; home and return are items too
_MOST_NAMES = 100  # capabilities, and UAVs allowed, of one task or UAV
LONGEST_TEXT = 200  # characters of a word or a reason
MOST_VALUE = 1e12  # of a task; sums of them stay numbers


def check_words(place: str, words: Sequence[str]) -> frozenset[str]:
    """Free words as a set: not too many, and none too long, blank or unprintable."""
    check_count(place, words, _MOST_NAMES)
    for word in words:
        if not word.strip() or len(word) > LONGEST_TEXT or not word.isprintable():
            raise InvalidValue(place, word, f'1 to {LONGEST_TEXT} printable characters')
    return frozenset(words)


def check_ros_names(place: str, names: Sequence[str]) -> frozenset[str]:
    """ROS names as a set, not too many."""
    check_count(place, names, _MOST_NAMES)
    return frozenset(check_ros_name(place, name) for name in names)


def printable(text: str) -> str:
    """Free text as one line for people; what cannot be printed is a question mark."""
    return ''.join(c if c.isprintable() else '?' for c in text)


def cut(text: str) -> str:
    """Free text as one short line for people."""
    return printable(text[:LONGEST_TEXT]) + ('...' if len(text) > LONGEST_TEXT else '')
