# SPDX-License-Identifier: Apache-2.0
"""Stores the authority record of each UAV as a JSON file in a folder, replaced atomically.

The last position is in a file of its own, as it changes each second: it is not flushed to disk,
since only a bridge that was killed needs it, not a computer that lost its power.
"""
from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_type_hints
from urllib.parse import quote

from uav_task_alloc.atomic_files import lock_folder, read_file, replace_file, sync_folder
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.authority_state import (
    UNUSABLE,
    AuthorityRecord,
    AuthorityState,
    TaskMark,
)
from uav_task_alloc.mavlink.mission.piece_mark import PART_FLOWN, PART_MISSED, PieceMark

_POSITION, _POSITION_SUFFIX = 'seen', '.position'  # field with a file of its own
_FORMAT = 1  # of the file; one of a newer format is refused
_NAME_LIMIT = 150  # characters; file systems allow 255 bytes
_FILE_LIMIT = 65536  # [bytes] of a file that is read
_TIME_LIMIT = 1e11  # [s] of a steady clock
LONG_AGO = -1e9  # [s] steady time of events before the last boot of the computer
_BOOT_ID = Path('/proc/sys/kernel/random/boot_id')
_CONSEQUENCE = ('after a restart of the bridge an airborne vehicle is left to its pilot unless '
                'it flies our mission, and one on the ground waits for ~/hand_over')


def boot_id() -> str:
    """Return the id of this boot of the computer, which starts the steady clock.

    Returns:
        The kernel's boot_id; '' where it cannot be read.
    """
    try:
        return _BOOT_ID.read_text('ascii').strip()
    except (OSError, ValueError):
        return ''


def uav_file_name(uav_id: str) -> str:
    """Return a file name that is unique for each UAV id and contains no separator."""
    name = quote(uav_id, safe='')
    if len(name) > _NAME_LIMIT:
        digest = hashlib.sha256(uav_id.encode('utf-8', 'replace')).hexdigest()
        name = f'{name[:_NAME_LIMIT - 65]}~{digest}'
    return f'authority_{name}.json'


class AuthorityFileStore:
    """An `AuthorityStore` on disk.

    Args:
        folder: created where it is missing.
        report: called with a line for the operator where a file cannot be read or written.
        boot: id of this boot of the computer; times of another boot are set to `LONG_AGO`.

    Raises:
        InvalidValue: the folder cannot be created or written to.
    """

    def __init__(self, folder: str, report: Callable[[str], object], boot: str = '') -> None:
        self._folder, self._report, self._boot = Path(folder).expanduser(), report, boot
        self._unsaved: dict[str, AuthorityRecord] = {}  # by UAV id
        self._saved: dict[str, AuthorityRecord] = {}  # by UAV id; without its position
        self._error = ''  # the write error reported last; '' while all is on disk
        self._lock: int | None = None
        probe = self._folder / '.probe'
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            probe.touch()
            probe.unlink()
        except OSError as error:
            raise InvalidValue('state_dir', folder,
                               f'a folder that can be written to ({error})') from None

    def lock(self) -> None:
        """Take the folder for this process alone: another fleet's UAVs have the same ids.

        Raises:
            InvalidValue: another bridge has it.
        """
        try:
            self._lock = lock_folder(self._folder)
        except BlockingIOError:
            raise InvalidValue('state_dir', str(self._folder),
                               'a folder of its own: another bridge that runs has this one, and '
                               'UAVs with the same id would share a file') from None

    def close(self) -> None:
        """Leave the folder to another bridge."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def path(self, uav_id: str) -> Path:
        """Return the path of a UAV's file.

        Args:
            uav_id: of a UAV.
        """
        return self._folder / uav_file_name(uav_id)

    def load(self, uav_id: str) -> AuthorityRecord | None:
        """Load the record saved last.

        Args:
            uav_id: of the UAV.

        Returns:
            None where there is no file; `UNUSABLE` where it cannot be used, which is reported.
        """
        path = self.path(uav_id)
        try:
            body = json.loads(read_file(path, _FILE_LIMIT))
            record = _record(body, uav_id)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            self._report(f'{path}: {error or type(error).__name__}: not used; an airborne '
                         f'{uav_id} is left to its pilot unless it flies our mission, and on the '
                         'ground it waits for ~/hand_over')
            return UNUSABLE
        if body['boot'] != self._boot:
            record = replace(record, since=0.0, marks=(),
                             replacing_since=None if record.replacing_since is None else LONG_AGO)
        return replace(record, seen=_position(path) if body['boot'] == self._boot else ())

    def save(self, uav_id: str, record: AuthorityRecord) -> None:
        """Write a record to disk before returning, its position to a file.

        A failure is reported once; `retry` tries again.

        Args:
            uav_id: of the UAV.
            record: replaces the one saved before.
        """
        path, position = self.path(uav_id).with_suffix(_POSITION_SUFFIX), record.seen
        record = replace(record, seen=())
        if record != self._saved.get(uav_id):
            self._unsaved[uav_id] = record
        self.retry()
        if position and not self._error:
            with contextlib.suppress(OSError):  # it is written again in a second
                temporary = path.with_suffix('.tmp')
                temporary.write_text(json.dumps(position))
                os.replace(temporary, path)

    def retry(self) -> None:
        """Write the records that could not be written before."""
        first_error = ''
        for uav_id, record in list(self._unsaved.items()):
            path = self.path(uav_id)
            self._saved.pop(uav_id, None)
            try:
                replace_file(path, self._text(uav_id, record))
            except (OSError, ValueError) as error:
                error_text = f'{path}: not written: {error}{self._empty(path)}'
                first_error = first_error or error_text
            else:
                del self._unsaved[uav_id]
                self._saved[uav_id] = record
        if first_error and not self._error:
            self._report(f'{first_error}; it is tried again; until then, {_CONSEQUENCE}')
        elif self._error and not first_error:
            self._report(f'{self._folder}: written again')
        self._error = first_error

    def _empty(self, path: Path) -> str:
        """Empty an outdated file, which needs no space; returns an error text, '' for success.

        A file that is missing would look like a first run.
        """
        try:
            path.touch()
            os.truncate(path, 0)
            sync_folder(self._folder)
        except OSError as error:
            return f'; what it holds is out of date, and it cannot be emptied: {error}'
        return ''

    def _text(self, uav_id: str, record: AuthorityRecord) -> str:
        row = {_KEYS.get(spec.name, spec.name): getattr(record, spec.name)
               for spec in fields(record) if spec.name != _POSITION}
        body = {'format': _FORMAT, 'uav_id': uav_id, 'boot': self._boot,
                'record': row | {'state': record.state.name}}
        return json.dumps(body, indent=1, allow_nan=False) + '\n'


def _position(path: Path) -> tuple[float, ...]:
    """The last position; () where the file of a record has none that can be used."""
    try:
        values = json.loads(read_file(path.with_suffix(_POSITION_SUFFIX), _FILE_LIMIT))
        usable = isinstance(values, list) and all(
            type(value) in (int, float) and math.isfinite(value) for value in values)
    except (OSError, ValueError, RecursionError):
        return ()
    return tuple(map(float, values)) if usable else ()


def _record(body: Any, uav_id: str) -> AuthorityRecord:
    """Build the record from the JSON body. Raises ValueError with the defect."""
    if not isinstance(body, dict) or set(body) != {'format', 'uav_id', 'boot', 'record'}:
        raise ValueError('corrupt or not an authority record')
    if body['format'] != _FORMAT:
        raise ValueError(f'format = {body["format"]!r:.50}: expected {_FORMAT}')
    if body['uav_id'] != uav_id:
        raise ValueError(f'uav_id = {body["uav_id"]!r:.250}: expected {uav_id!r}')
    row = body['record']
    if isinstance(row, dict):  # files of earlier versions do not have it
        row = {'arrived': False, 'passed': [], 'uploading': [], 'landed_battery': None,
               'pieces': [], 'ahead': [], **row}
    if not isinstance(row, dict) or row.keys() != _CHECKS.keys():
        raise ValueError('record: expected ' + ', '.join(_CHECKS))
    record = {}
    for key, value in row.items():
        name, is_valid, convert = _CHECKS[key]
        if not is_valid(value):
            raise ValueError(f'{key} = {value!r:.50}: expected another type of value')
        record[name] = convert(value)
    return AuthorityRecord(**record)


def _is_whole(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**32


def _is_time(value: Any) -> bool:
    return type(value) in (int, float) and -_TIME_LIMIT < value < _TIME_LIMIT


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()  # safe to log


def _is_state(value: Any) -> bool:
    return isinstance(value, str) and value in AuthorityState.__members__ and value != 'UNKNOWN'


def _or_none(is_valid: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or is_valid(value)


def _unchanged(value: Any) -> Any:
    return value


def _are_marks(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(mark, list) and len(mark) == 6 and _is_text(mark[0])
        and all(map(_is_time, mark[1:5])) and isinstance(mark[5], bool) for mark in value)


def _are_pieces(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(mark, list) and len(mark) in (8, 9) and _is_text(mark[0])
        and all(map(_is_time, (*mark[1:6], mark[7]))) and isinstance(mark[6], bool)
        and 0.0 <= mark[4] < mark[5] and mark[7] >= 0.0
        and all(type(state) is int and PART_FLOWN <= state <= PART_MISSED for state in mark[8:])
        for mark in value)


# by type of the field: whether a JSON value is valid, and its conversion
_TYPES: dict[Any, tuple[Callable[[Any], bool], Callable[[Any], Any]]] = {
    AuthorityState: (_is_state, AuthorityState.__getitem__),
    str: (_is_text, _unchanged),
    bool: (lambda value: isinstance(value, bool), _unchanged),
    float: (_is_time, float),
    float | None: (_or_none(_is_time), lambda value: None if value is None else float(value)),
    int | None: (_or_none(_is_whole), _unchanged),
    tuple[int, ...]: (lambda value: isinstance(value, list) and all(map(_is_whole, value)),
                      tuple),
    tuple[PieceMark, ...]: (_are_pieces,
                            lambda value: tuple(PieceMark(*mark) for mark in value)),
    tuple[TaskMark, ...]: (_are_marks, lambda value: tuple(TaskMark(*mark) for mark in value)),
}
_KEYS = {'replacing_since': 'swap_at'}  # fields with another key in the file
_CHECKS = {_KEYS.get(name, name): (name, *_TYPES[hint])
           for name, hint in get_type_hints(AuthorityRecord).items() if name != _POSITION}
