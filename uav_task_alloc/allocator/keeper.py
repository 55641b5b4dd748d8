# SPDX-License-Identifier: Apache-2.0
"""Keeps an allocator's world in the journal; without a disk the allocator runs on and says so.

What was accepted while a disk refused stays in memory, and is written when the disk is back. A
damaged file is set aside under another name and a new one begun; one of a newer version, or of
another process, is left alone.
"""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.restore import saved
from uav_task_alloc.errors import JournalCorrupt, JournalError, JournalForeign
from uav_task_alloc.journal import Journal, Row, read_copy, set_aside

RETRY = 1.0  # [s] between two tries on a disk that refused
GIVEN_UP = 'nothing is kept until a restart'


class Keeper:
    """`trouble` is what is wrong with the journal, '' while all is well."""

    def __init__(self, state_dir: str, complain: Callable[[str], object]) -> None:
        self._dir, self._complain = state_dir, complain
        self._journal: Journal | None = None
        self._now_wrong = ''  # until it is mended
        self._lost = ''  # what the last life left that cannot be read: told until the next one
        self._given_up = not state_dir
        self._retry = 0.0  # [s]
        self.saved = saved(self._begin() if state_dir else [])
        if self.saved.bad:
            self._lose(f'{len(self.saved.bad)} left out: {self.saved.bad[0]}')

    @property
    def trouble(self) -> str:
        """Everything an operator should know of the journal."""
        return '; '.join(filter(None, (self._now_wrong, self._lost)))

    def _begin(self) -> list[Row]:
        """Open the journal, or at least read it."""
        try:
            return self._open()
        except JournalForeign as error:
            self._give_up(str(error))
        except JournalError as error:
            self._say(f'{error}; tried again every {RETRY:g} s')
            try:
                return read_copy(self._dir)
            except JournalError as worse:
                self._lose(str(worse))
        return []

    def _open(self) -> list[Row]:
        try:
            self._journal = Journal(self._dir)
            return self._journal.load()
        except JournalCorrupt as error:
            self.close()
            self._lose(f'{error}; set aside as {set_aside(self._dir).name}, a new one is kept')
            self._journal = Journal(self._dir)
            return []

    def save(self, allocator: Allocator, now: float, most: int | None = None) -> bool:
        """Everything new, or `most` tasks of it, is on disk when this returns, or `trouble`
        says why not; False: there is more to save before anything is told.
        """
        if self._given_up:
            return allocator.written()
        if self._now_wrong and now < self._retry:
            return True
        rows = allocator.rows(most)
        if not rows:
            return True
        try:
            rows = self._write(rows, allocator)
        except JournalForeign as error:
            self._give_up(str(error))
        except JournalError as error:
            self._retry = now + RETRY
            self._say(f'{error}; tried again every {RETRY:g} s')
        else:
            self._say('')
            return allocator.written(rows)
        return True

    def _write(self, rows: list[Row], allocator: Allocator) -> list[Row]:
        """Returns what is on disk now: these rows, or the whole world where nothing was."""
        if self._journal is None:
            self._take_late(self._open(), allocator)
            allocator.nothing_written()
            rows = allocator.rows()
        assert self._journal is not None
        try:
            self._journal.put(rows)
        except JournalError as error:
            if isinstance(error, JournalCorrupt) or not self._journal.in_place():
                self.close()  # it is opened anew
            raise
        return rows

    def _take_late(self, held: list[Row], allocator: Allocator) -> None:
        """A journal that can be opened only now must not hold what this world knows nothing of."""
        unknown = [row.id for row in held
                   if row.kind == 'task' and row.id not in allocator.world.tasks.records]
        if unknown:
            raise JournalForeign(f'the journal in {self._dir} has {len(unknown)} tasks that were '
                                 f'not read at the start, {unknown[0]} say')

    def close(self) -> None:
        """Let go of the file."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def _give_up(self, trouble: str) -> None:
        self.close()
        self._given_up = True
        self._say(f'{trouble}; {GIVEN_UP}')

    def _lose(self, what: str) -> None:
        self._lost = what
        self._complain(what)

    def _say(self, trouble: str) -> None:
        if trouble and trouble != self._now_wrong:
            self._complain(trouble)
        self._now_wrong = trouble
