# SPDX-License-Identifier: Apache-2.0
"""The last status of each task and piece, also of those that the allocator has forgotten."""
from __future__ import annotations

from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import END_STATES, UNKNOWN_TASK, ReportedStatus


class TaskStatuses:
    """The statuses of the newest message, and what is known of tasks that are not in it.

    An allocator forgets tasks that have ended. One that has not ended and is missing is unknown
    to it, as after a restart without a journal.

    Arguments of methods:
        name: id of a task or a piece.
        states: names of TaskStatus constants.
    """

    def __init__(self) -> None:
        self.tasks: dict[str, ReportedStatus] = {}  # of the newest message, by id
        self._pieces: dict[str, ReportedStatus] = {}  # likewise
        self._forgotten: dict[str, ReportedStatus] = {}  # tasks, by id
        self._flown_pieces: dict[str, ReportedStatus] = {}  # forgotten, by id of the piece
        self._again: set[str] = set()  # ids of refused tasks, announced again since then

    def apply(self, line: Line) -> None:
        """Take the statuses of all tasks.

        Args:
            line: of kind `statuses`.
        """
        rows = {row['task']: ReportedStatus(row['state'], row['uav'], row['reason'],
                                            row.get('done', 0), row.get('pieces', 0))
                for row in line['statuses']}
        self._forgotten.update((task, row if row.state in END_STATES else UNKNOWN_TASK)
                               for task, row in self.tasks.items()
                               if row.state in END_STATES or task not in rows)
        for task in rows.keys() & self._forgotten.keys():
            del self._forgotten[task]
        self._flown_pieces = {piece: row for piece, row in self.known_pieces().items()
                              if row.state == 'COMPLETED' and piece not in rows}
        self._again.clear()
        self._pieces = {name: row for name, row in rows.items() if split_piece(name)[1]}
        self.tasks = {name: row for name, row in rows.items() if name not in self._pieces}

    def forget_former(self, task: str) -> bool:
        """Forget a task of the same id that the allocator has forgotten, and its flown pieces.

        Args:
            task: id of one that is announced.

        Returns:
            Whether there was one: what is announced is a new task.
        """
        self._again.add(task)
        if self._forgotten.pop(task, None) is None:
            return False
        self._flown_pieces = {piece: row for piece, row in self._flown_pieces.items()
                              if split_piece(piece)[0] != task}
        return True

    def in_newest(self, name: str) -> ReportedStatus | None:
        """The status in the newest message; None: it is not in it."""
        return self.tasks.get(name) or self._pieces.get(name)

    def is_refused(self, task: str) -> bool:
        """Whether a task was refused, and was not announced again since the newest message."""
        status = self.tasks.get(task)
        return status is not None and status.state == 'REJECTED' and task not in self._again

    def is_forgotten(self, task: str) -> bool:
        """Whether a task was in an earlier message, and is not in the newest."""
        return task in self._forgotten

    def last(self, task: str) -> ReportedStatus | None:
        """The last status of a task, also of one that was forgotten; None: there was none."""
        return self.tasks.get(task) or self._forgotten.get(task)

    def known(self) -> dict[str, ReportedStatus]:
        """The last status of each task, also of those that the allocator has forgotten."""
        return {**self._forgotten, **self.tasks}

    def known_pieces(self) -> dict[str, ReportedStatus]:
        """The last status of each piece, also of flown ones that the allocator has forgotten."""
        return {**self._flown_pieces, **self._pieces}

    def count(self, *states: str) -> int:
        """Number of tasks in one of these states."""
        return sum(status.state in states for status in self.known().values())

    def completed(self) -> set[str]:
        """Ids of the completed tasks and pieces, without pieces that were forgotten."""
        return {name for name, status in {**self.known(), **self._pieces}.items()
                if status.state == 'COMPLETED'}
