# SPDX-License-Identifier: Apache-2.0
"""The newest of each part of the page, and each part's past up to a limit; for two threads."""
from __future__ import annotations

import json
import threading
import zlib
from collections import deque
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

LIMIT = 64 * 2**20  # [bytes] of compressed past; the oldest goes first
ENTRIES = 1000  # of each log
_FAST = 1  # zlib level


def dump(value: Any) -> str:
    """Strict JSON without blanks; ValueError for NaN and the infinities."""
    return json.dumps(value, separators=(',', ':'), allow_nan=False)


class SnapshotStore:
    """One thread puts, others ask; every answer is JSON text of the same shape.

    {version, all, clock, parts: {name: value}, events: [...], plans: [...]}: `all` where it is
    everything, else only what is new.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self.limit = limit
        self.lock = threading.Lock()
        self.version = 0
        self.clock: dict[str, Any] = {}
        self.parts: dict[str, tuple[int, str]] = {}  # (version, JSON)
        self.logs: dict[str, deque[tuple[int, str]]] = {
            'events': deque(maxlen=ENTRIES), 'plans': deque(maxlen=ENTRIES)}
        self.past: deque[tuple[float, str, bytes]] = deque()  # (wall, part, JSON compressed)
        self.before: dict[str, bytes] = {}  # parts as they were when the past begins
        self.begin: float | None = None  # [unix s] of the past
        self.size = 0  # [bytes] of the past

    def put(self, wall: float, clock: Mapping[str, Any], parts: Mapping[str, Any],
            events: Iterable[Any] = (), plans: Iterable[Any] = ()) -> None:
        """What is new at `wall` [unix s], which never falls."""
        texts = {name: dump(value) for name, value in parts.items()}
        packed = {name: zlib.compress(text.encode(), _FAST) for name, text in texts.items()}
        with self.lock:
            self.version += 1
            self.parts.update((name, (self.version, text)) for name, text in texts.items())
            for name, entries in (('events', events), ('plans', plans)):
                self.logs[name].extend((self.version, dump(entry)) for entry in entries)
            self.past.extend((wall, name, data) for name, data in packed.items())
            self.size += sum(map(len, packed.values()))
            self.begin = wall if self.begin is None else self.begin
            self.forget()
            self.clock = {**clock, 'wall': wall, 'begin': self.begin}

    def forget(self) -> None:
        """Give up the oldest past beyond the limit; the values then in force are kept."""
        while self.size > self.limit and len(self.past) > 1:
            wall, name, data = self.past.popleft()
            self.before[name] = data
            self.size -= len(data)
            self.begin = wall

    def news(self, since: int) -> tuple[int, str]:
        """(version, what is newer than version `since`); 0 or one of the future: everything."""
        with self.lock:
            since = since if since <= self.version else 0
            parts = {name: text for name, (version, text) in self.parts.items()
                     if version > since}
            logs = {name: newer(log, since) for name, log in self.logs.items()}
            return self.version, self.text(since == 0, parts, logs)

    def at(self, wall: float) -> str:
        """All parts as they were at `wall` [unix s], without logs."""
        with self.lock:
            past, found = list(self.past), dict(self.before)
        for when, name, data in past:
            if when > wall:
                break
            found[name] = data
        parts = {name: zlib.decompress(data).decode() for name, data in found.items()}
        return self.text(True, parts, {})

    def text(self, everything: bool, parts: Mapping[str, str],
             logs: Mapping[str, Iterable[str]]) -> str:
        """The answer around texts that are JSON already."""
        inner = ','.join(f'{dump(name)}:{text}' for name, text in parts.items())
        lists = ''.join(f',"{name}":[{",".join(log)}]' for name, log in logs.items())
        return (f'{{"version":{self.version},"all":{dump(everything)},'
                f'"clock":{dump(self.clock)},"parts":{{{inner}}}{lists}}}')


def newer(log: deque[tuple[int, str]], since: int) -> list[str]:
    """The entries of a log after a version, oldest first."""
    count = 0
    for version, _ in reversed(log):
        if version <= since:
            break
        count += 1
    return [text for _, text in islice(log, len(log) - count, None)]
