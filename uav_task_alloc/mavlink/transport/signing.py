# SPDX-License-Identifier: Apache-2.0
"""The signing key, and its timestamp, which must never go back: a file beside the key keeps it."""
from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import make_signing

EPOCH = 1420070400  # [s] 2015-01-01, from which timestamps count 10 us
_MOST = 2**48 - 1  # [10 us] what a frame holds
_PERIOD = 5.0  # [s] between writes of the timestamp, which runs ahead by twice that much
_EXPECTED = (f'a whole number in [0, {_MOST}]; delete the file if the clock of this computer is '
            'right')


class SigningClock:
    """Signing for what is sent and for what is heard, and the timestamp of both on disk.

    Raises InvalidValue where key or timestamp cannot be read, or the timestamp not be written.
    Later, while it cannot be written, `trouble` says why and signing goes on.
    """

    def __init__(self, key_file: str, wall: Callable[[], float]) -> None:
        self._wall, self._path = wall, Path(key_file + '.timestamp')
        key = read_key(key_file)
        stamp = max(self._now(), read_timestamp(self._path))
        self.incoming = make_signing(key, stamp)  # all parsers share it
        self.outgoing = make_signing(key, stamp)  # another thread signs with it
        self.trouble = ''
        self._write_at = 0.0
        try:
            self._write()
        except OSError as error:
            raise InvalidValue('signing timestamp', str(self._path),
                               f'a file that can be written ({error})') from None

    def catch_up(self) -> None:
        """Before something is signed: no timestamp is older than one that was heard."""
        self.outgoing.timestamp = max(self.outgoing.timestamp, self.incoming.timestamp)

    def step(self, now: float) -> None:
        """Let time pass: keep the timestamp on disk, or try it again.

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
            self.trouble = (f'{self._path}: not written: {error}; signing goes on; a bridge that '
                            'starts again with a clock that went back would be refused')

    def _now(self) -> int:
        return max(0, int((self._wall() - EPOCH) * 1e5))  # a clock that was never set is earlier

    def _write(self) -> None:
        # ahead, so that what is signed until the next write is not used again after a crash
        stamp = max(self.incoming.timestamp, self.outgoing.timestamp) + int(2e5 * _PERIOD)
        text = str(min(stamp, _MOST))
        temporary = self._path.with_name(self._path.name + '.tmp')
        try:
            temporary.write_text(text)
            os.replace(temporary, self._path)
        except OSError:
            self._path.write_text(text)  # its folder may be read-only


def read_timestamp(path: Path) -> int:
    """The timestamp [10 us] in a file; 0 where there is none. Raises InvalidValue."""
    try:
        with open(path, 'rb') as file:
            text = file.read(100).decode('ascii', 'replace').strip()
    except FileNotFoundError:
        return 0
    except OSError as error:
        raise InvalidValue('signing timestamp', str(path), f'a readable file ({error})') from None
    if not (text.isascii() and text.isdigit() and int(text) <= _MOST):
        raise InvalidValue(f'signing timestamp in {path}', text, _EXPECTED)
    return int(text)


def read_key(path: str) -> bytes:
    """The 32 bytes of a signing key file: raw, 64 hex digits, or a pass phrase."""
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
