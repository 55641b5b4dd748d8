# SPDX-License-Identifier: Apache-2.0
"""Keeps who has each aircraft in a folder, one JSON file for each UAV, replaced as a whole."""
from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_type_hints
from urllib.parse import quote

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord, AuthorityState, TaskMark

FORMAT = 1  # of the file; one of a newer format is refused
LONGEST_NAME = 150  # characters; file systems take 255 bytes
LARGEST = 65536  # [bytes] of a file that is read
MOST_SECONDS = 1e11  # [s] of a steady clock
LONG_AGO = -1e9  # [s] steady time of what happened before the computer was started
BOOT_ID = Path('/proc/sys/kernel/random/boot_id')
WITHOUT = ('after a restart of the bridge an airborne vehicle is left to its pilot, unless it '
           'flies our mission')


def boot_id() -> str:
    """Names this start of the computer, with which steady time began; '' where unknown."""
    try:
        return BOOT_ID.read_text('ascii').strip()
    except (OSError, ValueError):
        return ''


def uav_file_name(uav_id: str) -> str:
    """A name of its own for each UAV, without separators."""
    name = quote(uav_id, safe='')
    if len(name) > LONGEST_NAME:
        digest = hashlib.sha256(uav_id.encode('utf-8', 'replace')).hexdigest()
        name = f'{name[:LONGEST_NAME - 65]}~{digest}'
    return f'authority_{name}.json'


class AuthorityFileStore:
    """An `AuthorityStore` on disk.

    Args:
        folder: created where it is missing.
        report: takes a line for the operator where a file cannot be read or written.
        boot: names this start of the computer; times of another start are long ago.

    Raises:
        InvalidValue: the folder cannot be created, or no file in it.
    """

    def __init__(self, folder: str, report: Callable[[str], object], boot: str = '') -> None:
        self._folder, self._report, self._boot = Path(folder).expanduser(), report, boot
        self._waiting: dict[str, AuthorityRecord] = {}  # not on disk, by UAV
        self._trouble = ''  # as reported; '' while all is on disk
        probe = self._folder / '.probe'
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            probe.touch()
            probe.unlink()
        except OSError as error:
            raise InvalidValue('state_dir', folder,
                               f'a folder that can be written to ({error})') from None

    def path(self, uav_id: str) -> Path:
        """The file of a UAV."""
        return self._folder / uav_file_name(uav_id)

    def load(self, uav_id: str) -> AuthorityRecord | None:
        """What was saved last.

        Returns:
            None where nothing was, or the file cannot be used, which is reported.
        """
        path = self.path(uav_id)
        try:
            body = json.loads(_read(path))
            record = _record(body, uav_id)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            self._report(f'{path}: {error or type(error).__name__}: not used; an airborne '
                         f'{uav_id} is left to its pilot, unless it flies our mission')
            return None
        if body['boot'] != self._boot:
            record = replace(record, since=0.0, marks=(),
                             swap_at=None if record.swap_at is None else LONG_AGO)
        return record

    def save(self, uav_id: str, record: AuthorityRecord) -> None:
        """On disk when this returns; else that is reported once, and `retry` tries again."""
        self._waiting[uav_id] = record
        self.retry()

    def retry(self) -> None:
        """Write what could not be written before."""
        found = ''
        for uav_id, record in list(self._waiting.items()):
            path = self.path(uav_id)
            try:
                self._write(path, self._text(uav_id, record))
            except (OSError, ValueError) as error:
                found = found or f'{path}: not written: {error}{self._remove(path)}'
            else:
                del self._waiting[uav_id]
        if found and not self._trouble:
            self._report(f'{found}; tried again; meanwhile {WITHOUT}')
        elif self._trouble and not found:
            self._report(f'{self._folder}: written again')
        self._trouble = found

    def _remove(self, path: Path) -> str:
        """Remove a file that is out of date; why that cannot be done, '' where it is gone."""
        try:
            path.unlink(missing_ok=True)
            self._sync()
        except OSError as error:
            return f'; what it holds is out of date, and it cannot be removed: {error}'
        return ''

    def _text(self, uav_id: str, record: AuthorityRecord) -> str:
        plain = {spec.name: getattr(record, spec.name) for spec in fields(record)}
        body = {'format': FORMAT, 'uav_id': uav_id, 'boot': self._boot,
                'record': plain | {'state': record.state.name}}
        return json.dumps(body, indent=1, allow_nan=False) + '\n'

    def _write(self, path: Path, text: str) -> None:
        """The old content or the new one, whenever the process or the computer ends."""
        temporary = path.with_suffix('.tmp')
        try:
            with open(temporary, 'w', encoding='utf-8') as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
        self._sync()

    def _sync(self) -> None:
        """The names in the folder are on disk, too."""
        folder = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _read(path: Path) -> str:
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError('no regular file')
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise ValueError(f'larger than {LARGEST} bytes')
    return data.decode('utf-8')


def _record(body: Any, uav_id: str) -> AuthorityRecord:
    """The record of a file. Raises ValueError, which says what is wrong with it."""
    if not isinstance(body, dict) or set(body) != {'format', 'uav_id', 'boot', 'record'}:
        raise ValueError('not written by this program, or damaged')
    if body['format'] != FORMAT:
        raise ValueError(f'format = {body["format"]!r:.50}: expected {FORMAT}')
    if body['uav_id'] != uav_id:
        raise ValueError(f'uav_id = {body["uav_id"]!r:.250}: expected {uav_id!r}')
    row = body['record']
    if not isinstance(row, dict) or row.keys() != _CHECKS.keys():
        raise ValueError('record: expected ' + ', '.join(_CHECKS))
    found = {}
    for name, value in row.items():
        right, made = _CHECKS[name]
        if not right(value):
            raise ValueError(f'{name} = {value!r:.50}: expected another type of value')
        found[name] = made(value)
    return AuthorityRecord(**found)


def _is_whole(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**32


def _is_time(value: Any) -> bool:
    return type(value) in (int, float) and -MOST_SECONDS < value < MOST_SECONDS


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()  # a log takes it


def _is_state(value: Any) -> bool:
    return isinstance(value, str) and value in AuthorityState.__members__ and value != 'UNKNOWN'


def _or_none(right: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or right(value)


def _same(value: Any) -> Any:
    return value


def _are_marks(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(mark, list) and len(mark) == 6 and _is_text(mark[0])
        and all(map(_is_time, mark[1:5])) and isinstance(mark[5], bool) for mark in value)


# whether a JSON value is of that type, and the value
_TYPES: dict[Any, tuple[Callable[[Any], bool], Callable[[Any], Any]]] = {
    AuthorityState: (_is_state, AuthorityState.__getitem__),
    str: (_is_text, _same),
    bool: (lambda value: isinstance(value, bool), _same),
    float: (_is_time, float),
    float | None: (_or_none(_is_time), lambda value: None if value is None else float(value)),
    int | None: (_or_none(_is_whole), _same),
    tuple[int, ...]: (lambda value: isinstance(value, list) and all(map(_is_whole, value)),
                      tuple),
    tuple[TaskMark, ...]: (_are_marks, lambda value: tuple(TaskMark(*mark) for mark in value)),
}
_CHECKS = {name: _TYPES[hint] for name, hint in get_type_hints(AuthorityRecord).items()}
