# SPDX-License-Identifier: Apache-2.0
"""The only sockets: UDP in and out, TCP and serial, none of which ever blocks."""
from __future__ import annotations

import os
import socket
import termios
import tty
from collections.abc import Collection, Hashable
from contextlib import suppress
from typing import Protocol

from uav_task_alloc.errors import InvalidValue

_CHUNK = 65536  # [B] more than any datagram
BACKLOG = 65536  # [B] a slow line may be behind; what is more is dropped
RECONNECT = 1.0  # [s]
MAX_UNCONFIRMED = 32  # far ends of one link that are of no known vehicle; the latest are kept
_EXPECTED = 'udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or /dev/tty...:BAUD'


class Link(Protocol):
    """One way to some far ends."""

    name: str
    datagrams: bool  # each read is whole
    opened: int  # how often; a new file may have the number of the old one
    trouble: str  # why nothing comes; empty: no reason is known

    def fileno(self) -> int: ...

    def read(self) -> list[tuple[Hashable, bytes]]:
        """What has come, by far end; [] where nothing has."""

    def write(self, end: Hashable, data: bytes) -> None:
        """Send, or drop where the line is full."""

    def step(self, now: float) -> None:
        """Open what has closed, send what waits."""

    def ends(self) -> list[Hashable]:
        """Far ends that are known."""

    def keep(self, ends: Collection[Hashable]) -> None:
        """These are of known vehicles: they are not forgotten, however many others there are."""

    def close(self) -> None: ...


class Udp:
    """udpin learns its far ends by hearing them, udpout has one from the start."""

    datagrams, opened, trouble = True, 1, ''

    def __init__(self, name: str, host: str, port: int, bind: bool) -> None:
        self.name = name
        self._ends: dict[Hashable, None] = {}  # the one heard last at the end
        self._given: frozenset[Hashable] = frozenset()  # far end by its parameter
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        try:
            if bind:  # without SO_REUSEADDR, which lets a second bridge steal the port unseen
                self._socket.bind((host, port))
            else:
                self._given = frozenset({(socket.gethostbyname(host), port)})
                self._ends.update(dict.fromkeys(self._given))
                self._socket.bind(('', 0))
        except OSError as error:
            self._socket.close()
            raise InvalidValue('connections', name, f'a free port ({error})') from None
        self._kept: frozenset[Hashable] = self._given

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> list[tuple[Hashable, bytes]]:
        got: list[tuple[Hashable, bytes]] = []
        try:
            while len(got) < 256:
                data, end = self._socket.recvfrom(_CHUNK)
                self._hear(end)
                got.append((end, data))
        except OSError:  # nothing more, or an earlier datagram had no listener
            pass
        return got

    def _hear(self, end: Hashable) -> None:
        self._ends.pop(end, None)
        self._ends[end] = None
        if len(self._ends) > len(self._kept) + MAX_UNCONFIRMED:
            del self._ends[next(old for old in self._ends if old not in self._kept)]

    def keep(self, ends: Collection[Hashable]) -> None:
        self._kept = frozenset(ends) | self._given

    def write(self, end: Hashable, data: bytes) -> None:
        with suppress(OSError):  # a lost datagram: the protocols above expect that
            self._socket.sendto(data, end)  # type: ignore[call-overload]

    def step(self, now: float) -> None:
        """Nothing to do."""

    def ends(self) -> list[Hashable]:
        return list(self._ends)

    def close(self) -> None:
        self._socket.close()


class Stream:
    """A byte stream with one far end: what TCP and a serial line have in common."""

    datagrams = False

    def __init__(self, name: str) -> None:
        self.name, self.opened, self.trouble = name, 0, ''
        self._file = -1
        self._waiting = bytearray()
        self._try_at = float('-inf')

    def _open(self) -> int:
        raise NotImplementedError

    def fileno(self) -> int:
        return self._file

    def read(self) -> list[tuple[Hashable, bytes]]:
        if self._file < 0:
            return []
        try:
            data = os.read(self._file, _CHUNK)
        except BlockingIOError:
            return []
        except OSError as error:
            return self._broken(error.strerror)
        if not data:
            return self._broken('closed by the far end')
        self.trouble = ''
        return [(self.name, data)]

    def _broken(self, why: str | None) -> list[tuple[Hashable, bytes]]:
        self.trouble = why or 'broken'
        self.close()
        return []

    def write(self, end: Hashable, data: bytes) -> None:
        if self._file >= 0 and len(self._waiting) + len(data) <= BACKLOG:
            self._waiting += data
            self._flush()

    def step(self, now: float) -> None:
        if self._file < 0 and now >= self._try_at:
            self._try_at = now + RECONNECT
            try:
                self._file = self._open()
                self.opened += 1
            except OSError as error:
                self._file, self.trouble = -1, error.strerror or str(error)
        elif self._waiting:
            self._flush()

    def _flush(self) -> None:
        try:
            del self._waiting[:os.write(self._file, self._waiting)]
        except BlockingIOError:
            pass
        except OSError as error:
            self._broken(error.strerror)

    def ends(self) -> list[Hashable]:
        return [self.name]

    def keep(self, ends: Collection[Hashable]) -> None:
        """It has one far end, which is always kept."""

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
        self._file = -1
        self._waiting.clear()


class Tcp(Stream):
    """A client, as SITL waits for one; it connects again when the line breaks."""

    def __init__(self, name: str, host: str, port: int) -> None:
        super().__init__(name)
        self._address = host, port

    def _open(self) -> int:
        line = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            line.connect(self._address)
        except BlockingIOError:
            pass  # under way; a refusal shows when reading
        except OSError:
            line.close()
            raise
        return line.detach()


class Serial(Stream):
    """A serial line in raw mode."""

    def __init__(self, name: str, path: str, baud: int) -> None:
        super().__init__(name)
        self._path = path
        self._speed = getattr(termios, f'B{baud}', None)
        if self._speed is None:
            raise InvalidValue('connections', name, 'a usual baud rate (57600, 115200, 921600)')

    def _open(self) -> int:
        line = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(line)
            settings = termios.tcgetattr(line)
            settings[4] = settings[5] = self._speed
            termios.tcsetattr(line, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            os.close(line)
            raise OSError(str(error)) from None
        return line


def open_link(name: str) -> Link:
    """The link of one entry of `connections`; raise InvalidValue where it is none."""
    try:
        kind, host, port = name.rsplit(':', 2) if not name.startswith('/') else (
            'serial', *name.rsplit(':', 1))
        number = int(port)
    except ValueError:
        raise InvalidValue('connections', name, _EXPECTED) from None
    if kind == 'serial':
        return Serial(name, host, number)
    if kind not in ('udpin', 'udpout', 'tcp') or not 0 <= number <= 65535:
        raise InvalidValue('connections', name, _EXPECTED)
    if kind == 'tcp':
        return Tcp(name, host, number)
    return Udp(name, host, number, bind=kind == 'udpin')
