# SPDX-License-Identifier: Apache-2.0
"""Current and past values of the page's parts, up to a memory limit; for two threads."""
from __future__ import annotations

import json
import threading
import zlib
from collections import deque
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

HISTORY_LIMIT = 64 * 2**20  # [bytes] of compressed past values; the oldest are dropped first
UPDATE_PERIOD = 0.5  # [s] between two updates of a page
MAX_LOG_ENTRIES = 1000  # of each log
_FAST = 1  # zlib level


def to_json(value: Any) -> str:
    """Compact JSON. Raises ValueError for NaN and the infinities."""
    return json.dumps(value, separators=(',', ':'), allow_nan=False)


class SnapshotStore:
    """Snapshots as JSON text; one thread writes, others read.

    Each text is {version, all, clock, parts: {name: value}, events: [...], plans: [...]}; `all`
    says whether it holds all parts and entries or only changes.

    Args:
        limit: [bytes] of compressed past values.

    Arguments of methods:
        wall: [unix s].
        parts: JSON values by name.
        logs: entries by log, as JSON.
        everything: whether it is the whole state, not a change.
    """

    def __init__(self, limit: int = HISTORY_LIMIT) -> None:
        self.limit = limit
        self.lock = threading.Lock()
        self.version = 0
        self.clock: dict[str, Any] = {}
        self.parts: dict[str, tuple[int, str]] = {}  # (version, JSON)
        self.logs: dict[str, deque[tuple[int, str]]] = {
            'events': deque(maxlen=MAX_LOG_ENTRIES), 'plans': deque(maxlen=MAX_LOG_ENTRIES)}
        self.past: deque[tuple[float, str, bytes]] = deque()  # (wall, part, compressed JSON)
        self.before: dict[str, bytes] = {}  # parts as they were at `begin`
        self.begin: float | None = None  # [unix s] of the oldest past value
        self.size = 0  # [bytes] of `past`

    def put(self, wall: float, clock: Mapping[str, Any], parts: Mapping[str, Any],
            events: Iterable[Any] = (), plans: Iterable[Any] = ()) -> None:
        """Store changes.

        Args:
            wall: [unix s], not before that of the last call.
            clock: values of the page's clock.
            parts: new values by name.
            events, plans: new entries of the logs.
        """
        texts = {name: to_json(value) for name, value in parts.items()}
        packed = {name: zlib.compress(text.encode(), _FAST) for name, text in texts.items()}
        with self.lock:
            self.version += 1
            self.parts.update((name, (self.version, text)) for name, text in texts.items())
            for name, entries in (('events', events), ('plans', plans)):
                self.logs[name].extend((self.version, to_json(entry)) for entry in entries)
            self.past.extend((wall, name, data) for name, data in packed.items())
            self.size += sum(map(len, packed.values()))
            self.begin = wall if self.begin is None else self.begin
            self.drop_oldest()
            self.clock = {**clock, 'wall': wall, 'begin': self.begin}

    def drop_oldest(self) -> None:
        """Drop the oldest past values beyond the limit; the value at `begin` is kept."""
        while self.size > self.limit and len(self.past) > 1:
            wall, name, data = self.past.popleft()
            self.before[name] = data
            self.size -= len(data)
            self.begin = wall

    def updates_since(self, since: int) -> tuple[int, str]:
        """The version, and the changes after version `since`; all for 0 or an unknown one."""
        with self.lock:
            since = since if since <= self.version else 0
            parts = {name: text for name, (version, text) in self.parts.items()
                     if version > since}
            logs = {name: entries_after(log, since) for name, log in self.logs.items()}
            return self.version, self.text(since == 0, parts, logs)

    def at(self, wall: float) -> str:
        """All parts as they were at `wall` [unix s], without logs."""
        with self.lock:
            past, values = list(self.past), dict(self.before)
        for when, name, data in past:
            if when > wall:
                break
            values[name] = data
        parts = {name: zlib.decompress(data).decode() for name, data in values.items()}
        return self.text(True, parts, {})

    def text(self, everything: bool, parts: Mapping[str, str],
             logs: Mapping[str, Iterable[str]]) -> str:
        """Compose a text from parts and entries that are JSON already."""
        inner = ','.join(f'{to_json(name)}:{text}' for name, text in parts.items())
        lists = ''.join(f',"{name}":[{",".join(log)}]' for name, log in logs.items())
        return (f'{{"version":{self.version},"all":{to_json(everything)},'
                f'"clock":{to_json(self.clock)},"parts":{{{inner}}}{lists}}}')


def entries_after(log: deque[tuple[int, str]], since: int) -> list[str]:
    """The entries of a log after a version, oldest first."""
    count = 0
    for version, _ in reversed(log):
        if version <= since:
            break
        count += 1
    return [text for _, text in islice(log, len(log) - count, None)]
