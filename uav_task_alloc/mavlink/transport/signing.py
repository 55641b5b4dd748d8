# SPDX-License-Identifier: Apache-2.0
"""The signing key, and its monotonic timestamp in a file next to the key."""
from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import make_signing

_EPOCH = 1420070400  # [s] 2015-01-01, from which timestamps count 10 us
_MAX_TIMESTAMP = 2**48 - 1  # [10 us] of the field in a frame
_PERIOD = 5.0  # [s] between writes; the stored timestamp is ahead by twice that
_EXPECTED = (f'a whole number in [0, {_MAX_TIMESTAMP}]; delete the file if the clock of this '
             'computer is right')


class SigningClock:
    """Signing of sent and received frames, and the timestamp of both on disk.

    While the timestamp cannot be written, `trouble` holds the reason, and signing continues.

    Args:
        key_file: see `read_key`; the timestamp is stored in `key_file`.timestamp.
        wall: wall clock [s] since 1970.

    Raises:
        InvalidValue: key or timestamp cannot be read, or the timestamp not written.
    """

    def __init__(self, key_file: str, wall: Callable[[], float]) -> None:
        self._wall, self._path = wall, Path(key_file + '.timestamp')
        key = read_key(key_file)
        stamp = max(self._now(), read_timestamp(self._path))
        self.incoming = make_signing(key, stamp)  # shared by all parsers
        self.outgoing = make_signing(key, stamp)  # used by the sending threads
        self.trouble = ''
        self._write_at = 0.0
        try:
            self._write()
        except OSError as error:
            raise InvalidValue('signing timestamp', str(self._path),
                               f'a file that can be written ({error})') from None

    def catch_up(self) -> None:
        """Advance the timestamp of sent frames to the latest received one."""
        self.outgoing.timestamp = max(self.outgoing.timestamp, self.incoming.timestamp)

    def step(self, now: float) -> None:
        """Write the timestamp to disk if due.

        Args:
            now: steady time [s].
        """
        if now < self._write_at:
            return
        self._write_at = now + _PERIOD
        self.incoming.timestamp = max(self.incoming.timestamp, self._now())
        try:
            self._write()
            self.trouble = ''
        except OSError as error:
            self.trouble = (f'{self._path}: not written: {error}; signing continues; after a '
                            'restart with a clock set back, its frames would be rejected')

    def _now(self) -> int:
        return max(0, int((self._wall() - _EPOCH) * 1e5))  # 0: the clock was never set

    def _write(self) -> None:
        # ahead, so that no timestamp used until the next write is repeated after a crash
        stamp = max(self.incoming.timestamp, self.outgoing.timestamp) + int(2e5 * _PERIOD)
        text = str(min(stamp, _MAX_TIMESTAMP))
        temporary = self._path.with_name(self._path.name + '.tmp')
        try:
            temporary.write_text(text)
            os.replace(temporary, self._path)
        except OSError:
            self._path.write_text(text)  # the directory may be read-only


def read_timestamp(path: Path) -> int:
    """Read a signing timestamp.

    Returns:
        [10 us] since 2015-01-01; 0 if the file does not exist.

    Raises:
        InvalidValue: the file cannot be read, or holds no timestamp.
    """
    try:
        with open(path, 'rb') as file:
            text = file.read(100).decode('ascii', 'replace').strip()
    except FileNotFoundError:
        return 0
    except OSError as error:
        raise InvalidValue('signing timestamp', str(path), f'a readable file ({error})') from None
    if not (text.isascii() and text.isdigit() and int(text) <= _MAX_TIMESTAMP):
        raise InvalidValue(f'signing timestamp in {path}', text, _EXPECTED)
    return int(text)


def read_key(path: str) -> bytes:
    """Read a signing key.

    Args:
        path: file of 32 raw bytes, 64 hex digits, or a pass phrase.

    Returns:
        32 bytes; of a pass phrase its SHA-256.

    Raises:
        InvalidValue: the file cannot be read, or is empty.
    """
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise InvalidValue('signing_key_file', path, f'a readable file ({error})') from None
    if len(text) == 32:
        return text
    text = text.strip()
    if not text:
        raise InvalidValue('signing_key_file', path, 'a file that is not empty')
    try:
        if len(text) == 64:
            return bytes.fromhex(text.decode())
    except ValueError:
        pass
    return hashlib.sha256(text).digest()
