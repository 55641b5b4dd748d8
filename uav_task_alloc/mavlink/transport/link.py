# SPDX-License-Identifier: Apache-2.0
"""Non-blocking links: UDP in and out, TCP client, serial; the only sockets of the bridge."""
from __future__ import annotations

import errno
import fcntl
import os
import socket
import termios
import tty
from collections.abc import Collection, Hashable
from contextlib import suppress
from typing import Protocol

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.host_lookup import HostLookup

_CHUNK = 65536  # [B] larger than any datagram
_BACKLOG = 65536  # [B] of the send buffer of a stream; more is dropped
_RECONNECT = 1.0  # [s] between attempts
_UNANSWERED = 5000  # [ms] after which a TCP peer that confirms nothing is gone; heartbeats: 1 Hz
MAX_UNCONFIRMED = 32  # remotes of one link without a known vehicle; the latest are kept
_TTY = 'expected a serial port'
_SERIAL_HINTS = {errno.EISDIR: _TTY, errno.ENOTTY: _TTY, errno.EACCES: (
    'expected a port that this user may read and write, as a member of its group (dialout)')}
_EXPECTED = 'udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or /dev/tty...:BAUD'


class Link(Protocol):
    """A transport to one or several remotes."""

    name: str
    datagrams: bool  # no frame spans two reads
    opened: int  # open count; a reopened link may have the same file number
    trouble: str  # why nothing can be received; '': no reason is known

    def fileno(self) -> int:
        """The open file number; -1: closed."""

    def read(self) -> list[tuple[Hashable, bytes]]:
        """Received bytes with their remote; [] if there are none."""

    def write(self, remote: Hashable, data: bytes) -> None:
        """Send to a remote; dropped if the link is closed or its buffer full."""

    def step(self, now: float) -> None:
        """Reopen a closed link, send buffered bytes; `now`: steady time [s]."""

    def remotes(self) -> list[Hashable]:
        """Known remotes."""

    def keep(self, remotes: Collection[Hashable]) -> None:
        """Set the remotes of known vehicles, which are never removed."""

    def close(self) -> None:
        """Close the file; buffered bytes are dropped."""


class Udp:
    """UDP: udpin learns its remotes by reception, udpout has one from the start."""

    datagrams, opened, trouble = True, 1, ''

    def __init__(self, name: str, host: str, port: int, bind: bool) -> None:
        self.name = name
        self._remotes: dict[Hashable, None] = {}  # ordered by the last reception
        self._configured: frozenset[Hashable] = frozenset()  # the remote of udpout
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        try:
            if bind:  # without SO_REUSEADDR, which would let a second bridge take over the port
                self._socket.bind((host, port))
            else:
                self._configured = frozenset({(socket.gethostbyname(host), port)})
                self._remotes.update(dict.fromkeys(self._configured))
                self._socket.bind(('', 0))
        except OSError as error:
            self._socket.close()
            wanted = (f'a known host ({error})' if isinstance(error, socket.gaierror)
                      else f'a free port ({error})')
            raise InvalidValue('connections', name, wanted) from None
        self._kept: frozenset[Hashable] = self._configured

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> list[tuple[Hashable, bytes]]:
        received: list[tuple[Hashable, bytes]] = []
        try:
            while len(received) < 256:
                data, remote = self._socket.recvfrom(_CHUNK)
                self._remember(remote)
                received.append((remote, data))
        except OSError:  # queue empty, or port unreachable for an earlier datagram
            pass
        return received

    def _remember(self, remote: Hashable) -> None:
        self._remotes.pop(remote, None)
        self._remotes[remote] = None
        if len(self._remotes) > len(self._kept) + MAX_UNCONFIRMED:
            del self._remotes[next(old for old in self._remotes if old not in self._kept)]

    def keep(self, remotes: Collection[Hashable]) -> None:
        self._kept = frozenset(remotes) | self._configured

    def write(self, remote: Hashable, data: bytes) -> None:
        with suppress(OSError):  # a lost datagram, which the protocols tolerate
            self._socket.sendto(data, remote)  # type: ignore[call-overload]

    def step(self, now: float) -> None:
        """Nothing to do: a UDP socket stays open."""

    def remotes(self) -> list[Hashable]:
        return list(self._remotes)

    def close(self) -> None:
        self._socket.close()


class Stream:
    """Base class of byte streams with one remote: TCP and serial."""

    datagrams = False

    def __init__(self, name: str) -> None:
        self.name, self.opened, self.trouble = name, 0, ''
        self._file = -1
        self._send_buffer = bytearray()
        self._open_at = float('-inf')  # [s] next attempt

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
            return self._broken('closed by the remote')
        self.trouble = ''
        return [(self.name, data)]

    def _broken(self, reason: str | None) -> list[tuple[Hashable, bytes]]:
        self.trouble = reason or 'broken'
        self.close()
        return []

    def write(self, remote: Hashable, data: bytes) -> None:
        if self._file >= 0 and len(self._send_buffer) + len(data) <= _BACKLOG:
            self._send_buffer += data
            self._flush()

    def step(self, now: float) -> None:
        if self._file < 0 and now >= self._open_at:
            self._open_at = now + _RECONNECT
            try:
                self._file = self._open()
                self.opened += 1
            except OSError as error:
                self._file, self.trouble = -1, error.strerror or str(error)
        elif self._send_buffer:
            self._flush()

    def _flush(self) -> None:
        try:
            del self._send_buffer[:os.write(self._file, self._send_buffer)]
        except BlockingIOError:
            pass
        except OSError as error:
            self._broken(error.strerror)

    def remotes(self) -> list[Hashable]:
        return [self.name]

    def keep(self, remotes: Collection[Hashable]) -> None:
        """Nothing to do: the only remote is always kept."""

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
        self._file = -1
        self._send_buffer.clear()


class Tcp(Stream):
    """A TCP client, as SITL listens; reconnects when the connection is lost."""

    def __init__(self, name: str, host: str, port: int) -> None:
        super().__init__(name)
        self._host, self._port = HostLookup(host), port

    def _open(self) -> int:
        address = self._host.address(), self._port
        client = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if hasattr(socket, 'TCP_USER_TIMEOUT'):  # Linux; else it takes a quarter of an hour
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED)
        try:
            client.connect(address)
        except BlockingIOError:
            pass  # in progress; a refusal is reported by the first read
        except OSError:
            client.close()
            raise
        return client.detach()


class Serial(Stream):
    """A serial port in raw mode, locked: two readers would each get a part of the bytes."""

    def __init__(self, name: str, path: str, baud: int) -> None:
        super().__init__(name)
        self._path = path
        self._speed = getattr(termios, f'B{baud}', termios.B0)
        if self._speed == termios.B0:  # which would hang up
            raise InvalidValue('connections', name, 'a usual baud rate (57600, 115200, 921600)')

    def _open(self) -> int:
        try:
            port = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise _with_hint(error) from None
        try:
            self._prepare(port)
        except (OSError, termios.error) as error:
            os.close(port)
            raise _with_hint(error) from None
        return port

    def _prepare(self, port: int) -> None:
        tty.setraw(port)
        settings = termios.tcgetattr(port)
        # as another program may have left it: two stop bits, no receiver, modem lines that hang up
        settings[2] = settings[2] & ~termios.CSTOPB | termios.CREAD | termios.CLOCAL
        settings[4] = settings[5] = self._speed
        termios.tcsetattr(port, termios.TCSANOW, settings)
        if termios.tcgetattr(port)[4:6] != [self._speed, self._speed]:
            raise OSError('the device has no such baud rate')
        try:
            fcntl.flock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OSError('in use by another program, or another of these connections') from None


def _with_hint(error: OSError | termios.error) -> OSError:
    """The error of a serial port in words, and what is expected, where that is known."""
    number, text = error.args[:2] if len(error.args) > 1 else (0, str(error))
    hint = _SERIAL_HINTS.get(number)
    return OSError(f'{text}: {hint}' if hint else text)


def open_link(name: str) -> Link:
    """Open the link of one entry of the parameter `connections`.

    Args:
        name: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or /dev/tty...:BAUD.

    Returns:
        An open UDP socket; a TCP or serial link connects while it is polled, and again when it is
        lost.

    Raises:
        InvalidValue: the entry is malformed, or its UDP port is not free.
    """
    try:
        kind, host, port = name.rsplit(':', 2) if not name.startswith('/') else (
            'serial', *name.rsplit(':', 1))
        number = int(port)
    except ValueError:
        raise InvalidValue('connections', name, _EXPECTED) from None
    if kind == 'serial':
        return Serial(name, host, number)
    lowest = 0 if kind == 'udpin' else 1  # udpin: any host, any free port
    if (kind not in ('udpin', 'udpout', 'tcp') or not lowest <= number <= 65535
            or not (host or kind == 'udpin')):
        raise InvalidValue('connections', name, _EXPECTED)
    if kind == 'tcp':
        return Tcp(name, host, number)
    return Udp(name, host, number, bind=kind == 'udpin')
