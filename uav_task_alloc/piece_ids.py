# SPDX-License-Identifier: Apache-2.0
"""Ids of the pieces of a task: `<task id>#<number>`, numbered from 1; without # the whole task."""
from __future__ import annotations

_MARK = '#'  # in no id that is announced


def piece_id(task_id: str, piece: int) -> str:
    """Return the id of a piece.

    Args:
        task_id: of the whole task.
        piece: from 1; 0: the whole task.

    Returns:
        `task_id` itself for 0.
    """
    return f'{task_id}{_MARK}{piece}' if piece else task_id


def split_piece(full_id: str) -> tuple[str, int]:
    """Return the id of the whole task, and the number of the piece.

    Args:
        full_id: as `piece_id` returns it.

    Returns:
        Number 0 where the id is that of a whole task.
    """
    task_id, _, number = full_id.rpartition(_MARK)
    if task_id and number.isascii() and number.isdigit():
        return task_id, int(number)
    return full_id, 0
