# SPDX-License-Identifier: Apache-2.0
"""Keeps an allocator's world in the journal; without a disk the allocator runs on and says so.

What was accepted while a disk refused stays in memory, and is written when the disk is back. A
damaged file is set aside under another name, and a new one begun with what can be read of it; one
of a newer version, or of another process, is left alone; one of another origin ends the start.
"""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.allocator.core import Allocator
from uav_task_alloc.allocator.persistence.restore import Saved, origin_row, saved
from uav_task_alloc.errors import (
    JournalCorrupt,
    JournalError,
    JournalForeign,
    JournalInUse,
    OriginMismatch,
)
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.journal import WAIT, Journal, JournalRow, read_copy, rescued, set_aside

_RETRY = 1.0  # [s] between two tries on a disk that refused
SAME_ANGLE, SAME_ALTITUDE = 1e-7, 0.01  # [deg], [m] an origin is the same within 1 cm
GIVEN_UP = 'nothing is kept until a restart'


class Persistence:
    """`trouble` is what is wrong with the journal, '' while all is well.

    state_dir: folder of the journal, '' for none. origin: of all coordinates; None: not checked.
    wait: [s] at the start for another process that has the journal.
    Raises OriginMismatch where the journal is of another origin.
    """

    def __init__(self, state_dir: str, complain: Callable[[str], object],
                 origin: Origin | None = None, wait: float = WAIT) -> None:
        self._dir, self._complain, self._origin = state_dir, complain, origin
        self._wait = wait
        self._journal: Journal | None = None
        self._has_origin = origin is None  # the journal names it
        self._now_wrong = ''  # until it is mended
        self._lost = ''  # what the last life left that cannot be read: told until the next one
        self._given_up = not state_dir
        self._retry = 0.0  # [s]
        self.in_use = ''  # another process had the journal at the start: the error
        self.saved = self._begin() if state_dir else Saved()
        if self.saved.bad:
            self._lose('; '.join(filter(None, (self._lost, (
                f'{len(self.saved.bad)} left out: {self.saved.bad[0]}')))))

    @property
    def trouble(self) -> str:
        """Everything an operator should know of the journal."""
        return '; '.join(filter(None, (self._now_wrong, self._lost)))

    def _begin(self) -> Saved:
        """Open the journal, or at least read it."""
        try:
            return self._checked(self._open())
        except OriginMismatch:
            self.close()
            raise
        except JournalForeign as error:
            self.in_use = str(error) if isinstance(error, JournalInUse) else ''
            self._give_up(str(error))
        except JournalError as error:
            self._say(f'{error}; tried again every {_RETRY:g} s')
            try:
                return self._checked(read_copy(self._dir))
            except OriginMismatch:
                raise
            except JournalError as worse:
                self._lose(str(worse))
        return Saved()

    def _checked(self, rows: list[JournalRow]) -> Saved:
        """The world of these rows. Raises OriginMismatch."""
        found = saved(rows)
        held, mine = found.origin, self._origin
        self._has_origin = mine is None or held is not None
        if held is not None and mine is not None and not _same_place(held, mine):
            raise OriginMismatch(
                f'the journal in {self._dir} is of {_named(held)}: expected that of the '
                f'parameters, {_named(mine)}: all tasks and zones would move; set the origin '
                'that the journal has, or another state_dir')
        if rows and not self._has_origin and mine is not None:
            self._complain(f'the journal in {self._dir} names no origin: taken for {_named(mine)}')
        return found

    def _open(self) -> list[JournalRow]:
        try:
            self._journal = Journal(self._dir, self._wait)
            self._wait = WAIT
            return self._journal.load()
        except JournalCorrupt as error:
            self.close()
            return self._begin_anew(error)

    def _begin_anew(self, error: JournalCorrupt) -> list[JournalRow]:
        """Set the damaged file aside; what can be read of it begins the new one."""
        aside = set_aside(self._dir)
        try:
            rows = rescued(aside)
        except JournalError:
            rows = []
        self._lose(f'{error}; set aside as {aside.name}, a new one is kept with the {len(rows)} '
                   'rows that can be read')
        self._journal = Journal(self._dir)
        self._journal.put(row for row in rows if not isinstance(row.body, bytes))
        return rows

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
            self._retry = now + _RETRY
            self._say(f'{error}; tried again every {_RETRY:g} s')
        else:
            self._say('')
            return allocator.written(rows)
        return True

    def _write(self, rows: list[JournalRow], allocator: Allocator) -> list[JournalRow]:
        """Returns what is on disk now: these rows, or the whole world where nothing was."""
        if self._journal is None:
            self._take_late(self._open(), allocator)
            allocator.nothing_written()
            rows = allocator.rows()
        if not self._has_origin and self._origin is not None:
            rows = [origin_row(self._origin), *rows]
        assert self._journal is not None
        try:
            self._journal.put(rows)
        except JournalError as error:
            if isinstance(error, JournalCorrupt) or not self._journal.in_place():
                self.close()  # it is opened anew
            raise
        self._has_origin = True
        return rows

    def _take_late(self, held: list[JournalRow], allocator: Allocator) -> None:
        """A journal that can be opened only now must not hold what this world knows nothing of."""
        self._checked(held)
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


def _same_place(one: Origin, other: Origin) -> bool:
    return (abs(one.latitude - other.latitude) <= SAME_ANGLE
            and abs(one.longitude - other.longitude) <= SAME_ANGLE
            and abs(one.altitude_amsl - other.altitude_amsl) <= SAME_ALTITUDE)


def _named(origin: Origin) -> str:
    return (f'origin latitude {origin.latitude}, longitude {origin.longitude} deg, '
            f'altitude_amsl {origin.altitude_amsl} m')
