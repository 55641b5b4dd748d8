# SPDX-License-Identifier: Apache-2.0
"""Keeps an allocator's world in the journal; without a disk the allocator runs on and says so."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.restore import Saved, saved
from uav_task_alloc.errors import JournalError
from uav_task_alloc.journal import Journal

RETRY = 1.0  # [s] between two tries on a disk that refused


class Keeper:
    """`trouble` is what is wrong with the journal, '' while all is well."""

    def __init__(self, state_dir: str, complain: Callable[[str], object]) -> None:
        self.trouble = ''
        self._complain = complain
        self._journal: Journal | None = None
        self._retry = 0.0  # [s]
        self.saved = Saved()
        if not state_dir:
            return
        try:
            self._journal = Journal(state_dir)
            self.saved = saved(self._journal.load())
        except JournalError as error:
            self.close()
            self._say(f'{error}; nothing is kept until a restart with a good one')

    def save(self, allocator: Allocator, now: float, most: int | None = None) -> bool:
        """Everything new, or `most` tasks of it, is on disk when this returns, or `trouble`
        says why not; False: there is more to save before anything is told.
        """
        if self._journal is None:
            return allocator.written()
        rows = allocator.rows(most)
        if not rows or (self.trouble and now < self._retry):
            return True
        try:
            self._journal.put(rows)
        except JournalError as error:
            self._retry = now + RETRY
            self._say(f'{error}; tried again every {RETRY:g} s')
            return True
        self.trouble = ''
        return allocator.written(rows)

    def close(self) -> None:
        """Let go of the file."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def _say(self, trouble: str) -> None:
        if trouble != self.trouble:
            self._complain(trouble)
        self.trouble = trouble
