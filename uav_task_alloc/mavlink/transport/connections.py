# SPDX-License-Identifier: Apache-2.0
"""All links as one: a parser for each far end, one voice, signing, a recording."""
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
from uav_task_alloc.mavlink.transport.refused_messages import RefusedMessages, failure
from uav_task_alloc.mavlink.transport.signing import SigningClock

Address = tuple[int, Hashable]  # number of the link, far end on it


class Connections:
    """Bytes on links to messages and back; thread safe to send, one thread may receive."""

    def __init__(self, links: Iterable[Link], system: int, component: int, *,
                 wall: Callable[[], float], wanted: Collection[int] | None = None,
                 signing_key_file: str = '', tlog: str = '') -> None:
        """`wanted`: ids of the messages to decode; None: all."""
        self._ids, self._wall, self._wanted = (system, component), wall, wanted
        self.signing = SigningClock(signing_key_file, wall) if signing_key_file else None
        self._record = open_record(tlog) if tlog else None
        self.links = list(links)  # last, as they may be opened by this
        self._encoder = Codec(system, component,
                            signing=self.signing.outgoing if self.signing else None)
        self.refusals = RefusedMessages()  # what could not be decoded, or encoded
        self._parsers: dict[Address, Codec] = {}  # the one heard last at the end
        self._kept: frozenset[Address] = frozenset()
        self._errors = 0  # of parsers that are gone
        self._lock = threading.Lock()  # held for all that touches a link: none of it blocks
        self._selector = selectors.DefaultSelector()
        self._watched = [(-1, 0)] * len(self.links)  # the file of each, how often opened

    def receive(self, timeout: float) -> list[tuple[Address, Message]]:
        """What comes within `timeout` [s]; returns as soon as there is something."""
        self._watch()
        got: list[tuple[Address, Message]] = []
        for key, _ in self._selector.select(timeout):
            number = key.data
            with self._lock:  # a line that breaks drops what a sender may be writing
                read = self.links[number].read()
            for end, data in read:
                got += self._parse((number, end), data)
        return got

    def send(self, messages: Iterable[tuple[Any, Message]]) -> None:
        """Each message to its address; one that cannot be encoded is dropped and told."""
        with self._lock:
            if self.signing is not None:
                self.signing.catch_up()
            for (number, end), message in messages:
                try:
                    frame = self._encoder.pack(message)
                    self._write_record(frame)
                    self.links[number].write(end, frame)
                except Exception as error:
                    self.refusals.add(f'to {end}', message.get_type(), failure(error), 'error')

    def send_to_all(self, message: Message) -> None:
        """To every far end that is known."""
        self.send(((number, end), message) for number, link in enumerate(self.links)
                  for end in link.ends())

    def step(self, now: float) -> None:
        """Let time pass: reconnect, and keep the signing timestamp on disk."""
        with self._lock:
            for link in self.links:
                link.step(now)
        if self.signing is not None:
            self.signing.step(now)

    def errors(self) -> int:
        """Frames refused so far, on all links."""
        return self._errors + sum(parser.errors for parser in list(self._parsers.values()))

    def keep(self, addresses: Iterable[Address]) -> None:
        """These are of known vehicles: whoever else speaks, they are not forgotten."""
        self._kept = frozenset(addresses)
        with self._lock:
            for number, link in enumerate(self.links):
                link.keep([end for at, end in self._kept if at == number])

    def close(self) -> None:
        with self._lock:
            for link in self.links:
                link.close()
            self._selector.close()
        if self._record:
            with suppress(OSError):
                self._record.close()

    def _watch(self) -> None:
        """Wait for the files that the links have now; a number may pass from one to another."""
        with self._lock:  # a sender may close a line that breaks
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
        """Of datagrams; a stream may stand in the middle of a frame."""
        strangers = [address for address in self._parsers if address not in self._kept
                     and self.links[address[0]].datagrams] if (
            len(self._parsers) > len(self._kept) + len(self.links) + MAX_UNCONFIRMED) else []
        for address in strangers[:-MAX_UNCONFIRMED]:
            self._errors += self._parsers.pop(address).errors

    def _write_record(self, frame: bytes) -> None:
        record = self._record  # the other thread may end it meanwhile
        if record is None:
            return
        try:
            record.write(struct.pack('>Q', int(self._wall() * 1e6)) + frame)
        except (OSError, ValueError):  # the disk is full: the flight goes on, and the heartbeat
            self._record = None
            with suppress(OSError):
                record.close()


def open_record(path: str) -> BinaryIO:
    """A recording to add to; raise InvalidValue where that cannot be."""
    try:
        return open(path, 'ab')
    except OSError as error:
        raise InvalidValue('tlog', path, f'a file that can be written ({error})') from None
