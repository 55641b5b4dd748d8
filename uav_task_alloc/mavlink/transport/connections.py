# SPDX-License-Identifier: Apache-2.0
"""All links as one: a decoder for each remote, one encoder, signing, and the tlog recording."""
from __future__ import annotations

import selectors
import struct
import threading
from collections.abc import Callable, Collection, Hashable, Iterable
from contextlib import suppress
from typing import Any, BinaryIO

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec, Message
from uav_task_alloc.mavlink.transport.link import MAX_UNCONFIRMED, Link
from uav_task_alloc.mavlink.transport.link_traffic import LinkTraffic
from uav_task_alloc.mavlink.transport.refused_messages import RefusedMessages, failure
from uav_task_alloc.mavlink.transport.signing import SigningClock

Address = tuple[int, Hashable]  # index of the link, remote on it


class Connections:
    """Messages on several links; any thread may send, one thread may receive.

    Args:
        links: opened or opening links; an Address holds the index of one.
        system: own system id.
        component: own component id.
        wall: wall clock [s] since 1970, for signing and the recording.
        wanted: message ids to decode; None: all.
        signing_key_file: path of the key; '': no signing.
        tlog: path of the recording; '': none.

    Arguments of methods:
        timeout: [s].
        message: of the dialect, not yet packed.
        now: steady time [s].
        addresses: (link, remote) each.

    Raises:
        InvalidValue: the key, its timestamp or the recording cannot be opened.
    """

    def __init__(self, links: Iterable[Link], system: int, component: int, *,
                 wall: Callable[[], float], wanted: Collection[int] | None = None,
                 signing_key_file: str = '', tlog: str = '') -> None:
        self._ids, self._wall, self._wanted = (system, component), wall, wanted
        self.signing = SigningClock(signing_key_file, wall) if signing_key_file else None
        self._record = open_record(tlog) if tlog else None
        self.record_error = ''  # why no more of the recording is written
        self.links = list(links)  # last: iterating may open them
        self.traffic = [LinkTraffic() for _ in self.links]
        self._encoder = Codec(system, component,
                            signing=self.signing.outgoing if self.signing else None)
        self.refusals = RefusedMessages()  # could not be decoded or encoded
        self._parsers: dict[Address, Codec] = {}  # ordered by the last reception
        self._kept: frozenset[Address] = frozenset()
        self._errors = 0  # of removed parsers
        self._lock = threading.Lock()  # held while a link is used; no link operation blocks
        self._selector = selectors.DefaultSelector()
        self._watched = [(-1, 0)] * len(self.links)  # file number and open count of each

    def receive(self, timeout: float) -> list[tuple[Address, Message]]:
        """Wait for messages, at most `timeout` [s].

        Returns:
            Decoded messages, each with the address it came from; [] on timeout.
        """
        self._watch()
        received: list[tuple[Address, Message]] = []
        for key, _ in self._selector.select(timeout):
            number = key.data
            with self._lock:  # a link that fails drops its send buffer, which `send` may be using
                chunks = self.links[number].read()
            for remote, data in chunks:
                messages = self._parse((number, remote), data)
                self.traffic[number].add(len(data), len(messages))
                received += messages
        return received

    def send(self, messages: Iterable[tuple[Any, Message]]) -> None:
        """Send each message to its address; one that cannot be encoded is dropped and reported.

        Args:
            messages: pairs of Address and message.
        """
        with self._lock:
            if self.signing is not None:
                self.signing.catch_up()
            for (number, remote), message in messages:
                try:
                    frame = self._encoder.pack(message)
                    self._write_record(frame)
                    self.links[number].write(remote, frame)
                except Exception as error:
                    self.refusals.add(f'to {remote}', message.get_type(), failure(error), 'error')

    def send_to_all(self, message: Message) -> None:
        """Send to every known remote."""
        self.send(((number, remote), message) for number, link in enumerate(self.links)
                  for remote in link.remotes())

    def step(self, now: float) -> None:
        """Reconnect links, and save the signing timestamp; `now`: steady time [s]."""
        with self._lock:
            for link, traffic in zip(self.links, self.traffic, strict=True):
                link.step(now)
                traffic.step(now, link.opened if link.fileno() >= 0 else 0)
        if self.signing is not None:
            self.signing.step(now)

    def errors(self) -> int:
        """Number of rejected frames and bytes on all links."""
        return self._errors + sum(parser.errors for parser in list(self._parsers.values()))

    def keep(self, addresses: Iterable[Address]) -> None:
        """Set the addresses of known vehicles, which are never removed."""
        self._kept = frozenset(addresses)
        with self._lock:
            for number, link in enumerate(self.links):
                link.keep([remote for at, remote in self._kept if at == number])

    def close(self) -> None:
        with self._lock:
            for link in self.links:
                link.close()
            self._selector.close()
        if self._record:
            with suppress(OSError):
                self._record.close()

    def _watch(self) -> None:
        """Update the selector; links may be reopened, and exchange file numbers."""
        with self._lock:  # a sender closes a link that fails
            files = [(link.fileno(), link.opened) for link in self.links]
            changed = [n for n, file in enumerate(files) if file != self._watched[n]]
            for number in changed:
                if self._watched[number][0] >= 0:
                    self._selector.unregister(self._watched[number][0])
            for number in changed:
                if files[number][0] >= 0:
                    self._selector.register(files[number][0], selectors.EVENT_READ, number)
            self._watched = files

    def _parse(self, address: Address, data: bytes) -> list[tuple[Address, Message]]:
        parser = self._parsers.pop(address, None) or Codec(
            *self._ids, wanted=self._wanted,
            signing=self.signing.incoming if self.signing else None,
            tap=self._write_record if self._record else None)
        self._parsers[address] = parser
        self._forget_unconfirmed()
        try:
            messages = parser.parse(data)
        except Exception as error:
            self.refusals.add(f'from {address[1]}', 'bytes', failure(error))
            messages = []
            parser.drop()
        if self.links[address[0]].datagrams:
            parser.drop()
        return [(address, message) for message in messages]

    def _forget_unconfirmed(self) -> None:
        """Remove the oldest parsers of unconfirmed remotes; a stream keeps its split frame."""
        unconfirmed = [address for address in self._parsers if address not in self._kept
                       and self.links[address[0]].datagrams] if (
            len(self._parsers) > len(self._kept) + len(self.links) + MAX_UNCONFIRMED) else []
        for address in unconfirmed[:-MAX_UNCONFIRMED]:
            self._errors += self._parsers.pop(address).errors

    def _write_record(self, frame: bytes) -> None:
        record = self._record  # another thread may close it
        if record is None:
            return
        try:
            record.write(struct.pack('>Q', int(self._wall() * 1e6)) + frame)
        except (OSError, ValueError) as error:  # disk full: end the recording only
            self.record_error = self.record_error or (
                f'{getattr(error, "strerror", None) or error}: no more frames are recorded')
            self._record = None
            with suppress(OSError):
                record.close()


def open_record(path: str) -> BinaryIO:
    """Open a recording for appending.

    Raises:
        InvalidValue: it cannot be written.
    """
    try:
        return open(path, 'ab')
    except OSError as error:
        raise InvalidValue('tlog', path, f'a file that can be written ({error})') from None
