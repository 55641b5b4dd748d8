# SPDX-License-Identifier: Apache-2.0
"""Saves the state of the allocator in the journal, and reads it at the start.

Without a disk the allocator runs on with a warning, and what it accepts meanwhile is written when
the disk is back. A damaged file is renamed, and a new one begun with its readable rows; one that
another process has is left to it. A file of another origin, of a newer version or another program,
or one that cannot be read, ends the start: the tasks in it would be forgotten.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from uav_task_alloc.allocator.persistence.restore import origin_row, restored_state
from uav_task_alloc.allocator.records import SavedState
from uav_task_alloc.errors import (
    JournalCorrupt,
    JournalError,
    JournalForeign,
    JournalInUse,
    JournalUnreadable,
    OriginMismatch,
    counted,
)
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.journal import FILE_NAME, WAIT, Journal, JournalRow
from uav_task_alloc.journal_recovery import read_copy, recover_rows, set_aside

_RETRY = 1.0  # [s] between two attempts on a disk that failed
_SAME_ANGLE, _SAME_ALTITUDE = 1e-7, 0.01  # [deg], [m]: origins within 1 cm are equal
_GIVEN_UP = 'nothing is kept until a restart'


class Saveable(Protocol):
    """What is saved: rows, and the confirmation that they are on disk."""

    def rows(self, most: int | None = None) -> list[JournalRow]:
        """Return what is not on disk, at most `most` tasks of it."""

    def written(self, rows: Iterable[JournalRow] | None = None) -> bool:
        """Confirm rows that are on disk, None: all; returns whether nothing is left to save."""

    def nothing_written(self) -> None:
        """Make `rows` return everything."""

    def knows_task(self, task_id: str) -> bool:
        """Return whether a task was accepted, and is not forgotten."""


class Persistence:
    """Opens the journal, restores `saved` from it, and writes with `save`.

    `in_use`: the error of a journal that another process had at the start, else ''.

    Args:
        state_dir: folder of the journal, '' for none.
        log_error: called with each new error text.
        origin: of all coordinates; None: not checked.
        wait: [s] at the start for another process that has the journal.

    Raises:
        OriginMismatch: the journal is of another origin.
        JournalUnreadable: it is there, but cannot be read.
    """

    def __init__(self, state_dir: str, log_error: Callable[[str], object],
                 origin: Origin | None = None, wait: float = WAIT) -> None:
        self._dir, self._log_error, self._origin = state_dir, log_error, origin
        self._wait = wait
        self._journal: Journal | None = None
        self._has_origin = origin is None  # the journal names it
        self._present_error = ''
        self._lost = ''  # what could not be read at the start
        self._recovered: list[JournalRow] = []  # of a damaged file that was set aside
        self._given_up = not state_dir
        self._retry = 0.0  # [s]
        self.in_use = ''
        self.saved = self._begin() if state_dir else SavedState()
        unreadable = self.saved.unreadable
        if unreadable:
            self._set_lost('; '.join(filter(None, (self._lost, (
                f'{len(unreadable)} left out: {unreadable[0]}')))))

    @property
    def error(self) -> str:
        """What is wrong with the journal; '' if nothing is."""
        return '; '.join(filter(None, (self._present_error, self._lost)))

    def _begin(self) -> SavedState:
        """Open the journal, or read a copy of it. Raises OriginMismatch, JournalUnreadable."""
        try:
            return self._checked(self._open())
        except OriginMismatch:
            self.close()
            raise
        except JournalInUse as error:
            self.in_use = str(error)
            self._give_up(str(error))
        except JournalForeign as error:
            raise _unreadable(error) from None
        except JournalError as error:
            return self._begin_from_copy(f'{error}; tried again every {_RETRY:g} s')
        return SavedState()

    def _begin_from_copy(self, error: str) -> SavedState:
        """Read a journal that cannot be opened in its place."""
        rows: list[JournalRow] = []
        try:
            rows = self._recovered or read_copy(self._dir)
        except JournalCorrupt as worse:
            self._set_lost(str(worse))
        except JournalError as worse:
            raise _unreadable(worse) from None
        self._set_error(error)
        return self._checked(rows)

    def _checked(self, rows: list[JournalRow]) -> SavedState:
        """The state of these rows. Raises OriginMismatch."""
        state = restored_state(rows)
        held, mine = state.origin, self._origin
        self._has_origin = mine is None or held is not None
        if held is not None and mine is not None and not _same_place(held, mine):
            raise OriginMismatch(
                f'the journal in {self._dir} is of {_origin_text(held)}: expected that of the '
                f'parameters, {_origin_text(mine)}: all tasks and zones would move; set the '
                'origin that the journal has, or another state_dir')
        if rows and not self._has_origin and mine is not None:
            self._log_error(f'the journal in {self._dir} names no origin: assumed '
                            f'{_origin_text(mine)}')
        return state

    def _open(self) -> list[JournalRow]:
        try:
            self._journal = Journal(self._dir, self._wait)
            self._wait = WAIT
            return self._journal.load()
        except JournalCorrupt as error:
            self.close()
            return self._replace_damaged(error)

    def _replace_damaged(self, error: JournalCorrupt) -> list[JournalRow]:
        """Rename the damaged file, and begin a new one with its readable rows."""
        try:
            rows = recover_rows(Path(self._dir).expanduser() / FILE_NAME)
        except JournalError:
            rows = []
        self._recovered = rows
        readable = f'{counted(len(rows), "row")} that can be read'
        try:
            aside = set_aside(self._dir)
        except JournalError as worse:
            raise JournalError(f'{error}; {worse}; it has {readable}') from worse
        self._set_lost(f'{error}; set aside as {aside.name}, a new one is kept with the '
                       f'{readable}')
        self._journal = Journal(self._dir)
        self._journal.put(row for row in rows if not isinstance(row.body, bytes))
        return rows

    def save(self, allocator: Saveable, now: float, most: int | None = None) -> bool:
        """Write what is new; afterwards it is on disk, or `error` says why not.

        Args:
            allocator: whose rows are written.
            now: [s] steady clock.
            most: tasks at once; None: all.

        Returns:
            False if there is more to save before anything may be published.
        """
        if self._given_up:
            return allocator.written()
        if self._present_error and now < self._retry:
            return True
        rows = allocator.rows(most)
        if not rows:
            return True
        try:
            rows = self._write(rows, allocator)
        except JournalForeign as error:
            self._give_up(str(error))
        except JournalError as error:
            self._retry = now + _RETRY
            self._set_error(f'{error}; tried again every {_RETRY:g} s')
        else:
            is_saved = allocator.written(rows)
            if is_saved:  # what is left was accepted without a disk
                self._set_error('')
            return is_saved
        return True

    def save_last(self, allocator: Saveable) -> None:
        """Write what is new at the end of a run, without a rest after a failure.

        Args:
            allocator: whose rows are written; how many could not be is logged.
        """
        self._retry = 0.0
        self.save(allocator, 0.0)
        if self._present_error and (rows := allocator.rows()):
            self._log_error(f'{counted(len(rows), "row")} of the journal could not be written '
                            'before the end')

    def _write(self, rows: list[JournalRow], allocator: Saveable) -> list[JournalRow]:
        """Write rows, or the whole world where nothing is on disk; returns what was written."""
        if self._journal is None:
            self._check_late(self._open(), allocator)
            allocator.nothing_written()
            rows = allocator.rows()
        if not self._has_origin and self._origin is not None:
            rows = [origin_row(self._origin), *rows]
        assert self._journal is not None
        try:
            self._journal.put(rows)
        except JournalError as error:
            if isinstance(error, JournalCorrupt) or not self._journal.is_in_place():
                self.close()  # it is opened again
            raise
        self._has_origin = True
        return rows

    def _check_late(self, held: list[JournalRow], allocator: Saveable) -> None:
        """Refuse a journal that could not be opened at the start, and has tasks unknown here."""
        self._checked(held)
        unknown = [row.id for row in held
                   if row.kind == 'task' and not allocator.knows_task(row.id)]
        if unknown:
            raise JournalForeign(f'the journal in {self._dir} has '
                                 f'{counted(len(unknown), "task")} not read at the start, '
                                 f'{unknown[0]} say')

    def close(self) -> None:
        """Close the file."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def _give_up(self, error: str) -> None:
        self.close()
        self._given_up = True
        self._set_error(f'{error}; {_GIVEN_UP}')

    def _set_lost(self, what: str) -> None:
        self._lost = what
        self._log_error(what)

    def _set_error(self, error: str) -> None:
        if error and error != self._present_error:
            self._log_error(error)
        self._present_error = error


def _same_place(one: Origin, other: Origin) -> bool:
    return (abs(one.latitude - other.latitude) <= _SAME_ANGLE
            and abs(one.longitude - other.longitude) <= _SAME_ANGLE
            and abs(one.altitude_amsl - other.altitude_amsl) <= _SAME_ALTITUDE)


def _origin_text(origin: Origin) -> str:
    return (f'origin latitude {origin.latitude}, longitude {origin.longitude} deg, '
            f'altitude_amsl {origin.altitude_amsl} m')


def _unreadable(error: JournalError) -> JournalUnreadable:
    remedy = ('use the program that wrote it' if isinstance(error, JournalForeign)
              else 'make it readable')
    return JournalUnreadable(f'{error}: expected a journal that can be read, as the tasks in it '
                             f'would be forgotten: {remedy}, or set another state_dir')
