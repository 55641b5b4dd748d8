# SPDX-License-Identifier: Apache-2.0
"""Writes messages as they come into an MCAP file, with the definitions of their types."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import Writer

from uav_task_alloc.errors import InvalidValue

ABOUT = 'uav_task_alloc'  # name of the metadata: origin, speedup
_CHUNK = 512 * 1024  # [bytes] held in memory at most, before compression


class Bag:
    """An MCAP file of ROS 2 messages. What was there at the last `flush` outlives the process.

    In memory are one chunk and, for each chunk written, its index: 0.6 kB with messages of three
    topics, 2.4 kB with those of thirty. Raises InvalidValue where the file holds something
    already, OSError where it cannot be written.
    """

    def __init__(self, path: Path, about: Mapping[str, str]) -> None:
        if path.exists() and path.stat().st_size:
            raise InvalidValue('record', str(path), 'a file that is not there yet')
        path.parent.mkdir(parents=True, exist_ok=True)
        self.file = path.open('wb')
        self.writer = Writer(self.file, chunk_size=_CHUNK)
        self.writer.start(profile=Profile.ROS2, library='uav_task_alloc')
        self.writer.add_metadata(ABOUT, dict(about))
        self.flush()
        self.schemas: dict[str, int] = {}
        self.channels: dict[str, tuple[int, int]] = {}  # topic: channel, messages so far

    def open(self, topic: str, type_name: str, definition: str) -> None:
        """A topic that will come; `definition` is the text of its type and all it is made of."""
        if type_name not in self.schemas:
            self.schemas[type_name] = self.writer.register_schema(
                type_name, SchemaEncoding.ROS2, definition.encode())
        channel = self.writer.register_channel(topic, MessageEncoding.CDR,
                                               self.schemas[type_name])
        self.channels[topic] = (channel, 0)

    def add(self, topic: str, data: bytes, received: int, published: int) -> None:
        """One message as CDR; times [ns] since the epoch."""
        channel, count = self.channels[topic]
        self.channels[topic] = (channel, count + 1)
        self.writer.add_message(channel, received, data, published, count)

    def flush(self) -> None:
        """Hand everything to the system, as a chunk that can be read without the end."""
        self.writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Write the index and let go."""
        if not self.file.closed:
            try:
                self.writer.finish()  # type: ignore[no-untyped-call]
            finally:
                self.file.close()

    def __enter__(self) -> Bag:
        """`with Bag(...) as bag`."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Close."""
        self.close()
